// SPDX-License-Identifier: Apache-2.0
// Liquids seeded from shapes with right angles: voxels that OpenVDB's check of level sets refuses with the exact
// distances and after fluid::seed(), and how far seeding changes distances.
#include <fmt/format.h>
#include <openvdb/tools/Diagnostics.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>

#include <bilayer/integration/fluid/seed.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include "bench/program.h"
#include "sdf/base/openvdb.h"
#include "tests/support/profiles.h"
#include "tests/support/truth.h"

using namespace bilayer;
using openvdb::FloatGrid;

namespace {

constexpr float halfWidth = 3;  // [voxels]

struct Options {
    int seeds = 200;
    unsigned seed = std::random_device()();
};

/// Sums over all seeds of a shape.
struct Row {
    std::uint64_t active = 0, brokenBefore = 0, brokenAfter = 0, changed = 0;
    double largest = 0;  ///< change of a distance [voxels]
};

/// Voxels whose NormGrad is out of the range of checkLevelSet.
std::uint64_t brokenVoxels(const FloatGrid& liquid) {
    openvdb::tools::CheckLevelSet<FloatGrid> check(liquid);
    check.checkEikonal();
    return check.failureCount();
}

/// The largest difference of a seeded distance from the mesh's own [voxels].
double largestChange(const FloatGrid& liquid, const Mesh& mesh) {
    const test::Truth truth(mesh);
    double largest = 0;
    for (auto voxel = liquid.cbeginValueOn(); voxel; ++voxel) {
        const openvdb::Vec3d at = liquid.indexToWorld(voxel.getCoord());
        largest = std::max(largest, std::abs(double(*voxel) - truth.signedDistance({at.x(), at.y(), at.z()})));
    }
    return largest / liquid.voxelSize()[0];
}

void add(Row& row, const Mesh& mesh, float voxelSize) {
    row.brokenBefore += brokenVoxels(*build(mesh, {.voxelSize = voxelSize}).grids().distance);
    const auto liquid = openvdb::createLevelSet<FloatGrid>(double(voxelSize), double(halfWidth));
    const fluid::SeedReport report = fluid::seed(*liquid, mesh);
    row.brokenAfter += brokenVoxels(*liquid);
    row.active += liquid->activeVoxelCount();
    row.changed += report.changedVoxels;
    row.largest = std::max(row.largest, largestChange(*liquid, mesh));
}

Row measure(const test::Profile& profile, const Options& options) {
    std::mt19937 random(options.seed);
    std::uniform_real_distribution<double> size(0.01, 0.1), place(-1, 1);
    Row row;
    for (int i = 0; i < options.seeds; ++i) {
        const double voxel = size(random);
        Mesh mesh = test::prismOf(profile, random, voxel);
        // half of them have faces in the planes of the voxels
        const glm::dvec3 shift = voxel * glm::dvec3(place(random), place(random), place(random));
        for (glm::vec3& point : mesh.points) point += i % 2 ? glm::vec3(shift) : glm::vec3(0);
        add(row, mesh, float(voxel));
    }
    return row;
}

int run(int argc, char** argv) {
    CLI::App app("Seeds liquids from shapes with right angles and checks that they are level sets.");
    Options options;
    app.add_option("--seeds", options.seeds, "liquids of each shape")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    app.add_option("--seed", options.seed, "of the random sizes and places");
    CLI11_PARSE(app, argc, argv);
    openvdb::initialize();
    fmt::print(
        "Random seed {}. Voxels out of checkLevelSet's range, of exact distances and of seeded liquids; changes are "
        "from the\nmesh's own distances.\n\n"
        "| shape | seeds | voxels | out of range, exact | out of range, seeded | changed by more than 0.1 voxel | "
        "largest change [voxels] |\n|---|---|---|---|---|---|---|\n",
        options.seed);
    for (const test::Profile& profile : test::profiles()) {
        const Row row = measure(profile, options);
        fmt::print("| {} | {} | {} | {} | {} | {} | {:.2f} |\n", profile.name, options.seeds, row.active,
                   row.brokenBefore, row.brokenAfter, row.changed, row.largest);
        std::fflush(stdout);
    }
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    return bench::program("seed", run, argc, argv);
}
