// SPDX-License-Identifier: Apache-2.0
// The paper's theorems at random triangles and wedges, and their limits.
#include "bench/paper/theorems.h"

#include <catch2/catch.hpp>
#include <glm/gtc/constants.hpp>

#include "tests/support/support.h"

namespace bilayer::theorems_test {
using namespace bilayer::paper;

namespace {

constexpr double pi = glm::pi<double>(), none = 1e-9;

}  // namespace

TEST_CASE(
    "theorem 1: over faces a distance is too large by less than two thirds of the longest edge, and never too small") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    const DistanceError edges = overEdges(seed, 100'000), triangles = overTriangles(seed, 100'000);
    CHECK(edges.over < 0.5);
    CHECK(edges.over > 0.45);  // the bound is sharp
    CHECK(triangles.over < 2.0 / 3);
    CHECK(triangles.over > 0.55);
    CHECK(edges.under < none);
    CHECK(triangles.under < none);
}

TEST_CASE("theorem 1: so it is around reflex edges") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    const DistanceError error = aroundWedges(seed, 60, pi, 2 * pi - 0.3);
    CHECK(error.over < 2.0 / 3);
    CHECK(error.under < none);
}

TEST_CASE("theorem 1 does not hold at convex edges, where layers are nearer than delta: too small by up to 2 delta") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    const DistanceError square = aroundWedges(seed, 60, pi / 2, 0.55 * pi), sharp = aroundWedges(seed, 60, 0.1, pi / 2);
    CHECK(square.over < 2.0 / 3);
    CHECK(sharp.over < 2.0 / 3);
    CHECK(square.under > 2.0 / 3);
    CHECK(sharp.under > 2.0 / 3);
    CHECK(square.underDelta < 1 + none);
    CHECK(sharp.underDelta < 2 + none);
}

TEST_CASE("theorem 2: OF is no more than half of what the edges' halves differ by") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    const SignError closed = aroundBends(seed, 30'000, true), open = aroundBends(seed, 30'000, false);
    for (const SignError& error : {closed, open}) {
        CHECK(error.wrong > 100);
        CHECK(error.bound <= 1 + none);
        CHECK(error.formula < 1e-12);
    }
    CHECK(closed.farthest <= 1 + none);
    CHECK(open.farthest > 1);  // F is the farthest point only where Fig. 6 draws a triangle
}
}  // namespace bilayer::theorems_test
