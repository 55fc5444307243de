// SPDX-License-Identifier: Apache-2.0
// Growth of build cost with the triangle count at one resolution, and with the resolution of one mesh. The meshes are
// carved boxes, so that only their size changes. Each build runs in its own process.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>

#include "bench/builders.h"
#include "bench/measure.h"
#include "bench/program.h"
#include "demos/shared/plot.h"
#include "demos/shared/shapes.h"

using namespace bilayer;
using namespace bilayer::bench;
using demo::Line;
using demo::Panel;
using demo::writeSvg;

namespace {

struct Options {
    std::vector<double> triangles{1e4, 3e4, 1e5, 3e5, 1e6, 3e6, 1e7};
    std::vector<double> resolutions{64, 128, 256, 512, 1024, 2048};
    std::vector<std::string> methods{nameOf(Builder::exact), nameOf(Builder::doubleLayer)};
    float resolution = 256;
    double fixedTriangles = 1e5;
    int threads = 2, repetitions = 5;
    double seconds = 2;
    std::string plot;
};

// One mesh at one resolution.
struct Point {
    float resolution;
    Footprint footprint;

    double triangles() const { return double(footprint.triangles); }
    double seconds() const { return footprint.outcome.seconds; }
};

using Curve = std::vector<Point>;

Curve measure(Builder builder, const std::vector<std::pair<double, float>>& sizes, const Options& options) {
    Curve curve;
    for (const auto& [triangles, resolution] : sizes) {
        const auto make = [n = std::size_t(triangles), r = resolution] { return scene("", shapes::carvedBox(n), r); };
        curve.push_back(
            {resolution, inChild(make, {builder, 3, options.threads}, options.repetitions, options.seconds)});
        const Point& point = curve.back();
        const Outcome& outcome = point.footprint.outcome;
        fmt::print("{:<14}{:>10}{:>7}{:>11.4f}{:>12}{:>10.1f}{:>10.1f}{:>11.0f}{:>11.0f}{:>6}\n", nameOf(builder),
                   point.footprint.triangles, resolution, point.seconds(), outcome.activeVoxels,
                   1e9 * point.seconds() / double(outcome.activeVoxels), 1e9 * point.seconds() / point.triangles(),
                   point.footprint.peakMiB(), point.footprint.allowedMiB(),
                   point.footprint.peakMiB() <= point.footprint.allowedMiB() ? "yes" : "no");
        std::fflush(stdout);
    }
    return curve;
}

Line lineOf(Builder builder, const Curve& curve, bool overTriangles) {
    Line line;
    for (const Point& point : curve) {
        line.x.push_back(overTriangles ? point.triangles() : double(point.resolution));
        line.y.push_back(point.seconds());
    }
    // the slope where size dominates: over the last three points
    const std::size_t from = line.x.size() > 3 ? line.x.size() - 3 : 0;
    const auto tail = [&](const std::vector<double>& v) {
        return std::vector<double>(v.begin() + long(from), v.end());
    };
    const double all = logSlope(line.x, line.y), last = logSlope(tail(line.x), tail(line.y));
    line.label = fmt::format("{}, slope {:.2f}, {:.2f} at the end", nameOf(builder), all, last);
    return line;
}

void growth(const Options& options) {
    std::vector<std::pair<double, float>> meshes, grids;
    for (const double triangles : options.triangles) meshes.push_back({triangles, options.resolution});
    for (const double resolution : options.resolutions) grids.push_back({options.fixedTriangles, float(resolution)});
    Panel overTriangles{fmt::format("{:g} voxels, half width 3", options.resolution), "triangles", "seconds", {}, {}};
    Panel overVoxels{fmt::format("{:g} triangles, half width 3", options.fixedTriangles),
                     "voxels along the longest side",
                     "seconds",
                     options.resolutions,
                     {}};

    fmt::print(
        "Carved boxes, half width 3, {} threads; medians of up to {} builds. Peak: mesh and build together; allowed:\n"
        "{} x (mesh + grid) + {:.0f} MiB.\n\n{:<14}{:>10}{:>7}{:>11}{:>12}{:>10}{:>10}{:>11}{:>11}{:>6}\n",
        options.threads, options.repetitions, memoryFactor, memoryConstantMiB, "builder", "triangles", "N", "seconds",
        "voxels", "ns/voxel", "ns/tri.", "peak MiB", "allowed", "kept");
    for (const std::string& name : options.methods) {
        const Builder builder = builderNamed(name);
        overTriangles.lines.push_back(lineOf(builder, measure(builder, meshes, options), true));
        overVoxels.lines.push_back(lineOf(builder, measure(builder, grids, options), false));
    }
    fmt::print("\nSeconds grow with the triangles to the power of, and with the voxels along a side to the power of\n");
    for (std::size_t i = 0; i < options.methods.size(); ++i)
        fmt::print("  {:<44} {}\n", overTriangles.lines[i].label, overVoxels.lines[i].label);
    if (!options.plot.empty()) writeSvg(options.plot, {overTriangles, overVoxels});
}

int run(int argc, char** argv) {
    CLI::App app("Shows how time and memory of a build grow with triangles and with voxels.");
    Options options;
    app.add_option("--triangles", options.triangles, "triangle counts of the meshes")->capture_default_str();
    app.add_option("--resolutions", options.resolutions, "voxels along the longest side")->capture_default_str();
    app.add_option("--method", options.methods, "builders")->capture_default_str();
    app.add_option("--resolution", options.resolution, "voxels along the longest side for all triangle counts")
        ->capture_default_str();
    app.add_option("--fixed-triangles", options.fixedTriangles, "triangle count for all resolutions")
        ->capture_default_str();
    app.add_option("--threads", options.threads)->capture_default_str();
    app.add_option("--repetitions", options.repetitions, "maximum repetitions of each build")->capture_default_str();
    app.add_option("--seconds", options.seconds, "time after which a build is not repeated [s]")->capture_default_str();
    app.add_option("--plot", options.plot, "also draw both as an SVG file");
    CLI11_PARSE(app, argc, argv);
    growth(options);
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    return bench::program("growth", run, argc, argv);
}
