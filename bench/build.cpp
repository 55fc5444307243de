// The builders side by side: the same mesh, voxel size and band, in one run. Prints each builder's median time, its
// ratio to openvdb::tools::meshToVolume, and the memory that it takes at its peak.
//
// Reading the mesh is not timed, nor is putting its vertices into the form that each builder wants.
#include <benchmark/benchmark.h>
#include <fmt/format.h>
#include <malloc.h>
#include <openvdb/tools/MeshToVolume.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>

#include "cl/filler.h"
#include "demos/shared/shapes.h"
#include "sdf/build.h"
#include "sdf/double_layer.h"
#include "sdf/grids.h"
#include "sdf/mesh_io.h"

using namespace bilayer;

namespace {

constexpr const char* rival = "OpenVDB";
constexpr int repetitions = 7;
// "VmHWM" of /proc/self/status is the peak since this was last written to /proc/self/clear_refs
constexpr const char* resetPeak = "5";

struct Work {
    std::string name;
    Mesh mesh;
    BuildOptions options;
    std::vector<openvdb::Vec3s> points;  // in voxels
    std::vector<openvdb::Vec3I> triangles;
};

Work prepare(const std::string& name, Mesh mesh, float resolution, float halfWidth) {
    Work work{name, std::move(mesh), {}, {}, {}};
    work.options.voxelSize = voxelSizeFor(work.mesh, resolution);
    work.options.exteriorWidth = work.options.interiorWidth = halfWidth;
    for (const auto& p : work.mesh.points)
        work.points.push_back(openvdb::Vec3s(p.x, p.y, p.z) / work.options.voxelSize);
    for (const auto& t : work.mesh.triangles) work.triangles.push_back({t.x, t.y, t.z});
    return work;
}

std::uint64_t openvdbVoxels(const Work& work, int flags) {
    const auto transform = openvdb::math::Transform::createLinearTransform(work.options.voxelSize);
    const openvdb::tools::QuadAndTriangleDataAdapter<openvdb::Vec3s, openvdb::Vec3I> mesh(work.points, work.triangles);
    return openvdb::tools::meshToVolume<openvdb::FloatGrid>(mesh, *transform, work.options.exteriorWidth,
                                                            work.options.interiorWidth, flags)
        ->activeVoxelCount();
}

double statusMiB(const std::string& key) {
    std::ifstream file("/proc/self/status");
    std::string word;
    double kiB = 0;
    while (file >> word)
        if (word == key) file >> kiB;
    return kiB / 1024;
}

void add(const std::string& name, std::function<std::uint64_t()> voxels) {
    benchmark::RegisterBenchmark(name.c_str(),
                                 [voxels](benchmark::State& state) {
                                     std::ofstream("/proc/self/clear_refs") << resetPeak;
                                     ::malloc_trim(0);
                                     const double before = statusMiB("VmRSS:");
                                     std::uint64_t count = 0;
                                     for (auto _ : state) benchmark::DoNotOptimize(count = voxels());
                                     state.counters["activeVoxels"] = double(count);
                                     state.counters["peakMiB"] = statusMiB("VmHWM:") - before;
                                 })
        ->Unit(benchmark::kMillisecond)
        ->UseRealTime()
        ->Repetitions(repetitions)
        ->MinTime(0.05);
}

// Prints what Google Benchmark prints, and keeps the medians for the table.
class Reporter : public benchmark::ConsoleReporter {
  public:
    void ReportRuns(const std::vector<Run>& runs) override {
        for (const Run& run : runs) {
            if (run.run_type == Run::RT_Aggregate && run.aggregate_name == "median")
                medians_[run.run_name.function_name] = {run.GetAdjustedRealTime(), run.counters.at("activeVoxels"),
                                                        run.counters.at("peakMiB")};
            if (run.error_occurred) failed_ = true;
        }
        benchmark::ConsoleReporter::ReportRuns(runs);
    }

