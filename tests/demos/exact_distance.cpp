// SPDX-License-Identifier: Apache-2.0
// Tests the measure of penetration that the demos use.
#define GLM_ENABLE_EXPERIMENTAL  // for the rotation between two vectors
#include "demos/shared/exact_distance.h"

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>
#include <glm/gtx/quaternion.hpp>
#include <random>

#include "demos/shared/shapes.h"
#include "tests/support/support.h"

namespace bilayer::exact_distance_test {
TEST_CASE("the exact distance agrees with brute force and the winding number") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(-1.6, 1.6);
    for (const Mesh& mesh : {shapes::torusKnot(2, 3, 1, 0.2f, 150, 16), shapes::box({1, 0.6f, 0.3f}),
                             shapes::cone(0.8f, 1.4f, 24), shapes::bowl(1, 0.1f, 48)}) {
        const demo::ExactDistance distance(mesh);
        for (int i = 0; i < 400; ++i) {
            const glm::dvec3 p(uniform(random), uniform(random), uniform(random));
            REQUIRE(distance(p) == Approx(test::signedDistance(mesh, p)).margin(1e-9));
        }
    }
}

TEST_CASE("penetration is the depth of the deepest surface point") {
    const demo::Specimen cube(shapes::box({0.5f, 0.5f, 0.5f}, 8), 0.02), ball(shapes::sphere(0.5f, 5), 0.02);
    CHECK(demo::penetration(cube, {}, ball, {{0, 0, 1.2f}}) == 0);
    CHECK(demo::penetration(cube, {}, ball, {{0, 0, 0.9f}}) == Approx(0.1).epsilon(0.02));
    CHECK(demo::penetration(ball, {{0, 0, 0.9f}}, cube, {}) == Approx(0.1).epsilon(0.02));
    CHECK(demo::penetration(cube, {}, ball, {{0, 0, 0.9f}}, 0.3) == 0.3);
    // a corner first: half a cube's diagonal, minus the separation
    const glm::quat onCorner = glm::rotation(glm::normalize(glm::vec3(1, 1, 1)), glm::vec3(0, 0, -1));
    const double corner = 0.5 * std::sqrt(3.0);
    CHECK(demo::penetration(cube, {}, cube, {{0, 0, 0.5f + float(corner) - 0.08f}, onCorner}) ==
          Approx(0.08).epsilon(0.02));
}
}  // namespace bilayer::exact_distance_test
