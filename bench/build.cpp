// SPDX-License-Identifier: Apache-2.0
// Compares the builders on the same mesh, voxel size and band, in one run. Prints each builder's median time on each
// count of threads, its ratio to openvdb::tools::meshToVolume with flag 0x4 (exact distances) at the same half width,
// its peak memory, and a summary.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <unordered_map>

#include "bench/builders.h"
#include "bench/measure.h"
#include "bench/program.h"
#include "bench/ratios.h"
#include "sdf/fill/double_layer.h"

using namespace bilayer;
using namespace bilayer::detail;
using namespace bilayer::bench;

namespace {

// Required speed-ups over meshToVolume (0x4) on 2 threads: the geometric mean over the cells, and the slowest cell.
struct Required {
    double exact, doubleLayer, cell;
};
constexpr Required requiredCold{22, 40, 12}, requiredWarm{25, 50, 12};
constexpr double speedUpRequired = 1.8;  // from 1 to 2 threads, geometric mean
constexpr int comparedThreads = 2;

struct Options {
    std::vector<std::string> meshes,
        methods{nameOf(Builder::reference), nameOf(Builder::defaults), nameOf(Builder::pseudonormal),
                nameOf(Builder::exact), nameOf(Builder::doubleLayer)};
    std::vector<float> resolutions{128, 251, 715};
    std::vector<int> threads{1, comparedThreads};
    int repetitions = 9;
    double seconds = 1.2;  // a builder gets no further turns in a scene once it has used this time
    bool memory = true;
    bool cold = false;  // each build in a process of its own
    std::string json;
};

// One builder in one scene: its times on each count of threads.
struct Row {
    std::string mesh;
    float resolution;
    Builder builder;
    float halfWidth;
    std::unordered_map<int, std::vector<double>> seconds;
    std::uint64_t activeVoxels = 0;
    Footprint footprint;

