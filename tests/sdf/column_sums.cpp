// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/column_sums.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "demos/shared/shapes.h"
#include "sdf/sign/triangle_columns.h"
#include "tests/support/support.h"

namespace bilayer::column_sums_test {
using namespace bilayer::detail;

TEST_CASE("column sums are added where two rectangles overlap") {
    ColumnSums a({-2, 0}, {3, 4});
    a.add(-2, 0, 5);
    a.add(2, 3, -1);
    ColumnSums b({2, 3}, {9, 9});
    b.add(2, 3, 7);
    b.add(8, 8, 1);
    a.add(b);
    CHECK(a.at(-2, 0) == 5);
    CHECK(a.at(2, 3) == 6);
    CHECK(a.at(8, 8) == 0);
    CHECK(a.at(3, 3) == 0);
    CHECK(a.values().size() == 20);
    CHECK(ColumnSums({3, 3}, {1, 9}).values().empty());
    a.add(ColumnSums({50, 50}, {60, 60}));
    CHECK(a.at(2, 3) == 6);
}

TEST_CASE("the crossings below a voxel of a closed mesh are its winding number") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> place(-4, 4);
    Mesh mesh = shapes::join({shapes::sphere(9, 2), shapes::moved(shapes::sphere(6, 2), {place(random), 3, 2}),
                              shapes::flipped(shapes::moved(shapes::box({2, 3, 4}), {1, place(random), 0}))});
    for (int round = 0; round < 300; ++round) {
        const glm::ivec3 voxel(int(random() % 24) - 12, int(random() % 24) - 12, int(random() % 24) - 12);
        int sum = 0;
        for (const glm::uvec3& t : mesh.triangles) {
            const TriangleColumns crossed(mesh.points[t.x], mesh.points[t.y], mesh.points[t.z]);
            const glm::dvec2 column(voxel);
            if (const int sign = crossed.crossing(column)) {
                CHECK(crossed.isCertain(column));
                CHECK(crossed.xs().first <= voxel.x);
                CHECK(crossed.ys().last >= voxel.y);
                if (crossed.firstAbove(column) <= voxel.z) sum += sign;
            }
        }
        if (test::distance(mesh, glm::dvec3(voxel)) < 1e-3) continue;
        CHECK(sum == std::lround(test::windingNumber(mesh, glm::dvec3(voxel))));
    }
}

TEST_CASE("heights of triangles that are vertical but for rounding are uncertain") {
    const auto sliver = [](double width) {
        return TriangleColumns({-width, -width, -1000}, {1000, 1000 + width, 0}, {-1000, -1000 + width, 5000});
    };
    CHECK(sliver(1).isCertain({0, 0}));
    CHECK(sliver(1e-3).isCertain({0, 0}));
    CHECK(!sliver(1e-10).isCertain({0, 0}));
    CHECK(!sliver(0).isCertain({0, 0}));
}
}  // namespace bilayer::column_sums_test
