// SPDX-License-Identifier: Apache-2.0
// Combined liquids are level sets: at edges, where boxes meet, and of real meshes.
#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <bilayer/integration/fluid/seed.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/inspect.h>
#include <bilayer/sdf/mesh_io.h>
#include <bilayer/sdf/surface.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "tests/fluid/liquids.h"
#include "tests/support/profiles.h"
#include "tests/support/support.h"
#include "tests/support/truth.h"

namespace bilayer::repair_test {
using namespace bilayer::test;
using openvdb::FloatGrid;

TEST_CASE("shapes of right angles are level sets at any size and place") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    for (const Profile& profile : profiles()) {
        std::mt19937 random(seed);
        std::uniform_real_distribution<double> size(0.01, 0.1), place(-1, 1);
        for (int i = 0; i < 200; ++i) {
            const double voxel = i % 3 ? size(random) : std::array{0.02, 0.025, 0.05}[random() % 3];
            CAPTURE(profile.name, i, voxel);
            const Mesh mesh = prismOf(profile, random, voxel);
            const auto liquid = openvdb::createLevelSet<FloatGrid>(voxel, 3);
            glm::vec3 shift(0);
            if (i % 2) shift = glm::vec3(place(random), place(random), place(random)) * float(voxel);
            const fluid::SeedReport report = fluid::seed(*liquid, mesh, Pose{shift});
            requireLevelSet(*liquid);
            Mesh placed = mesh;
            for (glm::vec3& p : placed.points) p += shift;
            const test::Truth truth(placed);
            const double off = error(*liquid, [&](const glm::dvec3& p) { return truth.signedDistance(p); });
            CHECK(off <= double(report.maxChangeVoxels) + 1e-3);
            CAPTURE(off, report.maxChangeVoxels);
            CHECK((off < 0.1 || report.changedVoxels > 0));
        }
    }
}

TEST_CASE("the corpus seeds level sets") {
    for (const char* name :
         {"bunny_watertight.obj", "cow.obj", "fandisk.obj", "rocker-arm.obj", "m12_bolt.ply", "spot.obj"})
        if (const auto path = test::corpusMesh(name)) {
            const Mesh mesh = readMesh(*path);
            for (const float resolution : {25.f, 64.f}) {
                CAPTURE(name, resolution);
                const auto liquid = emptyLiquid(voxelSizeFor(mesh, resolution));
                fluid::seed(*liquid, mesh);
                requireLevelSet(*liquid);
            }
        }
}

TEST_CASE("the report has the maximum change of distances, and its position") {
    // a box 1.5 voxels thick, with its edges at the worst positions relative to the lattice
    const auto liquid = emptyLiquid(0.1f);
    const Mesh mesh = shapes::box({0.55f, 0.45f, 0.35f});
    const fluid::SeedReport report = fluid::seed(*liquid, mesh);
    requireLevelSet(*liquid);
    const test::Truth truth(mesh);
    double largest = 0;
    std::size_t changed = 0;
    for (auto voxel = liquid->cbeginValueOn(); voxel; ++voxel) {
        const openvdb::Vec3d at = liquid->indexToWorld(voxel.getCoord());
        const double change =
            std::abs(double(*voxel) - truth.signedDistance({at.x(), at.y(), at.z()})) / liquid->voxelSize()[0];
        changed += change > 0.1;
        largest = std::max(largest, change);
    }
    CHECK(double(report.maxChangeVoxels) == Approx(largest).margin(1e-3));
    CHECK(std::abs(double(report.changedVoxels) - double(changed)) <= 0.1 * double(changed) + 1);
    const openvdb::Vec3d at(report.where.x, report.where.y, report.where.z);
    const double there = double(liquid->tree().getValue(openvdb::Coord::round(liquid->worldToIndex(at))));
    CHECK(std::abs(there - truth.signedDistance(report.where)) / liquid->voxelSize()[0] ==
          Approx(largest).margin(1e-3));
}

TEST_CASE("overlapping solids are one liquid") {
    const Mesh mesh = shapes::join(
        {shapes::box({0.5f, 0.4f, 0.3f}), shapes::moved(shapes::box({0.5f, 0.4f, 0.3f}), {0.3f, 0.2f, 0.1f})});
    const auto united = emptyLiquid(0.02f), apart = emptyLiquid(0.02f);
    fluid::seed(*united, mesh);
    requireLevelSet(*united);
    const double whole = 2 * 0.48 - 0.7 * 0.6 * 0.5;
    CHECK(volume(*united) == Approx(whole).epsilon(5e-3));  // like that of one box; its edges are rounded
    CHECK(united->tree().getValue(openvdb::Coord(7, 5, 2)) < 0);
    fluid::seed(*apart, mesh, {}, {fluid::SeedMode::unite, false});
    CHECK(volume(*apart) < 0.99 * whole);
}

TEST_CASE("the volume of the two boxes of the cases") {
    const auto path = test::corpusMesh("../cases/two-boxes-overlapping.obj");
    if (!path) return;
    const auto liquid = emptyLiquid(0.02f);
    fluid::seed(*liquid, readMesh(*path));
    requireLevelSet(*liquid);
    CHECK(volume(*liquid) == Approx(1.578).epsilon(1e-3));
    const Mesh surfaceOfIt = surface(LevelSet(std::make_shared<Grids>(Grids{liquid, nullptr})));
    CHECK(inspect(surfaceOfIt).nonManifoldEdges == 0);
}

TEST_CASE("boxes stacked face on face seed as one, wherever voxels lie") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::normal_distribution<float> normal;
    const Mesh half = shapes::box({0.5f, 0.5f, 0.5f}), whole = shapes::box({1, 0.5f, 0.5f});
    // mirrored in y, so that the other box's part of the shared wall has the other diagonal
    Mesh mirrored = shapes::flipped(half);
    for (glm::vec3& p : mirrored.points) p.y = -p.y;
    const auto stackOf = [&](const Mesh& other) {
        return shapes::join({shapes::moved(half, {-0.5f, 0, 0}), shapes::moved(other, {0.5f, 0, 0})});
    };
    for (const float resolution : {16.f, 20.f, 32.f, 50.f, 63.f, 64.f, 65.f, 100.f})
        for (const bool turns : {false, true}) {
            Pose pose;
            if (turns) {
                pose.position = {normal(random), normal(random), normal(random)};
                pose.rotation =
                    glm::normalize(glm::quat(normal(random), normal(random), normal(random), normal(random)));
            }
            const auto one = emptyLiquid(2 / resolution);
            fluid::seed(*one, whole, pose);
            for (const Mesh& other : {half, mirrored}) {
                const auto stacked = emptyLiquid(2 / resolution);
                CAPTURE(resolution, turns);
                fluid::seed(*stacked, stackOf(other), pose);
                requireLevelSet(*stacked);
                CHECK(volume(*stacked) == Approx(volume(*one)).epsilon(1e-3));
            }
        }
}
}  // namespace bilayer::repair_test
