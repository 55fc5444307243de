// SPDX-License-Identifier: Apache-2.0
// Compares OpenCL devices with TBB on the same mesh, voxel size and band, in one run. First each device's field is
// compared with TBB's, which also compiles the kernels. Then the builders take turns. Last, separate builds read a
// device's own clock and memory, so that profiling events do not slow the timed builds.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <fstream>
#include <glm/common.hpp>
#include <map>
#include <nlohmann/json.hpp>
#include <thread>

#include <bilayer/cl/filler.h>
#include "bench/builders.h"
#include "bench/measure.h"
#include "bench/program.h"
#include "sdf/base/method_names.h"
#include "sdf/fill/double_layer.h"

using namespace bilayer;
using namespace bilayer::detail;
using namespace bilayer::bench;

namespace {

const std::vector<std::string> usualMeshes{"bunny", "dragon", "carved box"};
constexpr double required = 1.2;  // limit of a whole build on a CPU device, times TBB's time
constexpr int profiledRuns = 3;   // the run with the median kernel time is reported
constexpr double MiB = 1 << 20;

struct Options {
    std::vector<std::string> meshes, methods{nameOf(Method::exact), nameOf(Method::doubleLayer), nameOf(Method::prism)};
    std::vector<float> resolutions{251, 715};
    std::vector<int> grid;
    std::string device;
    std::uint64_t deviceMemory = 0;
    int repetitions = 9, threads = int(std::thread::hardware_concurrency());
    double seconds = 4;  // a builder gets no further turns in a scene once it has used this time
    std::string json;
};

// A device and its builder.
struct Engine {
    Device device;
    DeviceInfo info;
    std::uint64_t memoryMiB;
    BlockFiller filler;

    // A builder with times of its own.
    BlockFiller profiled() const { return openclFiller(device, {.memoryMiB = memoryMiB, .profile = true}); }
};

Engine openEngine(const std::string& name, std::uint64_t memoryMiB) {
    const Device device = openDevice(name);
    return {device, device.info(), memoryMiB, openclFiller(device, {.memoryMiB = memoryMiB})};
}

// The requested device, or all available ones.
std::vector<Engine> openAll(const Options& options) {
    std::vector<Engine> found;
    if (!options.device.empty()) {
        found.push_back(openEngine(options.device, options.deviceMemory));
        return found;
    }
    for (const DeviceInfo& info : devices()) found.push_back(openEngine(info.name, options.deviceMemory));
    if (found.empty()) openDevice();  // throws with the missing requirement
    return found;
}

// A method on TBB and on a device.
struct Contest {
    const char* method;
    Builder tbb, opencl;
    float halfWidth;
    bool same;  // whether both must give the same field
};

// The prism method has no builder on TBB; its successor, the double layer method, is used instead.
constexpr Contest contests[] = {
    {nameOf(Method::exact), Builder::exact, Builder::exactOpencl, 3, true},
    {nameOf(Method::doubleLayer), Builder::doubleLayer, Builder::doubleLayerOpencl, 2, true},
    {nameOf(Method::prism), Builder::doubleLayer, Builder::prism, 2, false}};

// One builder in one scene.
struct Row {
    std::string mesh, voxels;  // along the longest side, or along each
    const Contest* contest;
    const Engine* engine;  // null: TBB
    Job job;
    std::size_t tbb;  // index of the TBB row of the same scene
    std::vector<double> seconds{};
    double ratio = 1;
    std::uint64_t activeVoxels = 0;
    Difference difference{};
    DeviceTimes onDevice{};

