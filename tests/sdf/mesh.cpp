#include "sdf/mesh.h"

#include <catch2/catch.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>

#include "demos/shared/shapes.h"

using namespace bilayer;

namespace {

Mesh triangle() {
    return {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
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
