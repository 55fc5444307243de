// SPDX-License-Identifier: Apache-2.0
// Fields of small meshes, as games and robots have them by the thousand: microseconds per build, compared with
// openvdb::tools::meshToVolume with flag 0x4 at the same half width; and what the smallest field of all costs.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <limits>
#include <vector>

#include "bench/builders.h"
#include "bench/measure.h"
#include "bench/program.h"
#include "bench/ratios.h"
#include "demos/shared/shapes.h"

using namespace bilayer;
using namespace bilayer::bench;

namespace {

constexpr double ratioRequired = 15, fixedMicrosecondsAllowed = 50;

struct Options {
    std::vector<float> resolutions{32, 64, 128};
    std::vector<int> threads{1, 2};
    int rounds = 9;
    double seconds = 0.02;  // of each builder in a round
};

/// A builder of ours and the half width that it is used with; the rival gets the same.
struct Contest {
    Builder builder;
    float halfWidth;
};
constexpr Contest contests[]{{Builder::exact, 3}, {Builder::doubleLayer, 2}};

std::vector<Mesh> meshes() {
    std::vector<Mesh> all{shapes::box({1, 0.8f, 0.6f})};
    for (const int subdivisions : {1, 2, 3, 4}) all.push_back(shapes::sphere(1, subdivisions));
    all.push_back(shapes::torusKnot(2, 3, 1, 0.2f, 250, 20));
    return all;
}

// Builds for some time, and returns the seconds of each build.
double secondsOf(const Scene& scene, const Job& job, double atLeast) {
    double sum = 0;
    int builds = 0;
    for (; sum < atLeast; ++builds) sum += run(scene, job).seconds;
    return sum / builds;
}

// The builders take turns; a first round that is not counted touches the memory.
std::vector<std::vector<double>> race(const Scene& scene, const std::vector<Job>& jobs, const Options& options) {
    std::vector<std::vector<double>> seconds(jobs.size());
    for (int round = 0; round <= options.rounds; ++round)
        for (std::size_t i = 0; i < jobs.size(); ++i) {
            const double of = secondsOf(scene, jobs[i], options.seconds);
            if (round > 0) seconds[i].push_back(of);
        }
    return seconds;
}

struct Worst {
    double ratio = std::numeric_limits<double>::infinity();
    std::string where;
};

void printRow(const Scene& scene, int threads, const Options& options, Worst& worst, Ratios& ratios) {
    std::vector<Job> jobs;
    for (const Contest& contest : contests)
        for (const Builder builder : {contest.builder, Builder::reference})
            jobs.push_back({builder, contest.halfWidth, threads});
    const std::vector<std::vector<double>> seconds = race(scene, jobs, options);
    fmt::print("| {} | {} | {} |", scene.mesh.triangles.size(), scene.resolution, threads);
    for (std::size_t i = 0; i < seconds.size(); i += 2) {
        const double ours = median(seconds[i]), rival = median(seconds[i + 1]), ratio = rival / ours;
        const std::string what = fmt::format("{}, {} triangles, {} voxels, {} threads", nameOf(jobs[i].builder),
                                             scene.mesh.triangles.size(), scene.resolution, threads);
        fmt::print(" {:.0f} | {:.0f} | {:.1f} |", 1e6 * ours, 1e6 * rival, ratio);
        ratios.add(what + " / meshToVolume", seconds[i + 1], seconds[i]);
        if (ratio < worst.ratio) worst = {ratio, what};
    }
    fmt::print("\n");
    std::fflush(stdout);
}

// The smallest field of all: a triangle as large as a voxel.
void printFixedCost(const Options& options) {
    Mesh triangle;
    triangle.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    triangle.triangles = {{0, 1, 2}};
    const Scene smallest = scene("triangle", triangle, 1);
    for (const int threads : options.threads)
        for (const Contest& contest : contests) {
            const double seconds = median(race(smallest, {{contest.builder, contest.halfWidth, threads}}, options)[0]);
            fmt::print("A triangle of one voxel, {}, {} thread{}: {:.0f} us\n", nameOf(contest.builder), threads,
                       threads > 1 ? "s" : "", 1e6 * seconds);
        }
    fmt::print("({:g} us allowed)\n", fixedMicrosecondsAllowed);
}

int run(int argc, char** argv) {
    CLI::App app("Builds fields of small meshes with bilayer and with OpenVDB, and compares times.");
    Options options;
    app.add_option("--resolution", options.resolutions, "voxels along the longest side")->capture_default_str();
    app.add_option("--threads", options.threads)->capture_default_str();
    app.add_option("--rounds", options.rounds, "rounds, in each of which all builders take turns")
        ->capture_default_str()
        ->check(CLI::PositiveNumber);
    app.add_option("--seconds", options.seconds, "time of each builder in a round [s]")->capture_default_str();
    Ratios ratios("small");
    ratios.addOption(app);
    CLI11_PARSE(app, argc, argv);
    fmt::print("Microseconds per build, medians of {} rounds in turns.\n\n", options.rounds);
    fmt::print(
        "| triangles | voxels | threads | exact, half width 3 | meshToVolume 0x4 | ratio | double-layer, half width 2 "
        "| meshToVolume 0x4 | ratio |\n|---|---|---|---|---|---|---|---|---|\n");
    Worst worst;
    for (const Mesh& mesh : meshes())
        for (const float resolution : options.resolutions) {
            const Scene small = scene("small", mesh, resolution);
            for (const int threads : options.threads) printRow(small, threads, options, worst, ratios);
        }
    fmt::print("\nSmallest ratio: {:.1f} ({} required), {}\n", worst.ratio, ratioRequired, worst.where);
    printFixedCost(options);
    ratios.write();
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    return bench::program("small", run, argc, argv);
}
