// SPDX-License-Identifier: Apache-2.0
// Cancelling: seeding, particles and obstacles ask their caller whether to continue.
#include <openvdb/tools/LevelSetSphere.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <functional>
#include <vector>

#include <bilayer/collider/field.h>
#include <bilayer/integration/fluid/obstacle.h>
#include <bilayer/integration/fluid/particles.h>
#include <bilayer/integration/fluid/seed.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "tests/fluid/liquids.h"

namespace bilayer::cancel_test {
using namespace bilayer::test;
using openvdb::FloatGrid;

TEST_CASE("seeding, particles and obstacles can be cancelled wherever they ask") {
    const Mesh mesh = shapes::sphere(0.5f, 5);
    const auto liquid = openvdb::tools::createLevelSetSphere<FloatGrid>(0.5f, openvdb::Vec3f(0), 0.02f, 3);
    const auto cells = openvdb::math::Transform::createLinearTransform(0.02);
    const LevelSet field = fieldOf(mesh, 0.03f);
    const auto check = [](const auto& work) {
        std::vector<float> told;
        work([&](float fraction) { return told.push_back(fraction), true; });
        CHECK(std::is_sorted(told.begin(), told.end()));
        CHECK(told.back() == 1);
        CHECK_THROWS_AS(work([](float) { return false; }), Cancelled);
        CHECK_THROWS_AS(work([](float fraction) { return fraction < 1; }), Cancelled);
    };
    check([&](const std::function<bool(float)>& progress) {
        fluid::SeedOptions options;
        options.progress = progress;
        fluid::seed(*liquid->deepCopy(), mesh, {}, options);
    });
    check([&](const std::function<bool(float)>& progress) {
        fluid::SeedOptions options;
        options.progress = progress;
        fluid::seed(*liquid->deepCopy(), field, {}, options);
    });
    check([&](const auto& progress) { fluid::particles(*liquid, {.progress = progress}); });
    check([&](const auto& progress) { fluid::particles(Field(field), {}, *cells, {.progress = progress}); });
    check([&](const auto& progress) { fluid::solid(mesh, {}, *cells, {.progress = progress}); });
    check([&](const auto& progress) { fluid::solid(field, {}, *cells, {.progress = progress}); });
}
}  // namespace bilayer::cancel_test
