// SPDX-License-Identifier: Apache-2.0
// The carved box and the uneven sphere, the meshes of the benchmarks, have their documented properties.
#include "demos/shared/shapes.h"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <glm/geometric.hpp>
#include <set>

namespace bilayer::shapes_test {
namespace {

using Corners = std::array<glm::dvec3, 3>;

Corners corners(const Mesh& mesh, const glm::uvec3& t) {
    return {glm::dvec3(mesh.points[t.x]), glm::dvec3(mesh.points[t.y]), glm::dvec3(mesh.points[t.z])};
}

double volume(const Mesh& mesh) {
    double sum = 0;
    for (const auto& t : mesh.triangles) {
        const auto [a, b, c] = corners(mesh, t);
        sum += glm::dot(a, glm::cross(b, c)) / 6;
    }
    return sum;
}

// Each directed edge occurs once, and so does its reverse.
bool closedAndOriented(const Mesh& mesh) {
    std::set<std::pair<unsigned, unsigned>> edges;
    for (const auto& t : mesh.triangles)
        for (int k = 0; k < 3; ++k)
            if (!edges.insert({t[k], t[(k + 1) % 3]}).second) return false;
    for (const auto& [from, to] : edges)
        if (!edges.count({to, from})) return false;
    return true;
}

double sixVolumes(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, const glm::dvec3& d) {
    return glm::dot(b - a, glm::cross(c - a, d - a));
}

// Includes touching: a segment without a vertex of the triangle must not meet the triangle at all.
bool crosses(const glm::dvec3& p, const glm::dvec3& q, const Corners& t) {
    const double below = sixVolumes(p, t[0], t[1], t[2]), above = sixVolumes(q, t[0], t[1], t[2]);
    if (below * above > 0 || (below == 0 && above == 0)) return false;
    const double u = sixVolumes(p, q, t[0], t[1]), v = sixVolumes(p, q, t[1], t[2]), w = sixVolumes(p, q, t[2], t[0]);
    return (u >= 0 && v >= 0 && w >= 0) || (u <= 0 && v <= 0 && w <= 0);
}

bool apart(const Corners& a, const Corners& b) {
    for (int axis = 0; axis < 3; ++axis) {
        const auto [lowA, highA] = std::minmax({a[0][axis], a[1][axis], a[2][axis]});
        const auto [lowB, highB] = std::minmax({b[0][axis], b[1][axis], b[2][axis]});
        if (highA < lowB || highB < lowA) return true;
    }
    return false;
}

// Counts edges that pass through a triangle with which they share no vertex, over all pairs.
int piercings(const Mesh& mesh) {
    int count = 0;
    for (const auto& s : mesh.triangles)
        for (const auto& t : mesh.triangles) {
            const Corners triangle = corners(mesh, t), other = corners(mesh, s);
            if (apart(triangle, other)) continue;
            const auto uses = [&](unsigned v) { return v == t.x || v == t.y || v == t.z; };
            for (int k = 0; k < 3; ++k)
                if (!uses(s[k]) && !uses(s[(k + 1) % 3])) count += crosses(other[k], other[(k + 1) % 3], triangle);
        }
    return count;
}

}  // namespace

TEST_CASE("a carved box is closed, oriented and about as many triangles as asked for") {
    for (const std::size_t wanted : {std::size_t(10000), std::size_t(123456), shapes::paperCircularBox}) {
        const Mesh mesh = shapes::carvedBox(wanted, 2);
        CHECK(double(mesh.triangles.size()) == Approx(double(wanted)).epsilon(0.02));
        CHECK(closedAndOriented(mesh));
        CHECK(2 * mesh.points.size() == mesh.triangles.size() + 4);  // one sphere without unused vertices
        // a cylinder of the body's radius, within the volume that lid, dome and carving add and remove
        CHECK(volume(mesh) == Approx(8 * 3.1416 * 0.9 * 0.9 * 1.2).epsilon(0.1));
        // vertices of an odd grid lie off the axes by half a cell of at most 1/30
        CHECK(bounds(mesh).longestSide() == Approx(4).epsilon(1.0 / 900));
        CHECK(bounds(mesh).size().z == Approx(2 * 1.28).epsilon(1.0 / 900));
    }
    CHECK_THROWS_AS(shapes::carvedBox(99), std::invalid_argument);
}

TEST_CASE("a carved box does not intersect itself") {
    for (const std::size_t triangles : {std::size_t(100), std::size_t(3000), std::size_t(10000)})
        CHECK(piercings(shapes::carvedBox(triangles)) == 0);
    // the count itself finds two boxes that intersect
    CHECK(piercings(shapes::join({shapes::box({1, 1, 1}), shapes::box({0.4f, 0.5f, 2})})) > 0);
}

TEST_CASE("the triangles of a carved box are about equally large") {
    const Mesh mesh = shapes::carvedBox(200000);
    double smallest = 1e9, largest = 0;
    for (const auto& t : mesh.triangles) {
        const auto [a, b, c] = corners(mesh, t);
        const double area = glm::length(glm::cross(b - a, c - a)) / 2;
        smallest = std::min(smallest, area);
        largest = std::max(largest, area);
    }
    CHECK(largest < 20 * smallest);
}

TEST_CASE("uneven spheres have the areas and the shapes of triangles that they claim to have") {
    for (const float deviation : {0.0013f, 0.0052f, 0.0098f}) {
        const Mesh mesh = shapes::unevenSphere(deviation);
        REQUIRE(mesh.triangles.size() == shapes::paperSphere);
        CHECK(closedAndOriented(mesh));
        CHECK(volume(mesh) > 4.0);
        CHECK(volume(mesh) < 4.1888);
        double sum = 0, squares = 0, thinnest = 1;
        for (const auto& t : mesh.triangles) {
            const auto [a, b, c] = corners(mesh, t);
            const double area = glm::length(glm::cross(b - a, c - a)) / 2;
            const double longest = std::max({glm::distance(a, b), glm::distance(b, c), glm::distance(c, a)});
            sum += area;
            squares += area * area;
            thinnest = std::min(thinnest, area / (longest * longest));
        }
        const double count = double(mesh.triangles.size());
        CHECK(std::sqrt(squares / count - sum * sum / (count * count)) == Approx(deviation).epsilon(1e-3));
        CHECK(thinnest > 0.12);  // an equilateral triangle has 0.43, half a square 0.25
    }
    CHECK_THROWS_AS(shapes::unevenSphere(0.0052f, 98), std::invalid_argument);
    CHECK_THROWS_AS(shapes::unevenSphere(0), std::invalid_argument);
    CHECK_THROWS_AS(shapes::unevenSphere(1), std::invalid_argument);
}
}  // namespace bilayer::shapes_test
