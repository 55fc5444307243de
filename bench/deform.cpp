// A mesh that deforms from frame to frame, its field built anew for each: frames per second.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <glm/gtc/constants.hpp>

#include "bench/builders.h"
#include "bench/measure.h"
#include "demos/shared/shapes.h"

using namespace bilayer;
using namespace bilayer::bench;

namespace {

constexpr float swing = 0.05f;       // to each side, as a part of the longest side of the mesh
constexpr float wavesAlongMesh = 1;  // from the bottom to the top
constexpr int framesPerSwing = 40;

struct Options {
    std::string mesh;
    std::vector<std::string> methods{"exact", "double-layer"};
    std::vector<int> threads{1, 2};
    float resolution = 128;
    float halfWidth = 3;
    int frames = 60;
};

// The mesh of 70 thousand triangles that is here: the bunny, or else a knot.
Scene restingScene(const Options& options) {
    if (!options.mesh.empty()) return scene(findSource(options.mesh), options.resolution);
    for (const Source& source : sources())
        if (source.name == "bunny") return scene(source, options.resolution);
    return scene("knot", shapes::torusKnot(2, 3, 1, 0.2f, 1094, 32), options.resolution);
}

// Sways the mesh like a reed in water: each height moves sideways as a whole, so that nothing can run into itself.
Mesh swayed(const Mesh& mesh, int frame) {
    const Bounds box = bounds(mesh);
    const float side = box.longestSide(), phase = glm::two_pi<float>() * float(frame) / framesPerSwing;
    Mesh moved = mesh;
    for (auto& point : moved.points)
        point.x +=
            swing * side * std::sin(phase + glm::two_pi<float>() * wavesAlongMesh * (point.y - box.lower.y) / side);
    return moved;
}

// The builds of one builder on one number of threads.
struct Row {
    Job job;
    std::vector<double> seconds;
};

void print(const Row& row) {
    double sum = 0;
    for (const double s : row.seconds) sum += s;
    fmt::print("{:<22}{:>9}{:>12.2f}{:>12.2f}{:>14.1f}\n", nameOf(row.job.builder), row.job.threads,
               1e3 * median(row.seconds), 1e3 * *std::max_element(row.seconds.begin(), row.seconds.end()),
               double(row.seconds.size()) / sum);
}

void deform(const Options& options) {
    Scene frame = restingScene(options);
    const Mesh rest = frame.mesh;
    std::vector<Row> rows;
    for (const std::string& method : options.methods)
        for (const int threads : options.threads)
            rows.push_back({{builderNamed(method), options.halfWidth, threads}, {}});
    for (int i = 0; i < options.frames; ++i) {
        frame.mesh = swayed(rest, i);
        for (Row& row : rows) row.seconds.push_back(run(frame, row.job).seconds);
    }
    fmt::print(
        "{}: {} triangles, {} voxels along the longest side, half width {}, {} frames; each frame built in full\n\n"
        "{:<22}{:>9}{:>12}{:>12}{:>14}\n",
        frame.name, rest.triangles.size(), options.resolution, options.halfWidth, options.frames, "builder", "threads",
        "median ms", "longest ms", "frames/s");
    for (const Row& row : rows) print(row);
}

int run(int argc, char** argv) {
    CLI::App app("Builds the field of a deforming mesh for each frame, and counts frames per second.");
    Options options;
    app.add_option("--mesh", options.mesh, "a name or a file; by default the bunny, or a knot where it is not here");
    app.add_option("--resolution", options.resolution, "voxels along the longest side")->capture_default_str();
    app.add_option("--half-width", options.halfWidth, "of the band [voxels]")->capture_default_str();
    app.add_option("--method", options.methods, "builders")->capture_default_str();
    app.add_option("--threads", options.threads)->capture_default_str();
    app.add_option("--frames", options.frames)->capture_default_str()->check(CLI::PositiveNumber);
    CLI11_PARSE(app, argc, argv);
    deform(options);
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    try {
        return run(argc, argv);
    } catch (const std::exception& error) {
        fmt::print(stderr, "bench deform: {}\n", error.what());
        return 1;
    }
}
