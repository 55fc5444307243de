// SPDX-License-Identifier: Apache-2.0
// Triangulation of polygons: triangles cover the outline exactly, and outlines that cross themselves are reported.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdint>
#include <random>
#include <span>
#include <utility>

#include <bilayer/sdf/inspect.h>
#include "sdf/io/polygon/triangulate.h"
#include "sdf/sign/sign_choice.h"
#include "tests/sdf/lattice_walk.h"
#include "tests/sdf/outlines.h"
#include "tests/support/support.h"

namespace bilayer::triangulate_test {
using namespace bilayer::detail;
using namespace bilayer::test;

namespace {

// Checks that there are n - 2 triangles, that they use all corners, and that they contain each outline edge once and
// every other edge once in each direction.
void checkEdges(std::size_t corners, const std::vector<glm::uvec3>& triangles) {
    REQUIRE(triangles.size() == corners - 2);
    std::vector<std::pair<unsigned, unsigned>> edges;
    std::vector<char> used(corners);
    for (const glm::uvec3& t : triangles)
        for (int k = 0; k < 3; ++k) {
            REQUIRE(t[k] < corners);
            used[t[k]] = 1;
            edges.emplace_back(t[k], t[(k + 1) % 3]);
        }
    REQUIRE(std::count(used.begin(), used.end(), 0) == 0);
    std::sort(edges.begin(), edges.end());
    REQUIRE(std::adjacent_find(edges.begin(), edges.end()) == edges.end());
    std::size_t wrong = 0;
    for (const auto& [a, b] : edges) {
        const bool outline = b == (a + 1) % corners;
        wrong += outline == std::binary_search(edges.begin(), edges.end(), std::pair(b, a));
    }
    REQUIRE(wrong == 0);
}

// Returns the count of triangles without area. Checks that none is flipped: then their areas sum to that of the
// outline, and they cover each point as often as the outline winds around it.
std::size_t checkAreas(const Outline& outline, const std::vector<glm::uvec3>& triangles) {
    const std::int64_t whole = doubleArea(outline);
    std::int64_t sum = 0;
    std::size_t folded = 0, flat = 0;
    for (const glm::uvec3& t : triangles) {
        const std::int64_t area = doubleArea(outline[t.x], outline[t.y], outline[t.z]);
        sum += area;
        folded += whole > 0 ? area < 0 : area > 0;
        flat += area == 0;
    }
    REQUIRE(folded == 0);
    REQUIRE(sum == whole);
    return flat;
}

void check(Outline outline, std::mt19937& random, std::size_t flat = 0) {
    std::rotate(outline.begin(), outline.begin() + long(random() % outline.size()), outline.end());
    if (random() % 2) std::reverse(outline.begin(), outline.end());
    std::vector<glm::uvec3> triangles;
    const bool right = triangulate(inSpace(outline, random), triangles);
    checkEdges(outline.size(), triangles);
    const std::size_t flatTriangles = checkAreas(outline, triangles);
    REQUIRE(flatTriangles == flat);
    REQUIRE(right);
}

// Checks that the triangles of an outline that touches itself cover it exactly, from whatever corner it begins and in
// both directions.
void checkTouching(Outline outline, std::mt19937& random) {
    for (std::size_t i = 0; i < 2 * outline.size(); ++i) {
        CAPTURE(i);
        std::rotate(outline.begin(), outline.begin() + 1, outline.end());
        if (i == outline.size()) std::reverse(outline.begin(), outline.end());
        std::vector<glm::uvec3> triangles;
        const bool right = triangulate(inSpace(outline, random), triangles);
        checkEdges(outline.size(), triangles);
        checkAreas(outline, triangles);
        REQUIRE(right);
    }
}

void checkOnce(const Outline& outline, std::mt19937& random) {
    std::vector<glm::uvec3> triangles;
    REQUIRE(triangulate(inSpace(outline, random), triangles));
    checkEdges(outline.size(), triangles);
    checkAreas(outline, triangles);
}

// Checks that an invalid outline is reported; its triangles still close the surface that they belong to.
void checkWrong(const Outline& outline, std::mt19937& random) {
    std::vector<glm::uvec3> triangles;
    REQUIRE_FALSE(triangulate(inSpace(outline, random), triangles));
    checkEdges(outline.size(), triangles);
}

Mesh prism(const Outline& outline) {
    const std::size_t n = outline.size();
    Mesh mesh;
    std::vector<std::vector<unsigned>> faces(2);
    for (unsigned i = 0; i < n; ++i) {
        mesh.points.push_back({float(outline[i].x), float(outline[i].y), 0});
        mesh.points.push_back({float(outline[i].x), float(outline[i].y), 1});
        faces[0].push_back(2 * unsigned(n - 1 - i));
        faces[1].push_back(2 * i + 1);
        const unsigned next = (i + 1) % unsigned(n);
        faces.push_back({2 * i, 2 * next, 2 * next + 1, 2 * i + 1});
    }
    for (const auto& face : faces) {
        std::vector<glm::dvec3> corners;
        for (const unsigned corner : face) corners.emplace_back(mesh.points[corner]);
        std::vector<glm::uvec3> triangles;
        REQUIRE(triangulate(corners, triangles));
        for (const glm::uvec3& t : triangles) mesh.triangles.push_back({face[t.x], face[t.y], face[t.z]});
    }
    return mesh;
}

}  // namespace

TEST_CASE("outlines of squares, with and without corners on straight edges, are cut exactly") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (int i = 0; i < 1500; ++i) {
        CAPTURE(i);
        const double straight = i % 3 * 0.5;
        check(Squares(2 + int(random() % 60), false, random).outline(straight, random), random);
    }
}