    void table(const std::vector<Work>& works, const std::vector<std::string>& builders) const {
        fmt::print("\n{:<24} {:<26} {:>10} {:>14} {:>10} {:>14}\n", "mesh", "builder", "median ms", "times faster",
                   "peak MiB", "active voxels");
        for (const Work& work : works)
            for (const std::string& builder : builders) {
                const auto found = medians_.find(work.name + "/" + builder),
                           reference = medians_.find(work.name + "/" + rival);
                if (found == medians_.end() || reference == medians_.end()) continue;
                const Median &m = found->second, &r = reference->second;
                fmt::print("{:<24} {:<26} {:>10.1f} {:>14.1f} {:>10.0f} {:>14.0f}\n", work.name, builder,
                           m.milliseconds, r.milliseconds / m.milliseconds, m.peakMiB, m.voxels);
            }
    }

    bool failed() const { return failed_; }

  private:
    struct Median {
        double milliseconds, voxels, peakMiB;
    };
    std::map<std::string, Median> medians_;
    bool failed_ = false;
};

std::vector<std::string> defaultMeshes() {
    std::vector<std::string> found;
    const std::filesystem::path corpus = BILAYER_MESHES;
    for (const auto& path : {corpus / "bunny_watertight.obj", corpus / "dragon_vrip_871k.ply",
                             std::filesystem::path("/usr/share/glmark2/models/bunny.obj")})
        if (std::filesystem::exists(path) && found.size() < 2) found.push_back(path.string());
    return found;
}

int run(int argc, char** argv) {
    CLI::App app("Builds narrow-band fields with bilayer and with OpenVDB, and compares the times.");
    std::vector<std::string> paths;
    float resolution = 251, halfWidth = 2;
    std::string deviceText;
    app.add_option("meshes", paths, "mesh files; by default the bunny and the dragon, where they are")
        ->check(CLI::ExistingFile);
    app.add_option("--resolution", resolution, "voxels along the longest side")->capture_default_str();
    app.add_option("--half-width", halfWidth, "of the band [voxels]")->capture_default_str();
    app.add_option("--device", deviceText, "OpenCL device, by a part of its name");
    CLI11_PARSE(app, argc, argv);
    if (paths.empty()) paths = defaultMeshes();

    openvdb::initialize();
    std::vector<Work> works;
    for (const std::string& path : paths)
        works.push_back(prepare(std::filesystem::path(path).stem().string(), readMesh(path), resolution, halfWidth));
    if (works.empty())
        works.push_back(prepare("knot", shapes::torusKnot(2, 3, 1, 0.2f, 2400, 64), resolution, halfWidth));

    const Device device = openDevice(deviceText);
    const BlockFiller opencl = openclFiller(device);
    const std::vector<std::string> builders = {rival, "OpenVDB exact", "bilayer TBB", "bilayer OpenCL"};
    for (const Work& work : works) {
        add(work.name + "/" + builders[0], [&work] { return openvdbVoxels(work, 0); });
        add(work.name + "/" + builders[1],
            [&work] { return openvdbVoxels(work, openvdb::tools::DISABLE_RENORMALIZATION); });
        add(work.name + "/" + builders[2], [&work] { return build(work.mesh, work.options).activeVoxels(); });
        add(work.name + "/" + builders[3],
            [&work, &opencl] { return build(work.mesh, work.options, opencl).activeVoxels(); });
    }
    fmt::print("resolution {:g}, half width {:g} voxels, method double-layer, SIMD {}, OpenCL device {}\n", resolution,
               halfWidth, simdName(), device.info().name);
    Reporter reporter;
    benchmark::RunSpecifiedBenchmarks(&reporter);
    reporter.table(works, builders);
    return reporter.failed() ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
    benchmark::Initialize(&argc, argv);
    try {
        return run(argc, argv);
    } catch (const std::exception& error) {
        fmt::print(stderr, "bench_build: {}\n", error.what());
        return 1;
    }
}
