// The experiments of the double layer paper, repeated: measures parts by name, each kept as JSON, and writes the page.
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

#include "bench/measure.h"
#include "bench/paper/markdown.h"
#include "bench/paper/part.h"
#include "bench/program.h"
#include "cl/device.h"
#include "sdf/double_layer.h"

namespace bilayer::paper {

std::vector<Part> parts() {
    std::vector<Part> all;
    const auto add = [&](const std::vector<Part>& some, const std::vector<const char*>& names) {
        for (const char* name : names)
            for (const Part& part : some)
                if (std::string(part.name) == name) all.push_back(part);
    };
    add(accuracyParts(), {"same", "table1"});
    add(speedParts(), {"table2", "table3", "table4", "table5"});
    add(figureParts(), {"figure7", "figure8", "figure9", "figure10", "figure11"});
    add(claimParts(), {"theorems"});
    add(accuracyParts(), {"k"});
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

// Without what PoCL adds after its version.
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

void measure(const Part& part, const Run& run, const fs::path& store) {
    fmt::print(stderr, "== {} ({})\n", part.name, part.title);
    const bench::Stopwatch watch;
    json data = part.measure(run);
    const double seconds = watch.seconds();
    const json kept{
        {"when", now()}, {"seconds", seconds}, {"rounds", run.rounds}, {"machine", machine()}, {"data", data}};
    fs::create_directories(store);
    std::ofstream file(keptAt(store, part.name));
    file << kept.dump(1) << "\n";
    if (!file.flush()) throw std::runtime_error("cannot write " + keptAt(store, part.name).string());
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

constexpr const char* opening =
    "# The double layer paper, repeated\n\nY. Wu, J. Man and Z. Xie, \"A double layer method for constructing signed "
    "distance fields from triangle meshes\", *Graphical Models* 76 (2014) 214-223: each of its tables, figures and "
    "claims, its own figures beside those of this machine. `./run paper` measures all and writes this page, `./run "
    "paper table2` a part of it. The paper's numbers stand in `bench/paper/published.h`, all others are measured. "
    "[method.md](method.md) tells how the method is done here.\n\nThe paper ran on a Xeon E5-2630 of six cores and a "
    "Tesla C2075, both of 2012. Its grids span a box of side 5; models fill it but for three steps on each side.\n";

// A part of the page; what falls behind goes onto a list.
std::string textOf(const Part& part, const json& kept, std::string& behind) {
    const json& data = kept["data"];
    if (data.contains("skipped")) return fmt::format("Left out: {}.\n", data["skipped"].get<std::string>());
    std::string text = part.text(data);
    if (part.behind)
        for (const std::string& line : part.behind(data)) behind += "- " + line + "\n";
    return text + fmt::format("\n*`./run paper {}`, {} UTC, {:.0f} s, rounds: {}.*\n", part.name,
                              kept["when"].get<std::string>(), kept["seconds"].get<double>(),
                              kept["rounds"].get<int>());
}

void writePage(const fs::path& page, const fs::path& store) {
    std::string body, behind;
    std::set<std::string> machines;
    double seconds = 0;
    for (const Part& part : parts()) {
        body += fmt::format("\n## {}\n\n", part.title);
        std::ifstream file(keptAt(store, part.name));
        if (!file) {
            body += fmt::format("Not measured yet: `./run paper {}`.\n", part.name);
            continue;
        }
        const json kept = json::parse(file);
        machines.insert(sentence(kept["machine"]));
        seconds += kept["seconds"].get<double>();
        body += textOf(part, kept, behind);
    }
    std::string text = opening;
    for (const std::string& machine : machines) text += "\nMeasured on: " + machine + ".\n";
    text += fmt::format("\nAll parts together took {:.0f} minutes.\n", seconds / 60) + body +
            "\n## Where bilayer is behind\n\nThe paper, or a peer, by the numbers above:\n\n";
    text += behind.empty() ? "Nowhere.\n" : behind;
    std::ofstream file(page);
    file << wrapped(text);
    if (!file.flush()) throw std::runtime_error("cannot write " + page.string());
}

int run(int argc, char** argv) {
    CLI::App app("Repeats the experiments of the double layer paper and writes docs/paper.md.");
    std::vector<std::string> names;
    std::string store = "build/paper", docs = "docs";
    bool page = false, list = false;
    Run run;
    std::vector<std::string> known;
    for (const Part& part : parts()) known.emplace_back(part.name);
    app.add_option("parts", names, "what to measure; others keep their last results")->check(CLI::IsMember(known));
    app.add_option("--rounds", run.rounds, "turns of each builder")->capture_default_str()->check(CLI::Range(1, 99));
    app.add_option("--store", store, "folder of the results")->capture_default_str();
    app.add_option("--docs", docs, "folder of the page and its pictures")->capture_default_str();
    app.add_flag("--list", list, "names of all parts");
    app.add_flag("--page", page, "write the page from the results that there are");
    CLI11_PARSE(app, argc, argv);
    if (list) fmt::print("{}\n", fmt::join(known, "\n"));
    run.meshes = (fs::path(store) / "meshes").string();
    run.pictures = (fs::path(docs) / "paper").string();
    run.picturesOnPage = "paper";
    fs::create_directories(run.pictures);
    for (const Part& part : parts())
        if (std::count(names.begin(), names.end(), part.name)) measure(part, run, store);
    if (page) writePage(fs::path(docs) / "paper.md", store);
    return 0;
}

}  // namespace
}  // namespace bilayer::paper

int main(int argc, char** argv) {
    return bilayer::bench::program("paper", bilayer::paper::run, argc, argv);
}