TEST_CASE("mazes whose walls have no thickness are cut exactly") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (int i = 0; i < 1500; ++i) {
        CAPTURE(i);
        const double straight = i % 3 * 0.5;
        check(Squares(2 + int(random() % 60), true, random).outline(straight, random), random);
    }
}

TEST_CASE("stars are cut exactly, with corners on straight edges too") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (int i = 0; i < 2000; ++i) {
        CAPTURE(i);
        const Outline outline = star(4 + random() % 60, i % 2 ? 6 : 10000, random);
        check(outline, random);
        if (outline.size() > 3 || i % 2) check(withStraightCorners(outline, random), random);
    }
}

TEST_CASE("outlines that grew at random are cut exactly") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (int i = 0; i < 1500; ++i) {
        CAPTURE(i);
        const Outline outline = grown(4 + random() % 40, i % 2 ? 12 : 1000, random);
        check(outline, random);
        check(withStraightCorners(outline, random), random);
    }
}

TEST_CASE("holes that are joined by edges both ways are cut out exactly") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (int i = 0; i < 400; ++i) {
        CAPTURE(i);
        const int size = i % 2 ? 4 : 100, across = 1 + int(random() % 4);
        const std::int64_t side = std::int64_t(across) * 2 * size;
        Outline outline{{-1, -1}, {side + 1, -1}, {side + 1, side + 1}, {-1, side + 1}};
        if (random() % 2) outline = withStraightCorners(outline, random);
        std::vector<Outline> holes;
        for (int x = 0; x < across; ++x)
            for (int y = 0; y < across; ++y) {
                holes.push_back(star(5 + random() % 8, size - 1, random, {(2 * x + 1) * size, (2 * y + 1) * size}));
                std::reverse(holes.back().begin(), holes.back().end());
            }
        for (std::size_t k = 0; k < holes.size(); ++k) bridge(outline, std::span(holes).subspan(k));
        check(outline, random);
    }
}

TEST_CASE("combs and spirals of many corners are cut exactly") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (const int n : {1, 2, 3, 10, 200, 5000}) {
        CAPTURE(n);
        check(comb(n, 1 + n), random);
        check(spiral(n), random);
    }
    check(Squares(30000, true, random).outline(0.5, random), random);
    check(Squares(30000, false, random).outline(1, random), random);
    check(star(100000, 1 << 20, random), random);
    check(slit(30000), random);
    for (const bool mirrored : {false, true}) checkTouching(corridor(10, mirrored), random);
    for (const bool mirrored : {false, true}) checkOnce(corridor(30000, mirrored), random);
}

