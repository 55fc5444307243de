// SPDX-License-Identifier: Apache-2.0
// Thin plates at any position of the voxels, the voxels that are recommended for them, and the lattices they cover.
#include "integration/fluid/detail/lattice_cover.h"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>

#include <bilayer/integration/fluid/obstacle.h>
#include <bilayer/integration/fluid/seed.h>
#include "demos/shared/shapes.h"
#include "tests/fluid/liquids.h"
#include "tests/support/support.h"

namespace bilayer::lattice_cover_test {
using namespace bilayer::test;

TEST_CASE(
    "whether a thin plate is accepted does not depend on where the voxels fall, and accepted ones are never lost") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> any(0, 1);
    const float voxel = 0.05f;
    const auto why = [](auto&& work) -> std::string {
        try {
            work();
        } catch (const std::invalid_argument& error) {
            return error.what();
        }
        return "";
    };
    const std::pair<float, bool> plates[] = {{0.1f, true},  {1.f, false},  {1.2f, true},
                                             {1.3f, false}, {1.5f, false}, {1.5f, true}};
    for (const auto& [thickness, turned] : plates) {  // [voxels]
        const Mesh plate = shapes::box(voxel * glm::vec3(3 + 3 * any(random), 3 + 3 * any(random), thickness / 2));
        const float angle = turned ? 6 * any(random) : 0;
        CAPTURE(thickness, turned, angle);
        int seeded = 0, solid = 0, tried = 0, triedSolid = 0;
        std::string reason;
        for (; tried < 200; ++tried) {
            const Pose pose = poseOf(angle, voxel * glm::vec3(any(random), any(random), any(random)));
            const auto liquid = emptyLiquid(voxel);
            const std::string bySeed = why([&] { fluid::seed(*liquid, plate, pose); });
            seeded += bySeed.empty();
            if (bySeed.empty() == liquid->empty()) FAIL_CHECK("nothing is left, or something of a refused plate");
            if (tried % 8 == 0) {
                ++triedSolid;
                const std::string bySolid = why([&] {
                    const fluid::Solid found = fluid::solid(plate, pose, liquid->transform());
                    bool inside = false;
                    for (auto value = found.distance->cbeginValueAll(); value; ++value) inside |= *value < 0;
                    CHECK(inside);
                });
                solid += bySolid.empty();
                reason = bySolid;
            }
        }
        CAPTURE(seeded, solid, reason);
        CHECK((seeded == 0 || seeded == tried));
        CHECK(solid == (seeded == 0 ? 0 : triedSolid));
        if (!turned) CHECK((seeded > 0) == (thickness > 1.44f));
        if (seeded > 0) continue;
        CHECK_THAT(reason, Catch::Contains("the body is too thin for these voxels"));
        const std::string recommends = "or take voxels of ";
        REQUIRE_THAT(reason, Catch::Contains(recommends));
        const float recommended = std::stof(reason.substr(reason.find(recommends) + recommends.size()));
        CHECK(recommended > 0.4f * thickness * voxel);
        CHECK(why([&] { fluid::seed(*emptyLiquid(recommended), plate, poseOf(angle)); }).empty());
    }
}

TEST_CASE("the widest place of a plate or a ball is as wide as it is") {
    for (const float width : {0.01f, 0.4f, 1.3f}) {
        CAPTURE(width);
        const Mesh plate = shapes::box({4, 3, width / 2}), ball = shapes::sphere(width / 2, 4);
        CHECK(fluid::detail::LatticeCover(plate, nullptr).widestPlace().widthVoxels == Approx(width).epsilon(0.01));
        CHECK(fluid::detail::LatticeCover(ball, nullptr).widestPlace().widthVoxels == Approx(width).epsilon(0.02));
    }
}

TEST_CASE("a ball of the covering width holds a voxel wherever the lattice falls, and a smaller one may not") {
    const auto covers = [](double width) {
        const Mesh ball = shapes::sphere(float(width / 2), 5);
        return fluid::detail::LatticeCover(ball, nullptr).isComplete();
    };
    CHECK(covers(1.005 * fluid::detail::coveringWidthVoxels));
    CHECK_FALSE(covers(1.73));
}

TEST_CASE("rotated plates of any size cover the lattices that brute force finds covered") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> any(0, 1);
    int complete = 0, tried = 0;
    for (; tried < 60; ++tried) {
        const double side = tried % 3 == 0 ? 20 : 3;  // [voxels]; large ones have too many places for one by one
        const glm::vec3 half(side * (0.5 + any(random)), side * (0.5 + any(random)), 0.15 + 0.6 * any(random));
        const glm::quat rotation =
            glm::angleAxis(float(any(random)), glm::normalize(glm::vec3(any(random), 1, any(random))));
        const Mesh plate = transformed(shapes::box(half), glm::mat4_cast(rotation));
        const Bounds box = bounds(plate);
        const auto depth = [&](const glm::dvec3& p) {
            const glm::dvec3 within = glm::dvec3(half) - glm::abs(glm::inverse(glm::dquat(rotation)) * p);
            return std::min({within.x, within.y, within.z});
        };
        // the voxels of all 64 lattices
        const double needed = std::sqrt(3.0) / 8;
        std::array<double, 64> deepest;
        deepest.fill(-1);
        const glm::ivec3 count(4.f * (box.upper - box.lower) + 1.f);
        for (int x = 0; x < count.x; ++x)
            for (int y = 0; y < count.y; ++y)
                for (int z = 0; z < count.z; ++z) {
                    double& depthThere = deepest[std::size_t(x % 4 * 16 + y % 4 * 4 + z % 4)];
                    depthThere = std::max(depthThere, depth(glm::dvec3(box.lower) + (glm::dvec3(x, y, z) + 0.5) / 4.0));
                }
        const double shallowest = *std::min_element(deepest.begin(), deepest.end());
        CAPTURE(tried, half.x, half.y, half.z, shallowest);
        if (std::abs(shallowest - needed) < 1e-4) continue;
        const bool isComplete = fluid::detail::LatticeCover(plate, nullptr).isComplete();
        CHECK(isComplete == (shallowest > needed));
        complete += isComplete;
    }
    CHECK(complete > 5);
    CHECK(complete < tried - 5);
}
}  // namespace bilayer::lattice_cover_test
