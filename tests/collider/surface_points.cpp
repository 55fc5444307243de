// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/body/surface_points.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/vec2.hpp>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::surface_points_test {
using namespace bilayer::detail;
using namespace bilayer::test;

namespace {

struct Case {
    const char* name;
    Mesh mesh;
    float spacing;
};

// Triangles much larger than the spacing, much smaller, mixed, slivers, thin walls.
std::vector<Case> cases() {
    return {{"box of 12 triangles", shapes::box({1, 0.6f, 0.4f}), 0.1f},
            {"fine box", shapes::box({1, 0.6f, 0.4f}, 20), 0.3f},
            {"sphere", shapes::sphere(1, 4), 0.2f},
            {"torus", shapes::torus(1, 0.3f, 40, 12), 0.1f},
            {"cone of slivers", shapes::cone(0.5f, 2, 64), 0.15f},
            {"plate", shapes::box({1, 1, 0.02f}), 0.1f}};
}

double area(const Mesh& mesh, const glm::uvec3& t) {
    const glm::dvec3 a(mesh.points[t.x]), b(mesh.points[t.y]), c(mesh.points[t.z]);
    return 0.5 * glm::length(glm::cross(b - a, c - a));
}

double area(const Mesh& mesh) {
    double sum = 0;
    for (const glm::uvec3& t : mesh.triangles) sum += area(mesh, t);
    return sum;
}

// A uniformly distributed random point of the surface.
glm::dvec3 randomSurfacePoint(const Mesh& mesh, double total, Random& random) {
    double left = random(0, total);
    std::size_t i = 0;
    while (i + 1 < mesh.triangles.size() && left > area(mesh, mesh.triangles[i]))
        left -= area(mesh, mesh.triangles[i++]);
    const glm::uvec3 t = mesh.triangles[i];
    double u = random(0, 1), v = random(0, 1);
    if (u + v > 1) u = 1 - u, v = 1 - v;
    return glm::dvec3(mesh.points[t.x]) * (1 - u - v) + glm::dvec3(mesh.points[t.y]) * u +
           glm::dvec3(mesh.points[t.z]) * v;
}

const SurfacePoint& nearest(const SurfacePoints& points, const glm::dvec3& place) {
    const SurfacePoint* best = &points.points().front();
    for (const SurfacePoint& p : points.points())
        if (glm::distance(glm::dvec3(p.position), place) < glm::distance(glm::dvec3(best->position), place)) best = &p;
    return *best;
}

}  // namespace

TEST_CASE("an open surface has points on both sides, and points on its border that face away from it") {
    const Mesh sheet{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 3}}};
    const SurfacePoints points(sheet, 0.1f, [](const glm::dvec3&) { return true; });
    int up = 0, down = 0;
    for (const SurfacePoint& p : points.points()) {
        up += p.normal.z > 0.99f;
        down += p.normal.z < -0.99f;
        CHECK(p.isInner == !(p.normal.z > 0.99f));
        if (std::abs(p.normal.z) > 0.99f) continue;
        CHECK(p.isSharp);
        const glm::vec2 fromCentre = glm::vec2(p.position) - 0.5f;
        CHECK(std::max(std::abs(fromCentre.x), std::abs(fromCentre.y)) == Approx(0.5f));
        CHECK(glm::dot(glm::normalize(fromCentre), glm::vec2(p.normal)) > 0.7f);
    }
    CHECK(up > 60);
    CHECK(down > 60);
    for (const glm::vec2 outward : {glm::vec2(1, 0), {0, 1}, {-1, 0}, {0, -1}})
        for (float along = -0.45f; along < 0.5f; along += 0.1f) {
            const glm::vec2 place = 0.5f + 0.5f * outward + along * glm::vec2(outward.y, outward.x);
            const auto bears = [&](const SurfacePoint& p) {
                return glm::dot(p.normal, glm::vec3(outward, 0)) > 0.7f &&
                       glm::distance(p.position, glm::vec3(place, 0)) < 0.11f;
            };
            CAPTURE(outward.x, outward.y, along);
            CHECK(std::any_of(points.points().begin(), points.points().end(), bears));
        }
}

TEST_CASE("the inner side of a shell is covered as its outer side, whichever of them is the front") {
    for (const float radius : {0.15f, 0.2f, 0.3f, 0.5f})
        for (const bool isFlipped : {false, true}) {
            const Mesh ball = shapes::sphere(radius, 4);
            const SurfacePoints points(isFlipped ? shapes::flipped(ball) : ball, 0.1f,
                                       [](const glm::dvec3&) { return true; });
            CAPTURE(radius, isFlipped);
            for (const bool isInner : {false, true})
                for (const glm::vec3& vertex : ball.points) {
                    const glm::vec3 normal = glm::normalize(vertex) * (isInner ? -1.f : 1.f);
                    const auto covers = [&](const SurfacePoint& p) {
                        return p.isInner == isInner && glm::distance(p.position, vertex) < 0.1f &&
                               glm::dot(p.normal, normal) > 0.5f && glm::dot(vertex - p.position, normal) < 0.005f;
                    };
                    REQUIRE(std::any_of(points.points().begin(), points.points().end(), covers));
                }
        }
}