TEST_CASE("repeated corners and edges out and back cost a triangle without area each") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (int i = 0; i < 500; ++i) {
        CAPTURE(i);
        Outline outline = star(4 + random() % 20, 50, random);
        std::size_t flat = 1 + random() % 4;
        for (std::size_t k = 0; k < flat; ++k) {
            const std::size_t at = random() % outline.size();
            outline.insert(outline.begin() + long(at), outline[at]);
        }
        check(outline, random, flat);
    }
    // an outward spike takes two, an inward one none
    check({{0, 0}, {4, 0}, {4, 4}, {6, 6}, {4, 4}, {0, 4}}, random, 2);
    check({{0, 0}, {4, 0}, {4, 4}, {3, 3}, {4, 4}, {0, 4}}, random, 0);
    check({{0, 0}, {4, 0}, {4, 2}, {2, 2}, {4, 2}, {6, 2}, {4, 2}, {4, 4}, {0, 4}}, random, 2);
}

TEST_CASE("outlines that touch themselves are cut exactly") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    checkTouching({{0, 0}, {4, 0}, {4, 2}, {2, 2}, {4, 4}, {0, 4}, {2, 2}, {0, 3}}, random);  // two notches
    checkTouching({{0, 0}, {1, 0}, {1, 1}, {2, 1}, {2, 2}, {1, 2}, {1, 1}, {0, 1}}, random);  // two squares
    checkTouching({{0, 0}, {4, 0}, {4, 4}, {2, 0}, {0, 4}}, random);                          // a notch to an edge
    checkTouching({{0, 0}, {4, 0}, {4, 4}, {0, 4}, {0, 0}, {1, 2}, {2, 1}}, random);          // a hole at a corner
    // two triangles that are joined by an edge both ways, around a corner
    checkTouching({{1, 1}, {1, 0}, {2, 1}, {0, 1}, {1, 2}, {2, 2}, {2, 1}, {3, 2}, {1, 2}, {0, 1}}, random);
    for (int i = 0; i < 3000; ++i) {
        CAPTURE(i);
        const int size = 2 + i % 3, triangles = 2 + int(random() % unsigned(2 * size * size));
        const int bothWays = i % 4 == 0 ? 1 + int(random() % 3) : 0;
        const LatticeWalk walk(size, triangles, bothWays, random);
        if (bothWays > 0 && !walk.isWhole()) continue;
        Outline outline = withoutStraightCorners(walk.outline(), i % 3 * 0.5, random);
        if (i % 5 == 0) outline.push_back(outline.back());
        checkTouching(outline, random);
    }
}

TEST_CASE("large outlines that touch themselves are cut exactly") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (int i = 0; i < 40; ++i) {
        CAPTURE(i);
        const int size = 10 << i % 4;
        const Outline walk = LatticeWalk(size, size * size / (1 + i % 3), 0, random).outline();
        const Outline outline = withoutStraightCorners(walk, i % 2 * 0.5, random);
        std::vector<glm::uvec3> triangles;
        const bool right = triangulate(inSpace(outline, random), triangles);
        checkEdges(outline.size(), triangles);
        checkAreas(outline, triangles);
        REQUIRE(right);
    }
}