    bool held() const { return engine && contest->same; }
    bool differs() const {
        return held() && (difference.voxels > 0 || difference.signs > 0 || difference.distance > openclMargin);
    }
};

std::vector<Row> emptyRows(const Scene& scene, const std::string& voxels, const std::vector<Engine>& engines,
                           const Options& options) {
    std::vector<Row> rows;
    for (const Contest& contest : contests) {
        if (!std::count(options.methods.begin(), options.methods.end(), contest.method)) continue;
        const auto found =
            std::find_if(rows.begin(), rows.end(), [&](const Row& row) { return row.job.builder == contest.tbb; });
        const auto tbb = std::size_t(found - rows.begin());
        const Job onTbb{contest.tbb, contest.halfWidth, options.threads};
        if (found == rows.end()) rows.push_back({scene.name, voxels, &contest, nullptr, onTbb, tbb});
        for (const Engine& engine : engines) {
            const Job onDevice{contest.opencl, contest.halfWidth, options.threads, &engine.filler};
            rows.push_back({scene.name, voxels, &contest, &engine, onDevice, tbb});
        }
    }
    return rows;
}

void compareFields(const Scene& scene, std::vector<Row>& rows) {
    std::map<std::size_t, LevelSet> expected;  // key: TBB's row
    for (Row& row : rows) {
        const LevelSet field = fieldOf(scene, row.job);
        row.activeVoxels = field.activeVoxels();
        if (!row.engine) expected.emplace(row.tbb, field);
        if (row.held()) row.difference = difference(expected.at(row.tbb), field);
    }
}

// Builders take turns. Slow builds are repeated less.
void measureTime(const Scene& scene, std::vector<Row>& rows, const Options& options) {
    for (int round = 0; round < options.repetitions; ++round)
        for (Row& row : rows) {
            double spent = 0;
            for (const double s : row.seconds) spent += s;
            if (spent < options.seconds) row.seconds.push_back(run(scene, row.job).seconds);
        }
    for (Row& row : rows) row.ratio = median(row.seconds) / median(rows[row.tbb].seconds);
}

void profile(const Scene& scene, std::vector<Row>& rows) {
    for (Row& row : rows) {
        if (!row.engine) continue;
        std::vector<DeviceTimes> runs;
        Job job = row.job;
        while (runs.size() < profiledRuns) {
            const BlockFiller filler = row.engine->profiled();
            job.filler = &filler;
            runs.push_back(fieldOf(scene, job).buildTimes().device);
        }
        std::sort(runs.begin(), runs.end(),
                  [](const DeviceTimes& a, const DeviceTimes& b) { return a.kernels < b.kernels; });
        row.onDevice = runs[runs.size() / 2];
    }
}

// Where a row was built: "tbb", or the number of a device in the head of the table.
std::string placeOf(const Row& row, const std::vector<Engine>& engines) {
    return row.engine ? fmt::format("opencl {}", row.engine - engines.data() + 1) : "tbb";
}

constexpr const char* columns = "{:<13}{:>13}  {:<13}{:>3}  {:<9}{:>10}{:>7}{:>9}{:>8}{:>8}{:>9}{:>12}  {:<9}{:>5}\n";

void printHead(const std::vector<Engine>& engines, const Options& options) {
    fmt::print("tbb: {} threads, SIMD {}\n", options.threads, simdName());
    for (std::size_t i = 0; i < engines.size(); ++i) {
        const DeviceInfo& info = engines[i].info;
        fmt::print("opencl {}: {}, {}, driver {}, {} units, {:.0f} MiB{}\n", i + 1, info.name, info.platform,
                   info.driver, info.computeUnits, double(info.memoryBytes) / MiB,
                   options.deviceMemory ? fmt::format(", of which {} are used at most", options.deviceMemory) : "");
    }
    fmt::print(
        "\nMilliseconds: the whole build, mesh in memory to grid in memory, medians of up to {} runs in turns (none "
        "after\n"
        "{} s), and as a multiple of tbb's, the prism method's of double-layer's. By the device's clock, in builds of\n"
        "their own: kernels, upload, download (none where host and device share memory). Peak: of device memory.\n"
        "Apart: largest difference from tbb's distances in voxels, active voxels and signs being the same.\n\n",
        options.repetitions, options.seconds);
    fmt::print(columns, "mesh", "voxels", "method", "W", "on", "ms", "ratio", "kernels", "up", "down", "peak MiB",
               "active", "apart", "runs");
}

std::string apart(const Row& row) {
    if (!row.held()) return "-";
    if (row.difference.voxels > 0) return fmt::format("{} voxels", row.difference.voxels);
    if (row.difference.signs > 0) return fmt::format("{} signs", row.difference.signs);
    return fmt::format("{:.1e}", row.difference.distance);
}

void printRow(const Row& row, const std::vector<Engine>& engines) {
    const auto onDevice = [&](double value, int digits) {
        return row.engine ? fmt::format("{:.{}f}", value, digits) : "-";
    };
    const DeviceTimes& t = row.onDevice;
    fmt::print(columns, row.mesh, row.voxels, row.engine ? row.contest->method : nameOf(row.job.builder),
               row.job.halfWidth, placeOf(row, engines), fmt::format("{:.1f}", median(row.seconds) * 1e3),
               onDevice(row.ratio, 2), onDevice(t.kernels * 1e3, 2), onDevice(t.upload * 1e3, 2),
               onDevice(t.download * 1e3, 2), onDevice(double(t.peakBytes) / MiB, 0), row.activeVoxels, apart(row),
               row.seconds.size());
}

// Prints each device's slowest cell. Returns whether all fields are correct.
bool printSummary(const std::vector<Row>& rows, const std::vector<Engine>& engines) {
    fmt::print("\nWhole builds as multiples of tbb's time, at worst\n");
    for (const Contest& contest : contests)
        for (const Engine& engine : engines) {
            const Row* worst = nullptr;
            for (const Row& row : rows)
                if (row.engine == &engine && row.contest == &contest && (!worst || row.ratio > worst->ratio))
                    worst = &row;
            if (!worst) continue;
            const char* verdict = worst->ratio <= required ? "met" : "short";
            fmt::print("  {:<13} {}: {:.2f} at {} {}{}\n", contest.method, placeOf(*worst, engines), worst->ratio,
                       worst->mesh, worst->voxels,
                       contest.same ? fmt::format(" (required {}: {})", required, verdict) : "");
        }
    const auto held = std::count_if(rows.begin(), rows.end(), [](const Row&row) { return row.held(); }),
               differing = std::count_if(rows.begin(), rows.end(), [](const Row&row) { return row.differs(); });
    float margin = 0;
    for (const Row& row : rows) margin = std::max(margin, row.difference.distance);
    if (differing > 0)
        fmt::print("{} of {} fields differ from tbb's by more than they may\n", differing, held);
    else if (held > 0)
        fmt::print("Active voxels and signs are tbb's; distances differ by {:.1e} voxel at most (allowed {:.0e})\n",
                   margin, openclMargin);
    return differing == 0;
}

void writeJson(const std::string& path, const std::vector<Row>& rows, const std::vector<Engine>& engines) {
    nlohmann::json list = nlohmann::json::array();
    for (const Row& row : rows) {
        nlohmann::json item{{"mesh", row.mesh},
                            {"voxels", row.voxels},
                            {"builder", nameOf(row.job.builder)},
                            {"halfWidth", row.job.halfWidth},
                            {"on", placeOf(row, engines)},
                            {"seconds", row.seconds},
                            {"activeVoxels", row.activeVoxels}};
        if (row.engine) {
            item["device"] = row.engine->info.name;
            item["driver"] = row.engine->info.driver;
            item["ratio"] = row.ratio;
            item["kernels"] = row.onDevice.kernels;
            item["upload"] = row.onDevice.upload;
            item["download"] = row.onDevice.download;
            item["peakDeviceBytes"] = row.onDevice.peakBytes;
        }
        if (row.held())
            item["difference"] = {{"voxels", row.difference.voxels},
                                  {"signs", row.difference.signs},
                                  {"distance", row.difference.distance}};
        list.push_back(item);
    }
    std::ofstream file(path);
    file << list.dump(1) << "\n";
    if (!file.flush()) throw std::runtime_error("cannot write " + path);
}

// The mesh scaled along each axis so that its bounds have this many voxels of one metre.
Scene stretched(Scene scene, const std::vector<int>& voxels) {
    glm::vec3 low = scene.mesh.points.at(0), high = low;
    for (const glm::vec3& point : scene.mesh.points) {
        low = glm::min(low, point);
        high = glm::max(high, point);
    }
    const glm::vec3 scale = glm::vec3(voxels[0], voxels[1], voxels[2]) / (high - low);
    for (glm::vec3& point : scene.mesh.points) point = (point - low) * scale;
    scene.voxelSize = 1;
    return scene;
}

std::vector<Row> measure(const Scene& scene, const std::string& voxels, const std::vector<Engine>& engines,
                         const Options& options) {
    std::vector<Row> rows = emptyRows(scene, voxels, engines, options);
    compareFields(scene, rows);
    measureTime(scene, rows, options);
    profile(scene, rows);
    for (const Row& row : rows) printRow(row, engines);
    std::fflush(stdout);
    return rows;
}

std::vector<Row> measure(const Source& source, const std::vector<Engine>& engines, const Options& options) {
    if (!options.grid.empty())
        return measure(stretched(scene(source, 1), options.grid), fmt::format("{}", fmt::join(options.grid, "x")),
                       engines, options);
    std::vector<Row> all;
    for (const float resolution : options.resolutions)
        for (Row& row : measure(scene(source, resolution), fmt::format("{}", resolution), engines, options))
            all.push_back(std::move(row));
    return all;
}

int run(int argc, char** argv) {
    CLI::App app("Builds narrow-band fields on OpenCL devices and with TBB, and compares fields and times.");
    Options options;
    app.add_option("--mesh", options.meshes,
                   "mesh names or files; by default bunny, dragon and carved box, if they exist");
    auto* const resolution = app.add_option("--resolution", options.resolutions, "voxels along the longest side");
    app.add_option("--grid", options.grid, "voxels along x, y and z instead: the mesh is scaled along each")
        ->expected(3)
        ->excludes(resolution)
        ->check(CLI::PositiveNumber);
    app.add_option("--method", options.methods, "methods: exact, double-layer, prism")
        ->check(CLI::IsMember(Options().methods));
    app.add_option("--device", options.device, "part of the name of one device; by default all are measured");
    app.add_option("--device-memory", options.deviceMemory, "maximum device memory [MiB]");
    app.add_option("--repetitions", options.repetitions, "maximum repetitions of each builder in a scene")
        ->capture_default_str();
    app.add_option("--seconds", options.seconds, "time after which a builder is not repeated [s]")
        ->capture_default_str();
    app.add_option("--json", options.json, "also write all times to this file");
    CLI11_PARSE(app, argc, argv);

    std::vector<Source> meshes;
    for (const std::string& mesh : options.meshes) meshes.push_back(findSource(mesh));
    if (meshes.empty())
        for (const Source& source : sources())
            if (std::count(usualMeshes.begin(), usualMeshes.end(), source.name)) meshes.push_back(source);
    const std::vector<Engine> engines = openAll(options);
    printHead(engines, options);
    std::vector<Row> rows;
    for (const Source& source : meshes)
        for (Row& row : measure(source, engines, options)) rows.push_back(std::move(row));
    const bool same = printSummary(rows, engines);
    if (!options.json.empty()) writeJson(options.json, rows, engines);
    return same ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
    return bench::program("opencl", run, argc, argv);
}
