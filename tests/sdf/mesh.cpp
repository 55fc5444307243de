// SPDX-License-Identifier: Apache-2.0
#include <bilayer/sdf/mesh.h>

#include <array>
#include <catch2/catch.hpp>
#include <cstring>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>
#include <map>
#include <random>
#include <vector>

#include "demos/shared/shapes.h"
#include "tests/support/support.h"

namespace bilayer::mesh_test {
namespace {

Mesh triangle() {
    return {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
}

// Key by which a map identifies equal coordinates: -0 equals 0.
std::array<float, 3> keyOf(const glm::vec3& p) {
    return {p.x + 0.f, p.y + 0.f, p.z + 0.f};
}

Mesh weldedByMap(const Mesh& mesh) {
    std::map<std::array<float, 3>, unsigned> firsts;
    for (unsigned i = 0; i < mesh.points.size(); ++i) firsts.emplace(keyOf(mesh.points[i]), i);
    Mesh welded;
    std::vector<bool> used(mesh.points.size());
    for (const glm::uvec3& t : mesh.triangles) {
        const auto first = [&](int k) { return firsts.at(keyOf(mesh.points[t[k]])); };
        const glm::uvec3 merged(first(0), first(1), first(2));
        if (merged.x == merged.y || merged.y == merged.z || merged.z == merged.x) continue;
        for (int k = 0; k < 3; ++k) used[merged[k]] = true;
        welded.triangles.push_back(merged);
    }
    std::vector<unsigned> number(mesh.points.size());
    for (unsigned i = 0; i < mesh.points.size(); ++i) {
        if (!used[i]) continue;
        number[i] = unsigned(welded.points.size());
        welded.points.push_back(mesh.points[i]);
    }
    for (glm::uvec3& t : welded.triangles) t = {number[t.x], number[t.y], number[t.z]};
    return welded;
}

bool sameBytes(const std::vector<glm::vec3>& a, const std::vector<glm::vec3>& b) {
    return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(glm::vec3)) == 0);
}

}  // namespace

TEST_CASE("validate names what is wrong") {
    CHECK_NOTHROW(validate(triangle()));
    CHECK_THROWS_WITH(validate(Mesh{}), Catch::Contains("no triangle"));
    Mesh mesh = triangle();
    mesh.triangles.push_back({0, 1, 3});
    CHECK_THROWS_WITH(validate(mesh), Catch::Contains("triangle 1 uses vertex 3"));
    mesh = triangle();
    mesh.points[2].y = std::numeric_limits<float>::quiet_NaN();
    CHECK_THROWS_WITH(validate(mesh), Catch::Contains("vertex 2 is not finite"));
    mesh.points[2].y = std::numeric_limits<float>::infinity();
    CHECK_THROWS_AS(validate(mesh), std::invalid_argument);
}

TEST_CASE("weld merges equal vertices, drops collapsed triangles and unused vertices, keeps the order") {
    Mesh soup;
    soup.points = {{5, 5, 5}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-0.f, 0, 0}, {0, 1, 0}, {1, 0, 0}, {0, 0, 1}};
    soup.triangles = {{1, 2, 3}, {4, 1, 2}, {4, 7, 5}};
    const Mesh mesh = weld(soup);
    CHECK(mesh.points == std::vector<glm::vec3>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}});
    CHECK(mesh.triangles == std::vector<glm::uvec3>{{0, 1, 2}, {0, 3, 2}});
}

TEST_CASE("weld agrees with a map of coordinates, wherever equal vertices stand") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    // lattice points with signed zeros: side^3 places for some hundred thousand vertices
    for (const int side : {1, 7, 40, 200}) {
        std::uniform_int_distribution<int> place(-side / 2, (side - 1) / 2);
        std::bernoulli_distribution negative;
        const auto coordinate = [&] {
            const float x = 0.1f * float(place(random));
            return x == 0 && negative(random) ? -x : x;
        };
        Mesh mesh;
        for (int i = 0; i < 200'000; ++i) mesh.points.emplace_back(coordinate(), coordinate(), coordinate());
        std::uniform_int_distribution<unsigned> vertex(0, unsigned(mesh.points.size() - 1));
        for (int i = 0; i < 100'000; ++i) mesh.triangles.emplace_back(vertex(random), vertex(random), vertex(random));
        const Mesh expected = weldedByMap(mesh), welded = weld(mesh);
        CHECK(sameBytes(welded.points, expected.points));
        CHECK(welded.triangles == expected.triangles);
        const Mesh again = weld(welded);
        CHECK(sameBytes(again.points, welded.points));
        CHECK(again.triangles == welded.triangles);
    }
}

TEST_CASE("validate names the first of many faults") {
    Mesh mesh;
    mesh.points.assign(300'000, glm::vec3(1));
    mesh.triangles.assign(300'000, {0, 1, 2});
    for (const unsigned i : {123'456u, 200'000u, 299'999u}) mesh.triangles[i].y = 400'000;
    CHECK_THROWS_WITH(validate(mesh), Catch::Contains("triangle 123456 uses vertex 400000"));
    for (const unsigned i : {54'321u, 54'322u, 299'999u}) mesh.points[i].z = std::numeric_limits<float>::infinity();
    CHECK_THROWS_WITH(validate(mesh), Catch::Contains("vertex 54321 is not finite"));
}

TEST_CASE("bounds hold the used vertices and no others") {
    Mesh mesh = triangle();
    mesh.points.push_back({9, 9, 9});
    CHECK(bounds(mesh).upper == glm::vec3(1, 1, 0));
    CHECK(bounds(mesh).longestSide() == 1.f);
    CHECK(bounds(Mesh{}).empty());
    CHECK(bounds(shapes::sphere(2.f, 5)).longestSide() == Approx(4).epsilon(0.01));
}

TEST_CASE("a mirror turns triangles around") {
    const Mesh mirrored = transformed(triangle(), glm::scale(glm::mat4(1), glm::vec3(1, 1, -1)));
    CHECK(mirrored.triangles[0] == glm::uvec3(0, 2, 1));
    const Mesh moved = transformed(triangle(), glm::translate(glm::mat4(1), glm::vec3(1, 2, 3)));
    CHECK(moved.triangles[0] == glm::uvec3(0, 1, 2));
    CHECK(moved.points[1] == glm::vec3(2, 2, 3));
}

TEST_CASE("a map that takes a vertex beyond float is refused") {
    const Mesh large = transformed(triangle(), glm::scale(glm::mat4(1), glm::vec3(3e38f, 1, 1)));
    CHECK_THROWS_WITH(transformed(large, glm::scale(glm::mat4(1), glm::vec3(9, 1, 1))),
                      Catch::Contains("vertex 1 would be beyond the range of float"));
}

TEST_CASE("the hash changes with every part of a mesh") {
    const Mesh sphere = shapes::sphere(1.f, 5);
    Mesh other = sphere;
    CHECK(hash(sphere) == hash(other));
    other.points[7].z = std::nextafter(other.points[7].z, 9.f);
    CHECK(hash(sphere) != hash(other));
    other = sphere;
    std::swap(other.triangles[3].x, other.triangles[3].y);
    CHECK(hash(sphere) != hash(other));
    other = sphere;
    std::swap(other.triangles[3], other.triangles[4000]);
    CHECK(hash(sphere) != hash(other));
}
}  // namespace bilayer::mesh_test
