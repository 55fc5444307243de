// SPDX-License-Identifier: Apache-2.0
// Bodies whose tips, ridges, cracks and borders align exactly, after the tests of K. Erleben, "Methodology for
// assessing mesh-based contact point methods", ACM Transactions on Graphics 37 (3), 2018.
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/gtc/constants.hpp>
#include <random>

#include "demos/shared/shapes.h"
#include "demos/shared/stage.h"
#include "tests/support/support.h"

namespace bilayer::degenerate_test {
using demo::BodyPrototype;

namespace {

constexpr float voxel = 0.04f, half = 0.4f;  // [m]
constexpr float lane = 6;                    // between pairs [m]

// Extrudes along y. The profile, in x and z, is counter-clockwise and star-shaped: entirely visible from a point
// within.
Mesh extruded(const std::vector<glm::vec2>& profile, const glm::vec2& within) {
    Mesh mesh;
    const auto count = std::uint32_t(profile.size());
    for (const float y : {-half, half}) {
        for (const glm::vec2& p : profile) mesh.points.emplace_back(p.x, y, p.y);
        mesh.points.emplace_back(within.x, y, within.y);
    }
    const std::uint32_t behind = count + 1;
    for (std::uint32_t i = 0; i < count; ++i) {
        const std::uint32_t next = (i + 1) % count;
        mesh.triangles.emplace_back(i, next, count);
        mesh.triangles.emplace_back(behind + next, behind + i, behind + count);
        mesh.triangles.emplace_back(i, behind + i, next);
        mesh.triangles.emplace_back(next, behind + i, behind + next);
    }
    return mesh;
}

Mesh turnedOver(Mesh mesh) {
    for (glm::vec3& p : mesh.points) p = {-p.x, p.y, -p.z};
    return mesh;
}

// With tips, ridges and openings upward.
std::vector<Mesh> degenerates() {
    const Mesh spike = shapes::cone(half / 2, 2 * half, 4);
    const Mesh wedge = extruded({{-half / 2, -half}, {half / 2, -half}, {0, half}}, {0, -half / 2});
    const Mesh crack = extruded(
        {{-half, -half}, {half, -half}, {half, half}, {voxel, half}, {0, -half / 4}, {-voxel, half}, {-half, half}},
        {0, -half / 2});
    return {spike, wedge, crack, shapes::box({half, half, half})};
}

std::shared_ptr<const BodyPrototype> prototypeOf(const Mesh& mesh, ContactAccuracy accuracy) {
    return demo::makePrototype(mesh, {.voxelSize = voxel, .accuracy = accuracy});
}

}  // namespace

TEST_CASE("Spikes, wedges, cracks and cliff edges that meet exactly come to rest, not deep in each other") {
    const ContactAccuracy accuracy =
        GENERATE(ContactAccuracy::samples, ContactAccuracy::exactNearFeatures, ContactAccuracy::exact);
    const unsigned start = test::seed();
    CAPTURE(nameOf(accuracy), start);
    std::mt19937 random(start);
    std::uniform_real_distribution<float> any(-1, 1);
    demo::Stage stage("degenerate bodies");
    const auto floor = prototypeOf(shapes::box({lane / 2 - 0.2f, lane / 2 - 0.2f, half}), accuracy);
    std::vector<std::shared_ptr<const BodyPrototype>> upright, over;
    for (const Mesh& mesh : degenerates()) {
        upright.push_back(prototypeOf(mesh, accuracy));
        over.push_back(prototypeOf(turnedOver(mesh), accuracy));
    }
    // exactly above each other; offset by half over the edge; and slightly off either
    const float asides[] = {0, half};
    int pairs = 0;
    for (const auto& falling : over)
        for (const auto& lying : upright)
            for (const float aside : asides)
                for (const bool exact : {true, false}) {
                    const glm::vec3 at(lane * float(pairs % 8), lane * float(pairs / 8), 0);
                    const float hair = exact ? 0 : 0.1f * voxel;
                    stage.add(floor, {}, {at - glm::vec3(0, 0, 2 * half)}, {});
                    stage.add(lying, {}, {at}, {});
                    const float x = hair * any(random), y = hair * any(random);
                    stage.add(falling, {.mass = 1}, {at + glm::vec3(aside + x, y, 2 * half + 0.1f)}, {});
                    ++pairs;
                }
    stage.run(20, [&] { return stage.allAsleep(); });
    const auto poses = stage.frames().back();
    const bool asleep = stage.allAsleep();
    const demo::Outcome outcome = stage.finish({});
    CAPTURE(outcome.deepest() / voxel, outcome.usuallyBelow() / voxel, outcome.energies.rise());
    CHECK(asleep);
    CHECK(outcome.deepest() < voxel);
    CHECK(outcome.energies.rise() < 0.01);
    for (std::size_t i = 2; i < poses.size(); i += 3) {
        const glm::vec3 at = poses[i].position;  // of a fallen body, at floor height or above
        REQUIRE(std::isfinite(glm::dot(at, at)));
        CHECK(at.z > -half);
    }
}
}  // namespace bilayer::degenerate_test