TEST_CASE("the inner side of an open surface is the one that faces its body") {
    const Mesh body = shapes::box({0.5f, 0.5f, 0.1f});
    for (const bool isFlipped : {false, true}) {
        Mesh sheet{{{-0.3f, -0.3f, 0.15f}, {0.3f, -0.3f, 0.15f}, {0.3f, 0.3f, 0.3f}, {-0.3f, 0.3f, 0.3f}},
                   {{0, 1, 2}, {0, 2, 3}}};
        if (isFlipped) sheet = shapes::flipped(sheet);
        const auto isOutside = [](const glm::dvec3& place) { return place.z > 0.1; };
        const SurfacePoints points(shapes::join({body, sheet}), 0.05f, isOutside);
        CAPTURE(isFlipped);
        int inner = 0, outer = 0;
        for (const SurfacePoint& p : points.points()) {
            if (p.position.z < 0.11f) {
                CHECK_FALSE(p.isInner);
                continue;
            }
            if (std::abs(p.normal.z) < 0.9f) continue;  // on the border
            CHECK(p.isInner == (p.normal.z < 0));
            ++(p.isInner ? inner : outer);
        }
        CHECK(inner > 100);
        CHECK(outer > 100);
    }
}

TEST_CASE("a thin closed plate has no inner points") {
    const Mesh plate = shapes::box({0.5f, 0.5f, 0.00015f});
    const SurfacePoints points(plate, 0.02f, [](const glm::dvec3& place) { return std::abs(place.z) > 0.00015; });
    for (const bool isUp : {false, true})
        CHECK(std::any_of(points.points().begin(), points.points().end(), [&](const SurfacePoint& p) {
            return !p.isInner && (isUp ? p.normal.z > 0.9f : p.normal.z < -0.9f);
        }));
    CHECK(
        std::none_of(points.points().begin(), points.points().end(), [](const SurfacePoint& p) { return p.isInner; }));
}

TEST_CASE("points lie on the mesh, cover it at the spacing, and are not many more than that takes") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const auto& [name, mesh, spacing] : cases()) {
        CAPTURE(name);
        const SurfacePoints points(mesh, spacing);
        for (const SurfacePoint& p : points.points()) {
            REQUIRE(test::distance(mesh, glm::dvec3(p.position)) < 2e-7);
            REQUIRE(glm::length(p.normal) == Approx(1).margin(1e-6));
        }
        const double total = area(mesh);
        for (int i = 0; i < 1500; ++i) {
            const glm::dvec3 place = randomSurfacePoint(mesh, total, random);
            REQUIRE(glm::distance(glm::dvec3(nearest(points, place).position), place) < 1.25 * spacing);
        }
        REQUIRE(double(points.points().size()) < 3 * total / (spacing * spacing) + 50);
    }
}

TEST_CASE("points closer than the spacing allows stand out over each other's tangent planes, or are corners") {
    const float radius = GENERATE(1.f, 3.f, 12.f), spacing = 1;  // small balls require points closer together
    CAPTURE(radius);
    const SurfacePoints points(shapes::sphere(radius, 5), spacing);
    const auto standsOut = [&](const SurfacePoint& p, const SurfacePoint& over) {
        return glm::dot(p.position - over.position, p.normal) > 0.0349f * spacing;
    };
    for (const SurfacePoint& p : points.points())
        for (const SurfacePoint& q : points.points())
            if (&p != &q && glm::distance(p.position, q.position) < 0.69f * spacing)
                REQUIRE((standsOut(p, q) || standsOut(q, p)));
}

TEST_CASE("planes that touch a mesh find a point a small part of the spacing behind them") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    struct Named {
        std::string name;
        Mesh mesh;
        float spacing;
        double most;  // [spacings]
    };
    std::vector<Named> all;
    for (const float radius : {1.5f, 2.f, 4.f, 16.f}) all.push_back({"sphere", shapes::sphere(radius, 5), 1, 0.06});
    for (const float minor : {1.5f, 4.f}) all.push_back({"torus", shapes::torus(8, minor), 1, 0.06});
    all.push_back({"cylinder", shapes::cylinder(3, 5), 1, 0.06});
    all.push_back({"cone", shapes::cone(3, 5), 1, 0.06});
    for (const char* name : {"bunny_watertight.obj", "armadillo_100k.ply", "cow.obj"})
        if (const auto path = corpusMesh(name)) {
            Mesh mesh = readMesh(*path);
            const float size = glm::length(bounds(mesh).size());
            for (const float parts : {16.f, 48.f}) all.push_back({name, mesh, size / parts, 0.12});
        }
    for (const auto& [name, mesh, spacing, most] : all) {
        CAPTURE(name, spacing);
        const SurfacePoints points(mesh, spacing);
        for (int i = 0; i < 200; ++i) {
            const glm::vec3 direction = random.direction();
            float surface = -1e9f, found = surface;
            for (const glm::vec3& point : mesh.points) surface = std::max(surface, glm::dot(direction, point));
            for (const SurfacePoint& point : points.points())
                found = std::max(found, glm::dot(direction, point.position));
            REQUIRE((surface - found) / spacing < most);
        }
    }
}

