#include "collider/sharp_edges.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

#include "collider/collider.h"
#include "sdf/build.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

using namespace bilayer;
using namespace bilayer::test;

TEST_CASE("edges meet in the corners of a pyramid, and what comes against one of these meets it first") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const float height : {0.2f, 0.3f, 0.4f}) {
        Mesh mesh;
        const auto start = float(random(0, 6));
        for (int i = 0; i < 3; ++i) {
            const float angle = start + 2.0944f * (float(i) + float(random(-0.1, 0.1)));
            mesh.points.emplace_back(0.5f * std::cos(angle), 0.5f * std::sin(angle), 0);
        }
        mesh.points.emplace_back(float(random(-0.1, 0.1)), float(random(-0.1, 0.1)), height);
        mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
        const Collider collider(mesh, build(mesh, {.voxelSize = float(random(0.015, 0.03))}));
        const auto points = collider.points().points();
        for (unsigned corner = 0; corner < 4; ++corner) {
            CAPTURE(height, corner);
            const glm::vec3& place = mesh.points[corner];
            const auto at = std::find_if(points.begin(), points.end(), [&](const SurfacePoint& point) {
                return glm::distance(point.position, place) < 1e-5f;
            });
            REQUIRE(at != points.end());
            const auto index = std::uint32_t(at - points.begin());
            REQUIRE(collider.edges().around(index).size() == 3);
            for (int i = 0; i < 1000; ++i) {
                const glm::vec3 direction = random.direction();
                float highest = -1;  // of the edges that leave the corner
                for (unsigned other = 0; other < 4; ++other)
                    if (other != corner)
                        highest = std::max(highest, glm::dot(glm::normalize(mesh.points[other] - place), direction));
                CAPTURE(direction.x, direction.y, direction.z, highest);
                if (highest < 0) REQUIRE(collider.edges().isTip(collider.points(), index, direction));
                if (highest > 0.1f) REQUIRE(!collider.edges().isTip(collider.points(), index, direction));
            }
        }
    }
}
