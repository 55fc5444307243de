// SPDX-License-Identifier: Apache-2.0
// Contacts of faces that are nearly as far apart as counts as touching: cuts and labels agree, so that unions have no
// holes.
#include "sdf/mesh/triangle_contacts.h"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <map>
#include <random>
#include <vector>

#include <bilayer/sdf/inspect.h>
#include "sdf/mesh/unite.h"
#include "tests/sdf/union_solids.h"
#include "tests/support/support.h"
#include "tests/support/truth.h"

namespace bilayer::triangle_contacts_test {
using namespace bilayer::detail;
using namespace bilayer::test;

namespace {

// Moves the corners of a box apart, in the axes of which `reach` is not 0. Its faces tilt.
Mesh shaken(Mesh mesh, std::mt19937& random, const glm::vec3& reach) {
    std::uniform_real_distribution<float> some(-1, 1);
    std::map<std::array<float, 3>, glm::vec3> moved;
    for (glm::vec3& p : mesh.points) {
        const auto [at, isNew] = moved.try_emplace({p.x, p.y, p.z});
        if (isNew) at->second = p + reach * glm::vec3(some(random), some(random), some(random));
        p = at->second;
    }
    return mesh;
}

// Boxes that often have planes in common. `firstAtZero` puts one face of each on the plane x = 0.
std::vector<Box> flushBoxes(std::mt19937& random, int count, bool firstAtZero) {
    std::uniform_int_distribution<int> coarse(-3, 3);
    std::vector<Box> boxes(std::size_t(count), Box{});
    for (Box& box : boxes)
        for (int axis = 0; axis < 3; ++axis) {
            const int a = axis == 0 && firstAtZero ? 0 : coarse(random);
            int b = a;
            while (a == b) b = coarse(random);
            box.lower[axis] = 0.25f * float(std::min(a, b));
            box.upper[axis] = 0.25f * float(std::max(a, b));
        }
    return boxes;
}

std::vector<glm::dvec3> pointsOn(const Mesh& mesh, std::mt19937& random, int count) {
    std::uniform_real_distribution<double> part(0, 1);
    std::vector<glm::dvec3> points;
    for (const glm::uvec3& t : mesh.triangles)
        for (int i = 0; i < count; ++i) {
            double u = part(random), v = part(random);
            if (u + v > 1) u = 1 - u, v = 1 - v;
            const glm::dvec3 a(mesh.points[t.x]), b(mesh.points[t.y]), c(mesh.points[t.z]);
            points.push_back(a + u * (b - a) + v * (c - a));
        }
    return points;
}

// How deep a point is inside the boxes.
double depth(const glm::dvec3& p, const std::vector<Box>& boxes) {
    double deepest = 0;
    for (const Box& box : boxes) {
        const glm::dvec3 within = glm::min(p - glm::dvec3(box.lower), glm::dvec3(box.upper) - p);
        deepest = std::max(deepest, std::min({within.x, within.y, within.z}));
    }
    return deepest;
}

glm::dquat anyRotation(std::mt19937& random) {
    std::normal_distribution<double> normal;
    return glm::normalize(glm::dquat(normal(random), normal(random), normal(random), normal(random)));
}

double volumeWithin(const LabelledMesh& boundary) {
    double volume = 0;
    for (std::size_t i = 0; i < boundary.mesh.triangles.size(); ++i) {
        const glm::uvec3& t = boundary.mesh.triangles[i];
        const glm::dvec3 a(boundary.mesh.points[t.x]), b(boundary.mesh.points[t.y]), c(boundary.mesh.points[t.z]);
        volume += glm::dot(a, glm::cross(b, c)) / 6 / boundary.labels[i];
    }
    return volume;
}

}  // namespace

// Walls on the two sides of a gap may stay or go. The outer surface stays, and nothing else does.
TEST_CASE("faces at gaps around the touching distance leave the outer surface and at most the walls of the gaps") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (int i = 0; i < 200; ++i) {
        const std::vector<Box> flush = flushBoxes(random, 2 + i % 5, false);
        const float gap = 1e-7f * float(i % 8);
        const glm::dquat rotation = i % 3 ? anyRotation(random) : glm::dquat(1, 0, 0, 0);
        CAPTURE(i, flush.size(), gap);
        std::vector<Mesh> solids;
        for (const Box& box : flush) solids.push_back(shaken(turned(box.mesh(), rotation), random, glm::vec3(gap)));
        const Mesh united = unite(shapes::join(solids)).mesh;
        const Truth result(united);
        double hole = 0, buried = 0;
        for (const glm::dvec3& p : pointsOn(truthOf(flush), random, 3))
            hole = std::max(hole, result.distance(rotation * p));
        for (const glm::dvec3& p : pointsOn(united, random, 3))
            buried = std::max(buried, depth(glm::inverse(rotation) * p, flush));
        CHECK(hole < 4e-6);
        CHECK(buried < 4e-6);
    }
}

TEST_CASE("the boundary of a union has one side of each gap, however narrow") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (int i = 0; i < 200; ++i) {
        const std::vector<Box> flush = flushBoxes(random, 2 + i % 5, true);
        const float gap = 1e-13f * float(1 << i % 8);
        CAPTURE(i, flush.size(), gap);
        std::vector<Mesh> solids;
        for (const Box& box : flush) solids.push_back(shaken(box.mesh(), random, {gap, 0, 0}));
        CHECK(volumeWithin(unionBoundary(shapes::join(solids))) == Approx(inspect(truthOf(flush)).volume).margin(1e-6));
    }
}
}  // namespace bilayer::triangle_contacts_test