TEST_CASE("outlines that cross themselves or enclose nothing are reported") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    checkWrong({{0, 0}, {1, 1}, {2, 2}}, random);
    checkWrong({{0, 0}, {1, 1}, {2, 2}, {1, 1}}, random);
    checkWrong({{3, 1}, {3, 1}, {3, 1}, {3, 1}, {3, 1}}, random);
    checkWrong({{0, 0}, {4, 4}, {4, 0}, {0, 4}}, random);
    checkWrong({{0, 0}, {4, 4}, {4, 0}, {0, 5}}, random);
    checkWrong({{0, 0}, {2, 2}, {4, 4}, {4, 0}, {2, 2}, {0, 5}}, random);
    checkWrong({{0, 10}, {6, -8}, {-9, 3}, {9, 3}, {-6, -8}}, random);  // a pentagram
    // a band whose ends overlap: its total rotation is one turn to the left, like that of a simple outline
    checkWrong({{0, 0}, {10, 0}, {10, 10}, {4, 10}, {4, -4}, {6, -4}, {6, 8}, {8, 8}, {8, 2}, {0, 2}}, random);
    // around twice: edges only touch or overlap
    checkWrong({{0, 2}, {1, 0}, {2, 2}, {0, 2}, {1, 1}, {2, 2}}, random);
    checkWrong({{0, 0}, {4, 0}, {4, 4}, {0, 4}, {0, 0}, {4, 0}, {4, 4}, {0, 4}}, random);
    for (const std::size_t corners : {10u, 100u}) {
        Outline twice = star(corners, 10000, random);
        const Outline once = twice;
        twice.insert(twice.end(), once.begin(), once.end());
        checkWrong(twice, random);
    }
    int wrong = 0;
    for (int i = 0; i < 300; ++i) {
        CAPTURE(i);
        const std::size_t n = 4 + random() % 60;
        std::uniform_int_distribution<int> coordinate(-1000, 1000);
        Outline outline;
        for (std::size_t k = 0; k < n; ++k) outline.push_back({coordinate(random), coordinate(random)});
        bool crosses = false;
        for (std::size_t k = 0; k < n; ++k)
            for (std::size_t l = k + 2; l < n; ++l)
                if ((l + 1) % n != k)
                    crosses = crosses || touch(outline[k], outline[k + 1], outline[l], outline[(l + 1) % n]);
        wrong += crosses;
        if (crosses)
            checkWrong(outline, random);
        else
            check(outline, random);
    }
    CHECK(wrong > 100);
    Outline outline;
    for (int k = 0; k < 20000; ++k) outline.push_back({int(random() % 100000), int(random() % 100000)});
    checkWrong(outline, random);
}

TEST_CASE("a quadrangle is cut along the diagonal that lies within") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (int i = 0; i < 2000; ++i) {
        CAPTURE(i);
        Outline outline = star(4, i % 2 ? 3 : 1000, random);
        if (outline.size() == 4) check(outline, random);
    }
    std::vector<glm::uvec3> triangles;
    CHECK(triangulate(std::vector<glm::dvec3>{{0, 0, 0}, {1, 0, 0.2}, {1, 1, 0}, {0, 1, 0.2}}, triangles));
    CHECK(triangles == std::vector<glm::uvec3>{{0, 1, 2}, {0, 2, 3}});
    CHECK_FALSE(triangulate(std::vector<glm::dvec3>{{0, 0, 0}, {1, 0, 0}}, triangles));
    CHECK(triangles.size() == 2);
}

TEST_CASE("points that differ by the last bit of their coordinates are distinguished") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (int i = 0; i < 300; ++i) {
        CAPTURE(i);
        const Outline outline = grown(6 + random() % 20, 12, random);
        // exact: the shift is a power of two, and coordinates are its last bits
        std::vector<glm::dvec3> points;
        for (const Point& p : outline)
            points.emplace_back(0x1p40 + double(p.x) * 0x1p-12, 7, -0x1p40 + double(p.y) * 0x1p-12);
        std::vector<glm::uvec3> triangles;
        REQUIRE(triangulate(points, triangles));
        checkEdges(outline.size(), triangles);
        CHECK(checkAreas(outline, triangles) == 0);
    }
}

TEST_CASE("prisms on any outline are closed and have its area for a volume") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    // a corner of the caps lies on the diagonal between two others
    const Outline angle{{0, 0}, {2, 0}, {2, 2}, {1, 2}, {1, 4}, {0, 4}};
    for (int i = 0; i < 60; ++i) {
        CAPTURE(i);
        const Outline outline = i == 0   ? angle
                                : i < 30 ? withStraightCorners(grown(20, 12, random), random)
                                         : Squares(30, false, random).outline(0.3, random);
        const Mesh mesh = prism(outline);
        CHECK(balanced(mesh));
        CHECK(inspect(mesh).volume == Approx(0.5 * double(doubleArea(outline))));
    }
}
}  // namespace bilayer::triangulate_test
