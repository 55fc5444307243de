// SPDX-License-Identifier: Apache-2.0
// A mesh that deforms from frame to frame. Compares frames per second of a full build per frame with those of an
// incremental rebuild from the previous frame, where only a part of the mesh moves.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>

#include <bilayer/sdf/build.h>
#include "bench/builders.h"
#include "bench/measure.h"
#include "bench/program.h"
#include "demos/shared/shapes.h"

using namespace bilayer;
using namespace bilayer::bench;

namespace {

constexpr float swing = 0.05f;       // amplitude to each side, as a fraction of the longest side of the mesh
constexpr float wavesAlongMesh = 1;  // from the bottom to the top
constexpr int framesPerSwing = 40;
constexpr float tug = 2;  // [voxels]
constexpr std::array movingShares{0.01, 0.1, 1.0};

struct Options {
    std::string mesh;
    std::vector<std::string> methods{nameOf(Builder::exact), nameOf(Builder::doubleLayer)};
    std::vector<int> threads{1, 2};
    float resolution = 128;
    float halfWidth = 3;
    int frames = 60;
};

// The available mesh of 70 thousand triangles: the bunny, or else a knot.
Scene restingScene(const Options& options) {
    if (!options.mesh.empty()) return scene(findSource(options.mesh), options.resolution);
    for (const Source& source : sources())
        if (source.name == "bunny") return scene(source, options.resolution);
    return scene("knot", shapes::torusKnot(2, 3, 1, 0.2f, 1094, 32), options.resolution);
}

// Sways the mesh like a reed in water. Each height moves sideways rigidly, so the mesh cannot self-intersect.
Mesh swayed(const Mesh& mesh, int frame) {
    const Bounds box = bounds(mesh);
    const float side = box.longestSide(), phase = glm::two_pi<float>() * float(frame) / framesPerSwing;
    Mesh moved = mesh;
    for (auto& point : moved.points)
        point.x +=
            swing * side * std::sin(phase + glm::two_pi<float>() * wavesAlongMesh * (point.y - box.lower.y) / side);
    return moved;
}

// The builds of one builder on one count of threads.
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

// The part of a mesh nearest to one of its points, and its amplitude.
struct Part {
    glm::vec3 centre;
    float radius;
};

Part partOf(const Mesh& mesh, double share) {
    const glm::vec3 centre = mesh.points[mesh.triangles[mesh.triangles.size() / 2].x];
    std::vector<float> distances;
    for (const auto& t : mesh.triangles) distances.push_back(glm::distance(centre, mesh.points[t.x]));
    std::sort(distances.begin(), distances.end());
    return {centre, distances[std::min(distances.size() - 1, std::size_t(share * double(distances.size())))]};
}

// Oscillates the part sideways by a voxel or two, most in its middle.
Mesh tugged(const Mesh& mesh, const Part& part, float voxelSize, int frame) {
    const float phase = glm::two_pi<float>() * float(frame) / framesPerSwing;
    Mesh moved = mesh;
    for (auto& point : moved.points) {
        const float away = glm::distance(point, part.centre) / part.radius;
        if (away < 1) point += tug * voxelSize * (1 - away * away) * glm::vec3(std::sin(phase), std::cos(phase), 0);
    }
    return moved;
}

std::vector<std::uint32_t> trianglesThatMoved(const Mesh& before, const Mesh& after) {
    std::vector<std::uint32_t> moved;
    for (std::uint32_t i = 0; i < before.triangles.size(); ++i) {
        const glm::uvec3 t = before.triangles[i];
        const auto differs = [&](unsigned p) { return before.points[p] != after.points[p]; };
        if (differs(t.x) || differs(t.y) || differs(t.z)) moved.push_back(i);
    }
    return moved;
}

// Compares full and incremental builds of the same frames.
void deformInPart(const Options& options, double share, int threads) {
    const Scene rest = restingScene(options);
    const Part part = partOf(rest.mesh, share);
    const BuildOptions how{.voxelSize = rest.voxelSize,
                           .exteriorWidthVoxels = options.halfWidth,
                           .interiorWidthVoxels = options.halfWidth,
                           .threads = threads};
    Mesh before = tugged(rest.mesh, part, rest.voxelSize, 0);
    LevelSet field = build(before, how);
    std::vector<double> full, incremental;
    std::size_t movedTriangles = 0;
    double filled = 0;  // maximum fraction of all leaves
    for (int i = 1; i <= options.frames; ++i) {
        const Mesh after = tugged(rest.mesh, part, rest.voxelSize, i);
        const auto moved = trianglesThatMoved(before, after);
        movedTriangles = std::max(movedTriangles, moved.size());
        const BuildTimes whole = build(after, how).buildTimes();
        full.push_back(whole.total);
        field = rebuild(field, before, after, moved, how);
        incremental.push_back(field.buildTimes().total);
        filled = std::max(filled, double(field.buildTimes().filledBlocks) / double(whole.filledBlocks));
        before = after;
    }
    fmt::print("{:>9}{:>9}{:>14.1f} %{:>14.1f}{:>14.1f}{:>20.1f}\n", movedTriangles, threads, 100 * filled,
               1 / median(full), 1 / median(incremental), median(full) / median(incremental));
}

int run(int argc, char** argv) {
    CLI::App app("Builds the field of a deforming mesh for each frame, and counts frames per second.");
    Options options;
    app.add_option("--mesh", options.mesh, "mesh name or file; by default the bunny, or a knot if it does not exist");
    app.add_option("--resolution", options.resolution, "voxels along the longest side")->capture_default_str();
    app.add_option("--half-width", options.halfWidth, "half width of the band [voxels]")->capture_default_str();
    app.add_option("--method", options.methods, "builders")->capture_default_str();
    app.add_option("--threads", options.threads)->capture_default_str();
    app.add_option("--frames", options.frames)->capture_default_str()->check(CLI::PositiveNumber);
    CLI11_PARSE(app, argc, argv);
    deform(options);
    fmt::print("\na part moves, frames/s of the exact method\n\n{:>9}{:>9}{:>16}{:>14}{:>14}{:>20}\n", "triangles",
               "threads", "blocks filled", "in full", "incremental", "times as fast");
    for (const double share : movingShares)
        for (const int threads : options.threads) deformInPart(options, share, threads);
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    return bench::program("deform", run, argc, argv);
}
