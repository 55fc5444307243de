// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/fill_holes.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

#include <bilayer/sdf/inspect.h>
#include "demos/shared/shapes.h"
#include "sdf/sign/sign_choice.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::fill_holes_test {
using namespace bilayer::detail;
using namespace bilayer::test;

namespace {

double volumeOf(const Mesh& mesh) {
    double sum = 0;
    for (const glm::uvec3& t : mesh.triangles)
        sum += glm::dot(glm::dvec3(mesh.points[t.x]),
                        glm::cross(glm::dvec3(mesh.points[t.y]), glm::dvec3(mesh.points[t.z]))) /
               6;
    return sum;
}

Mesh without(Mesh mesh, const glm::vec3& centre, float radius) {
    const auto isIn = [&](const glm::uvec3& t) {
        return glm::distance((mesh.points[t.x] + mesh.points[t.y] + mesh.points[t.z]) / 3.f, centre) < radius;
    };
    std::erase_if(mesh.triangles, isIn);
    return mesh;
}

// A box of six faces that share no vertex. Each face is divided differently, so that vertices of one lie on edges of
// another, or next to them by some rounding.
Mesh crackedBox(float rounding, Random& random) {
    Mesh all;
    for (int axis = 0; axis < 3; ++axis)
        for (const int side : {-1, 1}) {
            const int u = 2 + 3 * axis + (side > 0), v = 7 - 2 * axis;
            const auto first = unsigned(all.points.size());
            for (int j = 0; j <= v; ++j)
                for (int i = 0; i <= u; ++i) {
                    glm::vec3 p;
                    p[axis] = float(side);
                    p[(axis + 1) % 3] = 2 * float(i) / float(u) - 1;
                    p[(axis + 2) % 3] = 2 * float(j) / float(v) - 1;
                    for (int k = 0; k < 3; ++k) p[k] += rounding * float(random(-1, 1));
                    all.points.push_back(p);
                }
            for (int j = 0; j < v; ++j)
                for (int i = 0; i < u; ++i) {
                    const unsigned a = first + unsigned(j * (u + 1) + i), b = a + 1, c = a + unsigned(u) + 1, d = c + 1;
                    for (glm::uvec3 t : {glm::uvec3(a, b, d), glm::uvec3(a, d, c)}) {
                        if (side < 0) std::swap(t.x, t.y);
                        all.triangles.push_back(t);
                    }
                }
        }
    return all;
}

}  // namespace

TEST_CASE("holes in a round body are filled, and the body is closed, oriented and as large as before") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const Mesh whole = shapes::sphere(1, 4);
    for (int trial = 0; trial < 20; ++trial) {
        Mesh open = whole;
        const int holes = 1 + trial % 5;
        double lost = 0;
        for (int i = 0; i < holes; ++i) {
            glm::vec3 axis(0);
            axis[i % 3] = i < 3 ? 1.f : -1.f;
            const glm::vec3 centre = glm::normalize(axis + random.point(0.2));  // separate from all others
            const double radius = random(0.12, 0.35);
            open = without(std::move(open), centre, float(radius));
            const double rim = radius + 0.12, height = rim * rim / 2;  // no cap is higher than this
            lost += 3.1416 * height * height * (1 - height / 3);
        }
        const FilledMesh filled = fillHoles(open, 1e-6);
        CAPTURE(trial, filled.loops, filled.openLoops, lost);
        REQUIRE(filled.changed);
        CHECK(filled.openLoops == 0);
        CHECK(verdict(inspect(filled.mesh)) == "closed and oriented");
        CHECK(volumeOf(filled.mesh) <= volumeOf(whole) + 1e-6);
        CHECK(volumeOf(filled.mesh) >= volumeOf(whole) - lost);
        CHECK(std::equal(open.triangles.begin(), open.triangles.end(), filled.mesh.triangles.begin()));
    }
}

TEST_CASE("cracks between faces that are divided differently are closed without triangles of no area") {
    const unsigned seed = test::seed();
    const float rounding = GENERATE(0.f, 1e-7f, 1e-5f);
    CAPTURE(seed, rounding);
    Random random(seed);
    const Mesh cracked = crackedBox(rounding, random);
    REQUIRE_FALSE(balanced(cracked));
    const FilledMesh filled = fillHoles(cracked, 1e-4);
    CHECK(filled.openLoops == 0);
    const MeshReport report = inspect(filled.mesh);
    CHECK(verdict(report) == "closed and oriented");
    CHECK(report.area == Approx(24).epsilon(1e-4));
    CHECK(volumeOf(filled.mesh) == Approx(8).epsilon(1e-4));
}

TEST_CASE("what bounds no solid is not filled") {
    const Mesh whole = shapes::sphere(1, 3);
    CHECK_FALSE(fillHoles(whole, 1e-6).changed);
    CHECK(hash(fillHoles(whole, 1e-6).mesh) == hash(whole));
    Mesh sheet;
    sheet.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
    sheet.triangles = {{0, 1, 2}, {2, 1, 3}};
    CHECK_FALSE(fillHoles(sheet, 1e-6).changed);
    // a part with a hole that lies within the solid of another one
    const Mesh buried = shapes::join({shapes::box({2, 2, 2}), without(whole, {0, 0, 1}, 0.4f)});
    const FilledMesh filled = fillHoles(buried, 1e-6);
    CHECK_FALSE(filled.changed);
    CHECK(filled.openLoops == 1);
    CHECK(hash(filled.mesh) == hash(buried));
}
}  // namespace bilayer::fill_holes_test
