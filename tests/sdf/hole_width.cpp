// SPDX-License-Identifier: Apache-2.0
// Widths of holes: round ones match the formula, rotation does not matter, closed meshes have none.
#include "sdf/sign/hole_width.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <random>

#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "sdf/mesh/orient.h"
#include "tests/support/support.h"

namespace bilayer::hole_width_test {
using namespace bilayer::detail;

namespace {

// A ball without the cap of some angle around z.
Mesh ballWithHole(float radius, float angle) {
    Mesh mesh = shapes::sphere(radius, 5);
    std::erase_if(mesh.triangles, [&](const glm::uvec3& t) {
        return mesh.points[t.x].z + mesh.points[t.y].z + mesh.points[t.z].z > 3 * radius * std::cos(angle);
    });
    return mesh;
}

}  // namespace

TEST_CASE("a round hole is as wide as its rim") {
    for (const float angle : {0.15f, 0.3f, 0.6f}) {
        CAPTURE(angle);
        const Hole hole = widestHole(ballWithHole(0.5f, angle), 0.05);
        // the rim follows edges, 1/26 of the radius long, within the circle
        const double circle = 2 * 0.5 * std::sin(double(angle)), edge = 0.5 / 26;
        CHECK(hole.width == Approx(circle).margin(0.1 * circle + edge));
        CHECK(glm::length(hole.centre - glm::dvec3(0, 0, 0.5 * std::cos(double(angle)))) < 0.3 * hole.width);
    }
}

TEST_CASE("holes narrower than asked for, and closed meshes, have no width") {
    CHECK(widestHole(ballWithHole(0.5f, 0.15f), 0.2).width == 0);
    CHECK(widestHole(shapes::torus(0.5f, 0.2f), 0.01).width == 0);
    CHECK(
        widestHole(shapes::join({shapes::sphere(0.5f, 3), shapes::moved(shapes::sphere(0.5f, 3), {0.3f, 0, 0})}), 0.01)
            .width == 0);
    // cracks: rims that almost touch
    const Mesh cracked = shapes::sphere(0.5f, 2);
    Mesh apart;
    for (const glm::uvec3& t : cracked.triangles) {
        const glm::vec3 middle = (cracked.points[t.x] + cracked.points[t.y] + cracked.points[t.z]) / 3.f;
        const auto first = unsigned(apart.points.size());
        for (int k = 0; k < 3; ++k) apart.points.push_back(middle + 0.999f * (cracked.points[t[k]] - middle));
        apart.triangles.emplace_back(first, first + 1, first + 2);
    }
    CHECK(widestHole(apart, 0.1).width == 0);
}

TEST_CASE("the minimum width decides whether a hole is found, not how wide it is") {
    for (const float angle : {0.15f, 0.3f, 0.6f}) {
        const Mesh mesh = ballWithHole(0.5f, angle);
        const double width = widestHole(mesh, 0.05).width;
        CAPTURE(angle, width);
        for (const double part : {0.3, 0.8, 0.95, 0.9999}) CHECK(widestHole(mesh, part * width).width == width);
        CHECK(widestHole(mesh, 1.0001 * width).width == 0);
    }
}

TEST_CASE("the width of a hole does not depend on how the mesh lies") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::normal_distribution<float> normal;
    std::vector<Mesh> meshes{ballWithHole(0.5f, 0.3f)};
    for (const char* name : {"bunny_5k_open.obj", "mp_bathtub.obj"})
        if (const auto path = test::corpusMesh(name)) meshes.push_back(orient(readMesh(*path)).mesh);
    for (const Mesh& mesh : meshes) {
        const double size = double(bounds(mesh).longestSide());
        const double width = widestHole(mesh, 0.005 * size).width;
        CHECK(width > 0);
        for (int i = 0; i < 5; ++i) {
            const glm::quat rotation =
                glm::normalize(glm::quat(normal(random), normal(random), normal(random), normal(random)));
            const glm::vec3 shift = float(size) * glm::vec3(normal(random), normal(random), normal(random));
            Mesh placed = mesh;
            for (glm::vec3& p : placed.points) p = rotation * p + shift;
            CHECK(widestHole(placed, 0.005 * size).width == Approx(width).epsilon(0.12));
        }
    }
}
}  // namespace bilayer::hole_width_test