    std::optional<double> time(int threads) const {
        const auto found = seconds.find(threads);
        return found == seconds.end() ? std::nullopt : std::optional(median(found->second));
    }
    std::optional<double> speedUp() const {
        const auto one = time(1), two = time(comparedThreads);
        return one && two ? std::optional(*one / *two) : std::nullopt;
    }
};

// Half width 3 for all builders that support it. Half width 2 is the one that the double layer method was made for; it,
// its rival and its reference use it.
std::vector<float> halfWidths(Builder builder) {
    if (builder == Builder::reference || builder == Builder::doubleLayer) return {3, 2};
    if (builder == Builder::doubleLayerOpencl || builder == Builder::prism) return {2};
    return {3};
}

std::vector<Row> emptyRows(const std::string& mesh, float resolution, const Options& options) {
    std::vector<Row> rows;
    for (const float halfWidth : {3.f, 2.f})
        for (const Builder builder : builders()) {
            const auto widths = halfWidths(builder);
            const bool wanted = std::count(options.methods.begin(), options.methods.end(), nameOf(builder)) > 0;
            if (wanted && std::count(widths.begin(), widths.end(), halfWidth))
                rows.push_back({mesh, resolution, builder, halfWidth, {}, 0, {}});
        }
    return rows;
}

void measureMemory(const Source& source, std::vector<Row>& rows) {
    for (Row& row : rows)
        row.footprint =
            inChild([&] { return scene(source, row.resolution); }, {row.builder, row.halfWidth, comparedThreads});
}

// On one thread OpenVDB runs only what the speed-up from 1 to 2 threads needs. The rest would double its share of the
// run, which is minutes.
bool wanted(const Row& row, int threads) {
    return threads > 1 ||
           (row.builder != Builder::defaults && !(row.builder == Builder::reference && row.halfWidth < 3));
}

// Builders take turns. Slow builds are repeated less.
void measureTime(const std::function<Outcome(const Job&)>& build, std::vector<Row>& rows, const Options& options) {
    for (int round = 0; round < options.repetitions; ++round)
        for (Row& row : rows)
            for (const int threads : options.threads) {
                if (!wanted(row, threads)) continue;
                std::vector<double>& seconds = row.seconds[threads];
                double spent = 0;
                for (const double s : seconds) spent += s;
                if (spent >= options.seconds) continue;
                const Outcome outcome = build({row.builder, row.halfWidth, threads});
                seconds.push_back(outcome.seconds);
                row.activeVoxels = outcome.activeVoxels;
            }
}

// Speed-up over the reference in the same scene, with the same half width and threads.
std::optional<double> ratio(const std::vector<Row>& rows, const Row& row, int threads) {
    for (const Row& other : rows)
        if (other.builder == Builder::reference && other.mesh == row.mesh && other.resolution == row.resolution &&
            other.halfWidth == row.halfWidth && other.time(threads) && row.time(threads))
            return *other.time(threads) / *row.time(threads);
    return std::nullopt;
}

std::string cell(const std::optional<double>& value, double scale = 1, int digits = 1) {
    return value ? fmt::format("{:.{}f}", *value * scale, digits) : "-";
}

void printHeader() {
    fmt::print("{:<13}{:>5}  {:<20}{:>3}{:>11}{:>11}{:>8}{:>8}{:>10}{:>10}{:>12}{:>6}\n", "mesh", "N", "builder", "W",
               "ms, 1 th.", "ms, 2 th.", "1->2", "ratio", "peak MiB", "allowed", "voxels", "runs");
}

void printRow(const std::vector<Row>& rows, const Row& row) {
    const auto runs = row.seconds.find(comparedThreads);
    const bool hasMemory = row.footprint.peakBytes > 0;
    fmt::print("{:<13}{:>5}  {:<20}{:>3}{:>11}{:>11}{:>8}{:>8}{:>10}{:>10}{:>12}{:>6}\n", row.mesh, row.resolution,
               nameOf(row.builder), row.halfWidth, cell(row.time(1), 1e3), cell(row.time(2), 1e3),
               cell(row.speedUp(), 1, 2), cell(ratio(rows, row, comparedThreads)),
               hasMemory ? fmt::format("{:.0f}", row.footprint.peakMiB()) : "-",
               hasMemory ? fmt::format("{:.0f}", row.footprint.allowedMiB()) : "-", row.activeVoxels,
               runs == row.seconds.end() ? 0 : runs->second.size());
}

// One builder at one half width over all scenes.
struct Summary {
    std::vector<double> ratios, speedUps;
    std::string slowestCell;
};

Summary summarize(const std::vector<Row>& rows, Builder builder, float halfWidth) {
    Summary summary;
    for (const Row& row : rows) {
        if (row.builder != builder || row.halfWidth != halfWidth) continue;
        if (const auto speedUp = row.speedUp()) summary.speedUps.push_back(*speedUp);
        const auto times = ratio(rows, row, comparedThreads);
        if (!times) continue;
        if (summary.ratios.empty() || *times < *std::min_element(summary.ratios.begin(), summary.ratios.end()))
            summary.slowestCell = fmt::format("{} {}", row.mesh, row.resolution);
        summary.ratios.push_back(*times);
    }
    return summary;
}

std::string judged(double value, double required) {
    return fmt::format("{:.1f} (required {:g}: {})", value, required, value >= required ? "met" : "short");
}

void printSummary(const std::vector<Row>& rows, const Required& required) {
    fmt::print("\nTimes as fast as meshToVolume (0x4) at the same half width, on {} threads\n", comparedThreads);
    for (const float halfWidth : {3.f, 2.f})
        for (const Builder builder : builders()) {
            const Summary summary = summarize(rows, builder, halfWidth);
            if (summary.ratios.empty() || builder == Builder::reference) continue;
            const double mean = geometricMean(summary.ratios),
                         smallest = *std::min_element(summary.ratios.begin(), summary.ratios.end());
            const bool held = builder == Builder::exact || builder == Builder::doubleLayer;
            const double requiredMean = builder == Builder::exact ? required.exact : required.doubleLayer;
            fmt::print("  {:<20} half width {}: geometric mean {}, minimum {} at {}\n", nameOf(builder), halfWidth,
                       held ? judged(mean, requiredMean) : fmt::format("{:.1f}", mean),
                       held ? judged(smallest, required.cell) : fmt::format("{:.1f}", smallest), summary.slowestCell);
        }
    fmt::print("Times as fast on 2 threads as on 1\n");
    for (const float halfWidth : {3.f, 2.f})
        for (const Builder builder : builders()) {
            const Summary summary = summarize(rows, builder, halfWidth);
            if (summary.speedUps.empty()) continue;
            const double mean = geometricMean(summary.speedUps);
            const bool held = builder == Builder::exact || builder == Builder::doubleLayer;
            fmt::print(
                "  {:<20} half width {}: geometric mean {:.2f}{}, minimum {:.2f}\n", nameOf(builder), halfWidth, mean,
                held ? fmt::format(" (required {}: {})", speedUpRequired, mean >= speedUpRequired ? "met" : "short")
                     : "",
                *std::min_element(summary.speedUps.begin(), summary.speedUps.end()));
        }
}

// The rounds of each builder and of its reference, on each count of threads.
void addRatios(const std::vector<Row>& rows, Ratios& ratios) {
    for (const Row& row : rows)
        for (const Row& other : rows) {
            if (row.builder == Builder::reference || other.builder != Builder::reference || other.mesh != row.mesh ||
                other.resolution != row.resolution || other.halfWidth != row.halfWidth)
                continue;
            for (const auto& [threads, seconds] : row.seconds)
                if (const auto rival = other.seconds.find(threads); rival != other.seconds.end())
                    ratios.add(fmt::format("{}, half width {}, {} at {} voxels, {} threads / {}", nameOf(row.builder),
                                           row.halfWidth, row.mesh, row.resolution, threads, nameOf(other.builder)),
                               rival->second, seconds);
        }
}

void writeJson(const std::string& path, const std::vector<Row>& rows) {
    nlohmann::json list = nlohmann::json::array();
    for (const Row& row : rows) {
        nlohmann::json item{{"mesh", row.mesh},
                            {"resolution", row.resolution},
                            {"builder", nameOf(row.builder)},
                            {"halfWidth", row.halfWidth},
                            {"activeVoxels", row.activeVoxels}};
        for (const auto& [threads, seconds] : row.seconds) item["seconds"][std::to_string(threads)] = seconds;
        if (const auto times = ratio(rows, row, comparedThreads)) item["ratio"] = *times;
        if (row.footprint.peakBytes > 0) {
            item["peakBytes"] = row.footprint.peakBytes;
            item["gridBytes"] = row.footprint.outcome.bytes;
            item["inputBytes"] = row.footprint.inputBytes;
        }
        list.push_back(item);
    }
    std::ofstream file(path);
    file << list.dump(1) << "\n";
    if (!file.flush()) throw std::runtime_error("cannot write " + path);
}

// Memory comes first: a child can be forked only before this process starts threads.
std::vector<Row> compare(const std::vector<Source>& meshes, const Options& options) {
    std::vector<std::vector<Row>> scenes;
    for (const Source& source : meshes)
        for (const float resolution : options.resolutions) {
            scenes.push_back(emptyRows(source.name, resolution, options));
            if (!options.memory) continue;
            fmt::print(stderr, "memory: {} {}\n", source.name, resolution);
            measureMemory(source, scenes.back());
        }
    std::vector<Row> all;
    auto rows = scenes.begin();
    printHeader();
    for (const Source& source : meshes)
        for (const float resolution : options.resolutions) {
            if (options.cold) {
                const auto make = [&] { return scene(source, resolution); };
                measureTime([&](const Job& job) { return inChild(make, job).outcome; }, *rows, options);
            } else {
                const Scene warm = scene(source, resolution);
                measureTime([&](const Job& job) { return run(warm, job); }, *rows, options);
            }
            for (const Row& row : *rows) printRow(*rows, row);
            std::fflush(stdout);
            all.insert(all.end(), rows->begin(), rows->end());
            ++rows;
        }
    return all;
}

int run(int argc, char** argv) {
    CLI::App app("Builds narrow-band fields with bilayer and with OpenVDB, and compares times and memory.");
    Options options;
    bool quick = false, noMemory = false;
    app.add_option("--mesh", options.meshes, "mesh names or files; by default all that exist");
    app.add_option("--resolution", options.resolutions, "voxels along the longest side")->capture_default_str();
    app.add_option("--method", options.methods, "builders")->capture_default_str();
    app.add_option("--threads", options.threads)->capture_default_str();
    app.add_option("--repetitions", options.repetitions, "maximum repetitions of each builder in a scene")
        ->capture_default_str();
    app.add_option("--seconds", options.seconds, "time after which a builder is not repeated [s]")
        ->capture_default_str();
    app.add_flag("--cold", options.cold,
                 "each build in a process of its own, after reading the mesh: its first touch of memory counts");
    app.add_option("--json", options.json, "also write all times to this file");
    app.add_flag("--no-memory", noMemory, "leave out the peaks of memory");
    app.add_flag("--quick", quick, "only 128 voxels and few repetitions");
    Ratios ratios("build");
    ratios.addOption(app);
    CLI11_PARSE(app, argc, argv);
    options.memory = !noMemory;
    if (quick) {
        options.resolutions = {128};
        options.repetitions = 3;
    }
    for (const std::string& method : options.methods) builderNamed(method);

    std::vector<Source> meshes;
    for (const std::string& mesh : options.meshes) meshes.push_back(findSource(mesh));
    if (meshes.empty()) meshes = sources();
    fmt::print(
        "N voxels along the longest side, half width W voxels, SIMD {}. Medians of up to {} runs in turns; a builder\n"
        "takes no more turns after {} s. Ratio: to meshToVolume-0x4 of the same W on {} threads. Peak: mesh and build\n"
        "together, in a process of its own; allowed: {} x (mesh + grid) + {} MiB.\n",
        simdName(), options.repetitions, options.seconds, comparedThreads, memoryFactor, memoryConstantMiB);
    fmt::print("{}\n\n", options.cold ? "Cold: each build is the first of its process."
                                      : "Warm: all builds run in one process, so memory is touched once for all.");
    const std::vector<Row> rows = compare(meshes, options);
    printSummary(rows, options.cold ? requiredCold : requiredWarm);
    if (!options.json.empty()) writeJson(options.json, rows);
    addRatios(rows, ratios);
    ratios.write();
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    return bench::program("build", run, argc, argv);
}