TEST_CASE("convex corners stay, whatever the spacing") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const glm::vec3 half(1, 0.6f, 0.4f);
    for (const float spacing : {0.07f, 0.5f, 1.f, 3.f})
        for (const int cells : {1, 7}) {
            const glm::mat4 motion = glm::mat4_cast(glm::angleAxis(float(random(0, 6)), random.direction()));
            const SurfacePoints points(transformed(shapes::box(half, cells), motion), spacing);
            for (int i = 0; i < 8; ++i) {
                const glm::vec3 sign(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
                const glm::vec3 corner = glm::mat3(motion) * (sign * half);
                const SurfacePoint& found = nearest(points, glm::dvec3(corner));
                REQUIRE(glm::distance(found.position, corner) < 1e-6f);
                REQUIRE(glm::dot(found.normal, glm::mat3(motion) * sign) > 0.999f * std::sqrt(3.f));
            }
        }
    const SurfacePoints cone(shapes::cone(0.5f, 2, 64), 0.4f);
    REQUIRE(glm::distance(nearest(cone, {0, 0, 1}).position, glm::vec3(0, 0, 1)) < 1e-6f);
}

TEST_CASE("an edge keeps its points before the faces next to it") {
    // finely divided, so that all of its points can be vertices
    const SurfacePoints points(shapes::box({1, 1, 1}, 30), 0.25f);
    for (float along = -1; along <= 1; along += 0.01f) {
        float gap = 2;
        for (const SurfacePoint& p : points.points())
            if (p.position.y == 1 && p.position.z == 1) gap = std::min(gap, std::abs(p.position.x - along));
        REQUIRE(gap < 0.7f * 0.25f + 1 / 30.f);
    }
}

TEST_CASE("convex vertices smaller than the spacing have points with normals in all directions") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const float size = GENERATE(0.05f, 0.4f, 1.f, 1.5f);  // radius of a ball or a tube [spacings]
    CAPTURE(size);
    const SurfacePoints ball(shapes::sphere(size, 4), 1), ring(shapes::torus(4, size, 200, 48), 1);
    const auto maxCosine = [](const SurfacePoints& points, const glm::vec3& direction, const glm::vec3& near,
                              float within) {
        float best = -1;
        for (const SurfacePoint& p : points.points())
            if (glm::distance(p.position, near) < within) best = std::max(best, glm::dot(p.normal, direction));
        return best;
    };
    for (int i = 0; i < 300; ++i) {
        REQUIRE(maxCosine(ball, random.direction(), {}, 2 * size) > 0.65f);
        const double around = random(0, 6.28), across = random(0, 6.28);  // around the ring, around the tube
        const glm::vec3 radial(std::cos(around), std::sin(around), 0);
        const glm::vec3 out = float(std::cos(across)) * radial + glm::vec3(0, 0, std::sin(across));
        REQUIRE(maxCosine(ring, out, 4.f * radial + size * out, 1) > 0.65f);
    }
}

TEST_CASE("normals point outward") {
    const SurfacePoints sphere(shapes::sphere(2, 4), 0.1f);
    for (const SurfacePoint& p : sphere.points()) REQUIRE(glm::dot(p.normal, glm::normalize(p.position)) > 0.998f);
    for (const auto& [name, mesh, spacing] : cases()) {
        CAPTURE(name);
        const SurfacePoints points(mesh, spacing);
        for (std::size_t i = 0; i < points.points().size(); i += 7) {
            const SurfacePoint& point = points.points()[i];
            REQUIRE(windingNumber(mesh, glm::dvec3(point.position + 1e-3f * point.normal)) < 0.5);
            REQUIRE(windingNumber(mesh, glm::dvec3(point.position - 1e-3f * point.normal)) > 0.5);
            REQUIRE_FALSE(point.isInner);
        }
    }
}

TEST_CASE("both sides of a thin plate have points") {
    const SurfacePoints points(shapes::box({1, 1, 0.01f}), 0.2f);
    int above = 0, below = 0;
    for (const SurfacePoint& p : points.points()) (p.position.z > 0 ? above : below) += std::abs(p.normal.z) > 0.9f;
    REQUIRE(above > 40);
    REQUIRE(below > 40);
}

