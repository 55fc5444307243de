// SPDX-License-Identifier: Apache-2.0
#include "sdf/mesh/closing_triangles.h"

#include <catch2/catch.hpp>
#include <random>

#include "demos/shared/shapes.h"
#include "sdf/mesh/topology.h"
#include "tests/support/support.h"

namespace bilayer::closing_triangles_test {
using namespace bilayer::detail;

namespace {

// Counts half-edges without opposites.
std::size_t openEdges(const Mesh& mesh) {
    std::size_t result = 0;
    Topology(mesh).forEachUnbalancedEdge([&](unsigned, unsigned, unsigned count) { result += count; });
    return result;
}

void requireClosed(Mesh mesh) {
    const std::size_t open = openEdges(mesh);
    const auto closing = closingTriangles(mesh);
    mesh.triangles.insert(mesh.triangles.end(), closing.begin(), closing.end());
    CAPTURE(open, closing.size());
    REQUIRE(openEdges(mesh) == 0);
    REQUIRE(closing.size() <= open);
}

}  // namespace

TEST_CASE("closing triangles close meshes with random faces taken away, repeated or flipped") {
    std::mt19937 random(test::seed());
    for (const double share : {0.0, 0.02, 0.3, 0.9}) {
        Mesh mesh = shapes::torus(1, 0.4f, 40, 20);
        std::bernoulli_distribution isChanged(share);
        std::vector<glm::uvec3> kept;
        for (const glm::uvec3& t : mesh.triangles) switch (isChanged(random) ? random() % 3 : 3) {
                case 0:
                    break;
                case 1:
                    kept.insert(kept.end(), 2, t);
                    break;
                case 2:
                    kept.emplace_back(t.x, t.z, t.y);
                    break;
                default:
                    kept.push_back(t);
            }
        mesh.triangles = kept;
        CAPTURE(share);
        requireClosed(mesh);
    }
}

TEST_CASE("closing triangles close triangles that share nothing, and those that share points only") {
    std::mt19937 random(test::seed());
    std::uniform_real_distribution<float> uniform(-1, 1);
    Mesh mesh;
    for (unsigned i = 0; i < 300; ++i) mesh.points.emplace_back(uniform(random), uniform(random), uniform(random));
    for (unsigned i = 0; i < 100; ++i) mesh.triangles.emplace_back(3 * i, 3 * i + 1, 3 * i + 2);
    CHECK(closingTriangles(mesh).size() == 100);
    requireClosed(mesh);
    for (glm::uvec3& t : mesh.triangles) t = {random() % 30, random() % 30, random() % 30};
    requireClosed(mesh);
}

TEST_CASE("a closed mesh needs no closing triangles, and a loop of n edges n - 2 of them") {
    Mesh mesh = shapes::sphere(1);
    CHECK(closingTriangles(mesh).empty());
    mesh.triangles.pop_back();
    CHECK(closingTriangles(mesh).size() == 1);
    for (unsigned n = 3; n < 40; ++n) {
        Mesh fan{{{0, 0, 1}}, {}};
        for (unsigned i = 0; i < n; ++i)
            fan.points.emplace_back(std::cos(6.28f * float(i) / float(n)), std::sin(6.28f * float(i) / float(n)), 0);
        for (unsigned i = 0; i < n; ++i) fan.triangles.emplace_back(0, 1 + i, 1 + (i + 1) % n);
        CAPTURE(n);
        CHECK(closingTriangles(fan).size() == n - 2);
        requireClosed(fan);
    }
}
}  // namespace bilayer::closing_triangles_test
