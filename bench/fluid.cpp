// SPDX-License-Identifier: Apache-2.0
// Liquids seeded from meshes: compares the time with OpenVDB's meshToLevelSet and the code that a user must write
// around it, and measures the error of volume and area.
#include <fmt/format.h>
#include <openvdb/tools/Composite.h>
#include <openvdb/tools/Diagnostics.h>
#include <openvdb/tools/GridOperators.h>
#include <openvdb/tools/LevelSetMeasure.h>
#include <openvdb/tools/LevelSetTracker.h>
#include <openvdb/tools/MeshToVolume.h>
#include <tbb/global_control.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <random>

#include <bilayer/collider/mass.h>
#include <bilayer/integration/fluid/extend.h>
#include <bilayer/integration/fluid/seed.h>
#include <bilayer/sdf/grids.h>
#include "bench/builders.h"
#include "bench/measure.h"
#include "bench/program.h"
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "tests/support/truth.h"

using namespace bilayer;
using namespace bilayer::bench;
using openvdb::FloatGrid;

namespace {

constexpr double pi = 3.141592653589793;
constexpr float halfWidth = 3, farthest = 32;  // [voxels]
constexpr int samplesPerShell = 20000;

struct Options {
    std::vector<std::string> meshes{"bunny", "dragon", "sphere"};
    std::vector<float> resolutions{64, 128, 251, 502};
    int threads = 2, rounds = 3;
};

Mesh meshOf(const std::string& name) {
    return name == "sphere" ? shapes::sphere(0.5f, 7) : scene(findSource(name), 64).mesh;
}

// Oblique to all axes, and off the origin.
fluid::Placement placementOf(const Mesh& mesh) {
    const glm::vec3 size = bounds(mesh).size();
    return {Pose{0.3f * size, glm::angleAxis(0.8f, glm::normalize(glm::vec3(1, -2, 0.5f)))}};
}

Mesh placed(const Mesh& mesh, const fluid::Placement& placement) {
    Mesh result = mesh;
    for (glm::vec3& p : result.points) p = glm::vec3(placement.toWorld(p));
    return result;
}

// The lower half of the body's box and its surroundings, filled with liquid.
FloatGrid::Ptr pool(const Mesh& body, float voxelSize) {
    const Bounds box = bounds(body);
    Mesh water = shapes::box(0.6f * box.size());
    for (glm::vec3& p : water.points) p += box.centre() - glm::vec3(0, 0, 0.6f * box.size().z);
    const auto liquid = openvdb::createLevelSet<FloatGrid>(voxelSize, halfWidth);
    fluid::seed(*liquid, water);
    return liquid;
}

// The way to add a mesh to a liquid with OpenVDB alone.
void seedByOpenVdb(FloatGrid& liquid, const Mesh& mesh, const fluid::Placement& placement, bool renormalise) {
    std::vector<openvdb::Vec3s> points;
    std::vector<openvdb::Vec3I> triangles;
    for (const glm::vec3& p : mesh.points) {
        const glm::dvec3 w = placement.toWorld(p);
        points.emplace_back(float(w.x), float(w.y), float(w.z));
    }
    for (const glm::uvec3& t : mesh.triangles) triangles.emplace_back(t.x, t.y, t.z);
    const auto body = openvdb::tools::meshToLevelSet<FloatGrid>(liquid.transform(), points, triangles, halfWidth);
    openvdb::tools::csgUnion(liquid, *body);
    if (!renormalise) return;
    openvdb::tools::LevelSetTracker<FloatGrid> tracker(liquid);
    tracker.normalize();
    tracker.prune();
}

openvdb::Index64 brokenVoxels(const FloatGrid& liquid) {
    openvdb::tools::CheckLevelSet<FloatGrid> check(liquid);
    check.checkEikonal();
    return check.failureCount();
}

struct Way {
    std::string name;
    std::function<void(FloatGrid&)> pour;
    std::vector<double> seconds{};
    openvdb::Index64 broken = 0;
};

void raceAt(const std::string& name, const Mesh& mesh, float resolution, const Options& options) {
    const float voxelSize = voxelSizeFor(mesh, resolution);
    const fluid::Placement placement = placementOf(mesh);
    const LevelSet field = build(mesh, {.voxelSize = voxelSize});
    const FloatGrid::Ptr liquid = pool(placed(mesh, placement), voxelSize);
    std::vector<Way> ways{
        {"seed, mesh", [&](FloatGrid& g) { fluid::seed(g, mesh, placement); }},
        {"seed, field", [&](FloatGrid& g) { fluid::seed(g, field, placement); }},
        {"meshToLevelSet", [&](FloatGrid& g) { seedByOpenVdb(g, mesh, placement, false); }},
        {"renormalised", [&](FloatGrid& g) { seedByOpenVdb(g, mesh, placement, true); }},
    };
    for (int round = 0; round < options.rounds; ++round)
        for (Way& way : ways) {
            const FloatGrid::Ptr poured = liquid->deepCopy();
            const Stopwatch watch;
            way.pour(*poured);
            way.seconds.push_back(watch.seconds());
            way.broken = brokenVoxels(*poured);
        }
    const double ours = median(ways[0].seconds), ofField = median(ways[1].seconds), bare = median(ways[2].seconds),
                 clean = median(ways[3].seconds);
    fmt::print("| {} | {:g} | {:.0f} | {:.0f} | {:.0f} | {:.0f} | {:.1f} | {:.1f} | {:.1f} | {} / {} / {} / {} |\n",
               name, resolution, 1e3 * ours, 1e3 * ofField, 1e3 * bare, 1e3 * clean, bare / ours, clean / ours,
               clean / ofField, ways[0].broken, ways[1].broken, ways[2].broken, ways[3].broken);
    std::fflush(stdout);
}

double areaOf(const Mesh& mesh) {
    double area = 0;
    for (const glm::uvec3& t : mesh.triangles) {
        const glm::dvec3 a = mesh.points[t.x], b = mesh.points[t.y], c = mesh.points[t.z];
        area += 0.5 * glm::length(glm::cross(b - a, c - a));
    }
    return area;
}

// Mean deviation of |gradient| from 1 within a voxel of the surface, by central differences: everywhere, and off
// creases. Off creases the gradient rotates by less than 15 degrees from each neighbour to the next.
struct SlopeError {
    double everywhere = 0, offCreases = 0;
};

SlopeError slopeError(const FloatGrid& liquid) {
    const auto gradient = openvdb::tools::gradient(liquid);
    const auto slopes = gradient->getConstAccessor();
    const auto isSmooth = [&](const openvdb::Coord& at, const openvdb::Vec3f& slope) {
        return std::all_of(std::begin(openvdb::util::COORD_OFFSETS), std::begin(openvdb::util::COORD_OFFSETS) + 6,
                           [&](const openvdb::Coord& step) {
                               const openvdb::Vec3f& beside = slopes.getValue(at + step);
                               return slope.dot(beside) > std::cos(15 * pi / 180) * slope.length() * beside.length();
                           });
    };
    double sum = 0, smoothSum = 0, count = 0, smoothCount = 0;
    for (auto v = liquid.cbeginValueOn(); v; ++v) {
        if (!(std::abs(*v) < liquid.voxelSize()[0])) continue;
        const openvdb::Vec3f slope = slopes.getValue(v.getCoord());
        const double error = std::abs(double(slope.length()) - 1);
        sum += error;
        ++count;
        if (!isSmooth(v.getCoord(), slope)) continue;
        smoothSum += error;
        ++smoothCount;
    }
    return {sum / count, smoothSum / smoothCount};
}

std::string truthOf(const FloatGrid& liquid, const Mesh& mesh) {
    openvdb::tools::LevelSetMeasure<FloatGrid> measure(liquid);
    const SlopeError slope = slopeError(liquid);
    return fmt::format("{:+.4f} | {:+.4f} | {:.4f} | {:.4f}",
                       100 * (measure.volume() / massProperties(mesh).volume - 1),
                       100 * (measure.area() / areaOf(mesh) - 1), slope.everywhere, slope.offCreases);
}

void measureAt(const std::string& name, const Mesh& mesh, float resolution) {
    const float voxelSize = voxelSizeFor(mesh, resolution);
    const auto empty = [&] { return openvdb::createLevelSet<FloatGrid>(voxelSize, halfWidth); };
    const FloatGrid::Ptr ours = empty(), ofField = empty(), theirs = empty();
    fluid::seed(*ours, mesh);
    fluid::seed(*ofField, build(mesh, {.voxelSize = voxelSize}), placementOf(mesh));
    seedByOpenVdb(*theirs, mesh, {}, false);
    fmt::print("| {} | {:g} | {} | {} | {} |\n", name, resolution, truthOf(*ours, mesh), truthOf(*ofField, mesh),
               truthOf(*theirs, mesh));
    std::fflush(stdout);
}

// Error of extend() by distance from the surface [voxels].
struct Shell {
    double from, to;
    double sum = 0, largest = 0;
    int count = 0;
};

void fillAt(const std::string& name, const Mesh& mesh, float resolution) {
    const float voxelSize = voxelSizeFor(mesh, resolution);
    const LevelSet band = build(mesh, {.voxelSize = voxelSize});
    const Stopwatch watch;
    const LevelSet extended = fluid::extend(band, farthest * voxelSize);
    const double seconds = watch.seconds();
    const test::Truth truth(mesh);
    std::vector<openvdb::Coord> voxels;
    for (auto v = extended.grids().distance->cbeginValueOn(); v; ++v) voxels.push_back(v.getCoord());
    std::shuffle(voxels.begin(), voxels.end(), std::mt19937(7));
    const auto values = extended.grids().distance->getConstAccessor();
    std::array<Shell, 3> shells{{{3, 8}, {8, 16}, {16, 32}}};
    int wrong = 0;
    for (const openvdb::Coord& at : voxels) {
        if (std::ranges::all_of(shells, [](const Shell& s) { return s.count == samplesPerShell; })) break;
        const double value = double(values.getValue(at)) / double(voxelSize);
        const auto shell = std::ranges::find_if(
            shells, [&](const Shell& s) { return std::abs(value) >= s.from && std::abs(value) < s.to; });
        if (shell == shells.end() || shell->count == samplesPerShell) continue;
        const openvdb::Vec3d p = extended.grids().distance->indexToWorld(at);
        const double exact = truth.signedDistance({p.x(), p.y(), p.z()}) / double(voxelSize);
        wrong += (exact < 0) != (value < 0);
        shell->sum += std::abs(value - exact);
        shell->largest = std::max(shell->largest, std::abs(value - exact));
        ++shell->count;
    }
    fmt::print("| {} | {:g} | {:.0f} |", name, resolution, 1e3 * seconds);
    for (const Shell& s : shells) fmt::print(" {:.3f} / {:.2f} |", s.count ? s.sum / s.count : 0, s.largest);
    fmt::print(" {} |\n", wrong);
    std::fflush(stdout);
}

void fluidBench(const Options& options) {
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, std::size_t(options.threads));
    openvdb::initialize();
    fmt::print(
        "A body, turned, poured into a liquid that reaches its middle; ms on {} threads, medians of {} rounds. A user "
        "of\n"
        "OpenVDB moves the points, calls meshToLevelSet and csgUnion, and LevelSetTracker::normalize if the solver "
        "minds.\n"
        "Broken are voxels that checkLevelSet finds, in the order of the columns.\n\n"
        "| mesh | voxels | seed, mesh | seed, field | meshToLevelSet | and normalize | times as fast as bare | as "
        "normalized | field, as normalized | broken |\n|---|---|---|---|---|---|---|---|---|---|\n",
        options.threads, options.rounds);
    for (const std::string& name : options.meshes)
        for (const float resolution : options.resolutions) raceAt(name, meshOf(name), resolution, options);
    fmt::print(
        "\nVolume and area by LevelSetMeasure against the mesh's own [%], and how far |gradient| is from 1 within a "
        "voxel\n"
        "of the surface, in the mean, everywhere and off creases: of seeds by the mesh, by its field in a rotated "
        "pose, "
        "by\n"
        "meshToLevelSet.\n\n"
        "| mesh | voxels | volume | area | slope | off creases | field: volume | area | slope | off creases | OpenVDB: "
        "volume | area | slope | off creases |\n"
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
    for (const std::string& name : options.meshes)
        for (const float resolution : options.resolutions) measureAt(name, meshOf(name), resolution);
    fmt::print(
        "\nDistances beyond the band by extend(), {:g} voxels far, against the mesh's own: errors in voxels, mean / "
        "largest, of a\n"
        "sample of {} voxels in each column.\n\n"
        "| mesh | voxels | ms | 3 to 8 away | 8 to 16 | 16 to 32 | wrong signs |\n|---|---|---|---|---|---|---|\n",
        farthest, samplesPerShell);
    for (const std::string& name : options.meshes)
        for (const float resolution : options.resolutions) fillAt(name, meshOf(name), resolution);
}

int run(int argc, char** argv) {
    CLI::App app("Times the seeding of liquids compared with OpenVDB's tools, and measures the results.");
    Options options;
    app.add_option("--mesh", options.meshes, "mesh names or files, or sphere")->capture_default_str();
    app.add_option("--resolution", options.resolutions, "voxels along the longest side")->capture_default_str();
    app.add_option("--threads", options.threads)->check(CLI::PositiveNumber)->capture_default_str();
    app.add_option("--rounds", options.rounds, "rounds, in each of which all methods take turns")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    CLI11_PARSE(app, argc, argv);
    fluidBench(options);
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    return bench::program("fluid", run, argc, argv);
}
