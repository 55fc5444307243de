// SPDX-License-Identifier: Apache-2.0
// The sharp edges of a body.
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>

#include <bilayer/collider/collider.h>
#include <bilayer/sdf/build.h>
#include "collider/contact/body/collider_data.h"
#include "demos/shared/shapes.h"
#include "sdf/base/access.h"
#include "tests/support/support.h"

namespace bilayer::sharp_edges_test {
using namespace bilayer::detail;
using namespace bilayer::test;

namespace {

constexpr float h = 0.05f;  // voxel [m]

}  // namespace

TEST_CASE("Sharp edges are those of the mesh, and none crosses a groove") {
    const bool grooved = GENERATE(false, true);
    Mesh mesh = shapes::box({0.5f, 0.4f, 0.3f});
    // a comb: teeth four voxels apart
    if (grooved) {
        std::vector<Mesh> parts{shapes::box({0.5f, 0.4f, 0.1f})};
        for (int i = 0; i < 3; ++i) {
            parts.push_back(shapes::box({1.5f * h, 0.4f, 0.2f}));
            for (glm::vec3& p : parts.back().points) p += glm::vec3(float(i - 1) * 5 * h, 0, 0.15f);
        }
        mesh = shapes::join(parts);
    }
    const Collider collider(mesh, build(mesh, {.voxelSize = h, .interiorWidthVoxels = 6}));
    const auto points = dataOf(collider).points().points();
    double total = 0;
    for (const SharpEdge& edge : dataOf(collider).edges().edges()) {
        REQUIRE(edge.from < edge.to);
        const glm::vec3 &a = points[edge.from].position, &b = points[edge.to].position;
        total += glm::distance(a, b);
        CHECK(std::abs(signedDistance(mesh, 0.5f * (a + b))) < 0.5 * h);
    }
    // the pieces cover all twelve edges once
    if (!grooved) CHECK(total == Approx(4 * 2 * (0.5 + 0.4 + 0.3)).epsilon(1e-3));
}
}  // namespace bilayer::sharp_edges_test
