// SPDX-License-Identifier: Apache-2.0
// Reproduces the experiments of the double layer paper: measures parts by name, keeps each as JSON, and writes the
// page.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <oneapi/tbb/version.h>
#include <openvdb/version.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <set>
#include <thread>

#include <bilayer/cl/device.h>
#include "bench/measure.h"
#include "bench/paper/markdown.h"
#include "bench/paper/models.h"
#include "bench/paper/part.h"
#include "bench/paper/published.h"
#include "bench/program.h"
#include "sdf/base/openvdb.h"
#include "sdf/fill/double_layer.h"

namespace bilayer::paper {

using namespace bilayer::detail;

std::vector<Part> parts() {
    std::vector<Part> all{same(), table1(), table2(), table3(), table4(), table5()};
    const auto add = [&](const std::vector<Part>& some, const std::vector<const char*>& names) {
        for (const char* name : names)
            for (const Part& part : some)
                if (std::string(part.name) == name) all.push_back(part);
    };
    add(figureParts(), {"figure7", "figure8", "figure9", "figure10", "figure11"});
    add(claimParts(), {"theorems"});
    all.push_back(k());
    add(claimParts(), {"walls"});
    return all;
}

namespace {

using nlohmann::json;
namespace fs = std::filesystem;

// The value of a line "key : value" of a file of /proc.
std::string procValue(const char* path, const std::string& key) {
    std::ifstream file(path);
    for (std::string line; std::getline(file, line);)
        if (const auto colon = line.find(':'); line.starts_with(key) && colon != std::string::npos)
            return line.substr(line.find_first_not_of(" \t", colon + 1));
    return "unknown";
}

// Removes the suffix after PoCL's version.
std::string shortened(const std::string& version) {
    return version.substr(0, version.find("  "));
}

json machine() {
    json devicesHere = json::array();
    for (const DeviceInfo& info : devices())
        devicesHere.push_back(fmt::format("{} ({})", info.name, shortened(info.platformVersion)));
    return {{"processor", procValue("/proc/cpuinfo", "model name")},
            {"cores", std::thread::hardware_concurrency()},
            {"memory", std::stod(procValue("/proc/meminfo", "MemTotal")) / (1 << 20)},
            {"simd", simdName()},
            {"compiler", "GCC " __VERSION__},
            {"openvdb", OPENVDB_LIBRARY_VERSION_STRING},
            {"tbb", TBB_VERSION_STRING},
            {"devices", devicesHere}};
}

std::string now() {
    const std::time_t time = std::time(nullptr);
    std::array<char, 64> text{};
    std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M", std::gmtime(&time));
    return text.data();
}

fs::path keptAt(const fs::path& store, const std::string& name) {
    return store / (name + ".json");
}

// Writes a temporary file first, then renames it: the old file stays intact until the new one is complete.
void writeWhole(const fs::path& path, const std::string& text) {
    const fs::path unfinished = path.string() + ".part";
    std::ofstream file(unfinished);
    file << text;
    file.close();
    if (!file) throw std::runtime_error("cannot write " + unfinished.string());
    fs::rename(unfinished, path);
}

void measure(const Part& part, const Run& run, const fs::path& store, const std::string& revision) {
    fmt::print(stderr, "== {} ({})\n", part.name, part.title);
    const bench::Stopwatch watch;
    json data = part.measure(run);
    const double seconds = watch.seconds();
    const json kept{{"when", now()},        {"bilayer", revision},  {"seconds", seconds},
                    {"rounds", run.rounds}, {"machine", machine()}, {"data", data}};
    fs::create_directories(store);
    writeWhole(keptAt(store, part.name), kept.dump(1) + "\n");
    if (data.contains("skipped"))
        fmt::print("skipped: {}\n\n", data["skipped"].get<std::string>());
    else
        fmt::print("{}\n", part.text(data));
    fmt::print(stderr, "   {:.0f} s\n", seconds);
}

std::string sentence(const json& machine) {
    std::string text = fmt::format(
        "{}, {} cores, {:.0f} GiB; {}, {}, OpenVDB {}, TBB {}", machine["processor"].get<std::string>(),
        machine["cores"].get<int>(), machine["memory"].get<double>(), machine["compiler"].get<std::string>(),
        machine["simd"].get<std::string>(), machine["openvdb"].get<std::string>(), machine["tbb"].get<std::string>());
    for (const json& device : machine["devices"]) text += ", " + device.get<std::string>();
    return text;
}

std::string opening() {
    return fmt::format(
        "# The double layer paper, repeated\n\nThis page repeats each table, figure and claim of one paper. The "
        "paper's "
        "figures stand next to those of this machine.\n\n"
        "- **Paper.** Y. Wu, J. Man and Z. Xie, \"A double layer method for constructing signed distance fields from "
        "triangle meshes\", *Graphical Models* 76 (2014) 214-223.\n"
        "- **Command.** `./run paper` measures all and writes this page; `./run paper table2` measures a part of it.\n"
        "- **Data.** The measured numbers are in `docs/paper/*.json`, the paper's in `bench/paper/published.h`.\n"
        "- **Method.** [method.md](method.md) explains how bilayer implements it.\n\n"
        "The paper ran on a {} and a {}. Its grids span a box of side {}: that follows from its steps and numbers of "
        "nodes, all but one of which agree. The paper does not state how much of its grid a model fills. Here it fills "
        "all but {} steps on each side.\n",
        published::processor, published::gpu, boxSide, marginNodes);
}

// State of a part.
struct Result {
    Part part;
    json kept;            // null if there is no data
    std::string problem;  // reason for the lack of data
};

Result read(const Part& part, const fs::path& store) {
    const fs::path path = keptAt(store, part.name);
    std::ifstream file(path);
    if (!file) return {part, {}, fmt::format("Not measured yet: `./run paper {}`.\n", part.name)};
    try {
        json kept = json::parse(file);
        for (const char* key : {"when", "bilayer", "seconds", "rounds", "machine", "data"}) kept.at(key);
        sentence(kept["machine"]);
        if (!kept["data"].contains("skipped")) part.text(kept["data"]);  // throws if numbers are missing or invalid
        return {part, kept, ""};
    } catch (const json::exception& error) {
        fmt::print(stderr, "{}: {}\n", path.string(), error.what());
        return {part, {}, fmt::format("`{}` cannot be read: `./run paper {}`.\n", path.string(), part.name)};
    }
}

// A part of the page. Results worse than the paper or a peer are added to a list. The machine is named if there are
// several.
std::string textOf(const Part& part, const json& kept, bool severalMachines, std::string& behind) {
    const json& data = kept["data"];
    if (data.contains("skipped")) return fmt::format("Left out: {}.\n", data["skipped"].get<std::string>());
    std::string text = part.text(data);
    if (part.behind)
        for (const std::string& line : part.behind(data)) behind += "- " + line + "\n";
    return text + fmt::format("\n*`./run paper {}`, bilayer {}, {} UTC, {:.0f} s, rounds: {}{}.*\n", part.name,
                              kept["bilayer"].get<std::string>(), kept["when"].get<std::string>(),
                              kept["seconds"].get<double>(), kept["rounds"].get<int>(),
                              severalMachines ? ", on " + sentence(kept["machine"]) : "");
}

void writePage(const fs::path& page, const fs::path& store) {
    std::vector<Result> results;
    for (const Part& part : parts()) results.push_back(read(part, store));
    std::set<std::string> machines;
    double seconds = 0;
    std::vector<std::string> missing;
    for (const Result& result : results) {
        if (result.kept.is_null() || result.kept["data"].contains("skipped"))
            missing.push_back(fmt::format("`{}`", result.part.name));
        if (result.kept.is_null()) continue;
        machines.insert(sentence(result.kept["machine"]));
        seconds += result.kept["seconds"].get<double>();
    }
    std::string body, behind;
    for (const Result& result : results)
        body +=
            fmt::format("\n## {}\n\n", result.part.title) +
            (result.kept.is_null() ? result.problem : textOf(result.part, result.kept, machines.size() > 1, behind));
    std::string text = opening();
    for (const std::string& machine : machines) text += "\nMeasured on: " + machine + ".\n";
    const std::string without = fmt::format("Not measured: {}.\n", fmt::join(missing, ", "));
    text += missing.empty() ? fmt::format("\nAll parts together took {:.0f} minutes.\n", seconds / 60) : "\n" + without;
    text += body + "\n## Where bilayer is behind\n\nWhere the paper, or a peer, is ahead by the numbers above:\n\n" +
            behind;
    if (!missing.empty())
        text += (behind.empty() ? "" : "\n") + without;
    else if (behind.empty())
        text += "Nowhere.\n";
    writeWhole(page, wrapped(text));
}

int run(int argc, char** argv) {
    CLI::App app("Repeats the experiments of the double layer paper and writes docs/paper.md.");
    std::vector<std::string> names;
    std::string store, docs = "docs", meshes = "build/paper/meshes", revision = "of no named revision";
    bool page = false, list = false;
    Run run;
    std::vector<std::string> known;
    for (const Part& part : parts()) known.emplace_back(part.name);
    app.add_option("parts", names, "parts to measure; others keep their last results")->check(CLI::IsMember(known));
    app.add_option("--rounds", run.rounds, "rounds, in each of which all builders take turns")
        ->capture_default_str()
        ->check(CLI::Range(1, 99));
    app.add_option("--docs", docs, "folder of the page, its pictures and results are in the folder paper there")
        ->capture_default_str();
    app.add_option("--store", store, "another folder of the results");
    app.add_option("--meshes", meshes, "folder of downloaded meshes")->capture_default_str();
    app.add_option("--revision", revision, "revision of the sources, which the page names");
    app.add_flag("--list", list, "names of all parts");
    app.add_flag("--page", page, "write the page from the existing results");
    CLI11_PARSE(app, argc, argv);
    if (list) fmt::print("{}\n", fmt::join(known, "\n"));
    run.meshes = meshes;
    run.pictures = (fs::path(docs) / "paper").string();
    if (store.empty()) store = run.pictures;
    run.picturesOnPage = "paper";
    fs::create_directories(run.pictures);
    for (const Part& part : parts())
        if (std::count(names.begin(), names.end(), part.name)) measure(part, run, store, revision);
    if (page) writePage(fs::path(docs) / "paper.md", store);
    return 0;
}

}  // namespace
}  // namespace bilayer::paper

int main(int argc, char** argv) {
    return bilayer::bench::program("paper", bilayer::paper::run, argc, argv);
}