TEST_CASE("the spheres of the tree hold their points, and its nodes part them") {
    for (const auto& [name, mesh, spacing] : cases()) {
        CAPTURE(name);
        const SurfacePoints points(mesh, spacing);
        const auto nodes = points.tree().nodes();
        REQUIRE(nodes[0].begin == 0);
        REQUIRE(nodes[0].end == points.points().size());
        REQUIRE(nodes[0].next == nodes.size());
        for (std::uint32_t i = 0; i < nodes.size(); ++i) {
            for (std::uint32_t p = nodes[i].begin; p < nodes[i].end; ++p)
                REQUIRE(glm::distance(points.points()[p].position, nodes[i].centre) <= nodes[i].radius);
            REQUIRE(nodes[i].next > i);
            if (nodes[i].next == i + 1) {
                REQUIRE(nodes[i].end - nodes[i].begin <= 8);
                continue;
            }
            const auto &first = nodes[i + 1], &second = nodes[first.next];
            REQUIRE(first.begin == nodes[i].begin);
            REQUIRE(first.end == second.begin);
            REQUIRE(second.end == nodes[i].end);
            REQUIRE(second.next == nodes[i].next);
        }
    }
}

TEST_CASE("a visit sees every point of a region once, in order") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const SurfacePoints points(shapes::torus(1, 0.3f), 0.05f);
    for (int i = 0; i < 50; ++i) {
        const glm::vec3 centre = random.point(1.5);
        const auto radius = float(random(0.05, 1));
        std::vector<bool> seen(points.points().size(), false);
        std::uint32_t next = 0, looked = 0;
        points.visit([&](const glm::vec3& c, float r) { return glm::distance(c, centre) > r + radius; },
                     [&](std::uint32_t index, const SurfacePoint& p) {
                         REQUIRE(index >= next);
                         REQUIRE(&p == &points.points()[index]);
                         next = index + 1;
                         seen[index] = true;
                         ++looked;
                     });
        for (std::uint32_t p = 0; p < seen.size(); ++p)
            if (glm::distance(points.points()[p].position, centre) <= radius) REQUIRE(seen[p]);
        REQUIRE(looked <= points.points().size());
    }
    SurfacePoints().visit([](const glm::vec3&, float) { return false; },
                          [](std::uint32_t, const SurfacePoint&) { FAIL("there is no point"); });
}

TEST_CASE("the same mesh gives the same points, its vertices shared or not") {
    const Mesh mesh = shapes::cone(0.5f, 2, 20);
    Mesh loose;
    for (const glm::uvec3& t : mesh.triangles) {
        const auto first = unsigned(loose.points.size());
        for (int k = 0; k < 3; ++k) loose.points.push_back(mesh.points[t[k]]);
        loose.triangles.push_back({first, first + 1, first + 2});
    }
    const SurfacePoints a(mesh, 0.1f), b(mesh, 0.1f), c(loose, 0.1f);
    REQUIRE(a.points().size() == b.points().size());
    for (std::size_t i = 0; i < a.points().size(); ++i) {
        REQUIRE(a.points()[i].position == b.points()[i].position);
        REQUIRE(a.points()[i].normal == b.points()[i].normal);
    }
    for (const SurfacePoint& p : c.points()) REQUIRE(glm::length(p.normal) == Approx(1));
    REQUIRE(double(c.points().size()) == Approx(double(a.points().size())).epsilon(0.1));
}

TEST_CASE("dirty meshes have points, empty ones are refused") {
    Mesh dirty = shapes::box({1, 1, 1});
    dirty.triangles.push_back({0, 1, 1});  // no triangle
    dirty.points.insert(dirty.points.end(), {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}});
    const auto last = unsigned(dirty.points.size());
    dirty.triangles.push_back({last - 3, last - 2, last - 1});  // zero area
    dirty.triangles.push_back(dirty.triangles[0]);              // duplicate
    const SurfacePoints points(dirty, 0.2f);
    for (const SurfacePoint& p : points.points()) REQUIRE(glm::length(p.normal) == Approx(1));

    REQUIRE_THROWS_AS(SurfacePoints(Mesh{}, 1), std::invalid_argument);
    REQUIRE_THROWS_AS(SurfacePoints(dirty, 0), std::invalid_argument);
    REQUIRE_THROWS_AS(SurfacePoints(dirty, -1), std::invalid_argument);
    REQUIRE_THROWS_AS(SurfacePoints(dirty, std::numeric_limits<float>::quiet_NaN()), std::invalid_argument);
    const Mesh line{{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {{0, 1, 2}}};
    REQUIRE_THROWS_AS(SurfacePoints(line, 1), std::invalid_argument);
}
}  // namespace bilayer::surface_points_test
