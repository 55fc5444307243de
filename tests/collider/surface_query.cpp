// SPDX-License-Identifier: Apache-2.0
// The sample of a field's surface next to an edge.
#include <catch2/catch.hpp>
#include <cmath>

#include "collider/contact/search/surface_query.h"
#include "tests/collider/touching_bodies.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::surface_query_test {
using namespace bilayer::detail;
using namespace bilayer::test;

TEST_CASE("a point on a face has the face's normal, however near it is to an edge") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const glm::vec3 half(0.3f, 0.2f, 0.1f);
    for (int i = 0; i < 3000; ++i) {
        const int face = int(random(0, 3)), sideAxis = (face + 1) % 3, along = (face + 2) % 3;
        const auto depth = float(random(-1e-3, 1e-3)), toEdge = float(random(0.03, 0.5));  // [voxels]
        glm::vec3 place(0);
        place[face] = half[face] + depth * h;
        place[sideAxis] = half[sideAxis] - toEdge * h;
        place[along] = float(random(-0.8, 0.8)) * half[along];
        CAPTURE(face, depth, toEdge);
        const SurfaceSample sample = surfaceSampleAt(brick().field(), place, brick().field().sample(place), false);
        REQUIRE(sample.normal[face] > 0.99f);
        REQUIRE(std::abs(sample.distance) < 2e-3f * h);
    }
}
}  // namespace bilayer::surface_query_test
