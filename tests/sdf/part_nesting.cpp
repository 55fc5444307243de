// SPDX-License-Identifier: Apache-2.0
#include "sdf/mesh/part_nesting.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdint>
#include <glm/geometric.hpp>
#include <vector>

#include "demos/shared/shapes.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::part_nesting_test {
using namespace bilayer::detail;

namespace {

struct Parts {
    Mesh mesh;
    std::vector<unsigned> partOf;
    unsigned count = 0;

    void add(const Mesh& part) {
        mesh = count == 0 ? part : shapes::join({mesh, part});
        partOf.resize(mesh.triangles.size(), count++);
    }
};

// Whether a part contains another one, by lines across all of its triangles in double precision.
bool contains(const Parts& parts, unsigned outer, unsigned inner) {
    std::vector<unsigned> members;
    Bounds boxes[2];
    for (unsigned i = 0; i < parts.partOf.size(); ++i)
        for (const unsigned part : {outer, inner}) {
            if (parts.partOf[i] != part) continue;
            if (part == inner) members.push_back(i);
            for (int k = 0; k < 3; ++k) boxes[part == inner].add(parts.mesh.points[parts.mesh.triangles[i][k]]);
        }
    for (int k = 0; k < 3; ++k)
        if (boxes[0].lower[k] > boxes[1].lower[k] || boxes[0].upper[k] < boxes[1].upper[k]) return false;
    const std::vector<glm::dvec3> directions = spreadDirections(3);
    for (std::size_t vote = 0; vote < 3; ++vote) {
        const auto corner = [&](unsigned triangle, int k) {
            return glm::dvec3(parts.mesh.points[parts.mesh.triangles[triangle][k]]);
        };
        const unsigned from = members[vote * members.size() / 3];
        const glm::dvec3 origin = (corner(from, 0) + corner(from, 1) + corner(from, 2)) / 3.0, d = directions[vote];
        unsigned crossings = 0;
        for (unsigned i = 0; i < parts.partOf.size(); ++i) {
            if (parts.partOf[i] != outer) continue;
            const glm::dvec3 a = corner(i, 0) - origin, b = corner(i, 1) - origin, c = corner(i, 2) - origin;
            const double ab = glm::dot(d, glm::cross(a, b)), bc = glm::dot(d, glm::cross(b, c)),
                         ca = glm::dot(d, glm::cross(c, a));
            const bool hit = (ab > 0 && bc > 0 && ca > 0) || (ab < 0 && bc < 0 && ca < 0);
            crossings += hit && glm::dot(a, glm::cross(b, c)) / (ab + bc + ca) > 0;
        }
        if (crossings % 2 == 0) return false;
    }
    return true;
}

// Compares sums of random values over containers, by which sets differ that are not equal.
void check(const Parts& parts, test::Random& random) {
    const TriangleTree tree(parts.mesh);
    const PartNesting nesting(parts.mesh, tree, parts.partOf, parts.count);
    std::vector<std::uint64_t> values(parts.count), inherited(parts.count);
    for (std::uint64_t& value : values) value = std::uint64_t(random(0, 1e15));
    std::size_t different = 0;
    for (const unsigned part : nesting.largestFirst()) {
        std::uint64_t expected = 0;
        for (unsigned outer = 0; outer < parts.count; ++outer)
            if (outer != part && contains(parts, outer, part)) expected += values[outer];
        different += nesting.sum(part, inherited, [&](unsigned outer) { return values[outer]; }) != expected;
    }
    CHECK(different == 0);
}

// A sphere that is turned, stretched and moved, and in some cases open or inside out.
Mesh body(float radius, const glm::vec3& centre, double open, test::Random& random) {
    Mesh mesh = shapes::sphere(1, int(random(1, 3)));
    const glm::vec3 x = random.direction(), y = glm::normalize(glm::cross(x, random.direction())), z = glm::cross(x, y);
    const float stretch = float(random(0.7, 1.0));
    for (glm::vec3& p : mesh.points) p = centre + radius * (p.x * x + p.y * y + stretch * p.z * z);
    if (random(0, 1) < open) mesh.triangles.pop_back();
    return random(0, 1) < 0.5 ? mesh : shapes::flipped(mesh);
}

}  // namespace

TEST_CASE("the containers of parts are those that lines across each part find") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    test::Random random(seed);
    SECTION("shells within shells") {
        for (const double distance : {0.5, 0.2, 0.02, 0.002}) {
            Parts parts;
            float radius = 1;
            for (int i = 0; i < 40; ++i, radius *= float(1 - distance))
                parts.add(body(radius, glm::vec3(0), 0, random));
            check(parts, random);
        }
    }
    SECTION("bodies anywhere") {
        for (const double open : {0.0, 0.2}) {
            Parts parts;
            for (int i = 0; i < 60; ++i)
                parts.add(body(float(std::exp2(random(-5, 0))), random.point(0.5f), open, random));
            check(parts, random);
        }
    }
    SECTION("many in one, next to shells that cross it") {
        Parts parts;
        parts.add(body(4, glm::vec3(0), 0, random));
        for (int i = 0; i < 3; ++i) parts.add(body(4, glm::vec3(2.f * float(i), 0.1f, 0), 0, random));
        for (int i = 0; i < 40; ++i) parts.add(body(0.1f, random.point(1.5f), 0.1, random));
        for (float radius = 1; radius > 0.1f; radius *= 0.9f) parts.add(body(radius, glm::vec3(0), 0, random));
        check(parts, random);
    }
    SECTION("shells that each cross the next") {
        Parts parts;
        for (int i = 0; i < 40; ++i) parts.add(body(1 - 0.02f * float(i), random.point(0.02f), 0, random));
        for (int i = 0; i < 10; ++i) parts.add(body(0.01f, random.point(0.05f), 0, random));
        check(parts, random);
    }
    SECTION("shells that all touch in one point") {
        Parts parts;
        for (int i = 0; i < 40; ++i) {
            const float radius = 1 - 0.02f * float(i);
            parts.add(shapes::moved(shapes::sphere(radius, 2), {0, 0, 1 - radius}));
        }
        for (int i = 0; i < 10; ++i) parts.add(body(0.01f, random.point(0.05f), 0, random));
        check(parts, random);
    }
}

TEST_CASE("a part of several bodies, and copies of parts, pass on no containers that are not theirs") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    test::Random random(seed);
    Parts parts;
    for (int i = 0; i < 20; ++i) {
        const float radius = 1 - 0.04f * float(i);
        const Mesh own = body(radius, glm::vec3(0), 0, random);
        const Mesh away = body(0.3f * radius, {float(random(1, 2)), 0, 0}, 0, random);
        parts.add(i % 3 ? own : shapes::join({own, away}));
    }
    for (int i = 0; i < 20; ++i) parts.add(body(0.05f, {float(random(0, 2)), 0, 0}, 0, random));
    check(parts, random);
}
}  // namespace bilayer::part_nesting_test
