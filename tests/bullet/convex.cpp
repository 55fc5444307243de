// SPDX-License-Identifier: Apache-2.0
// Bullet's convex shapes by formula.
#include "integration/bullet/detail/contact_shapes.h"

#include <LinearMath/btConvexHullComputer.h>
#include <btBulletCollisionCommon.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <initializer_list>
#include <limits>
#include <string>
#include <vector>

#include "demos/shared/shapes.h"
#include "integration/bullet/detail/convert.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::convex_test {
using namespace bilayer::detail;
using namespace bilayer::bullet::detail;
using namespace bilayer::test;

namespace {

std::vector<glm::vec3> cloud(std::size_t count, const glm::vec3& size, Random& random) {
    std::vector<glm::vec3> points;
    for (std::size_t i = 0; i < count; ++i)
        points.push_back(size * glm::vec3(random(-1, 1), random(-1, 1), random(-1, 1)));
    return points;
}

/// The triangles of a hull, each face as a fan.
Mesh hullOf(const std::vector<glm::vec3>& points) {
    std::vector<btVector3> all;
    for (const glm::vec3& point : points) all.push_back(bullet::detail::toBullet(point));
    btConvexHullComputer hull;
    hull.compute(&all.front().x(), sizeof(btVector3), int(all.size()), 0, 0);
    Mesh mesh;
    for (int i = 0; i < hull.vertices.size(); ++i) mesh.points.push_back(bullet::detail::toGlm(hull.vertices[i]));
    for (int i = 0; i < hull.faces.size(); ++i) {
        const auto* first = &hull.edges[hull.faces[i]];
        const unsigned apex = unsigned(first->getSourceVertex());
        for (const auto* edge = first->getNextEdgeOfFace(); edge != first; edge = edge->getNextEdgeOfFace())
            if (unsigned(edge->getTargetVertex()) != apex)
                mesh.triangles.push_back({apex, edge->getSourceVertex(), edge->getTargetVertex()});
    }
    return mesh;
}

}  // namespace

TEST_CASE("Points near hulls are as far away as from the nearest of all their faces") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const struct {
        std::string name;
        std::vector<glm::vec3> points;
    } hulls[] = {{"tetrahedron", cloud(4, glm::vec3(1), random)},
                 {"cloud of 12", cloud(12, glm::vec3(1), random)},
                 {"cloud of 300", cloud(300, {1, 0.6f, 0.3f}, random)},
                 {"plate", cloud(60, {1, 1, 0.01f}, random)},
                 {"needle", cloud(60, {1, 0.01f, 0.02f}, random)},
                 {"sphere", shapes::sphere(1, 3).points},
                 {"box with points all over its faces", shapes::box({1, 0.6f, 0.4f}, 6).points},
                 {"cylinder", shapes::cylinder(0.5f, 1).points},
                 {"cone", shapes::cone(0.5f, 1).points}};
    for (const auto& hull : hulls) {
        CAPTURE(hull.name);
        btConvexHullShape shape;
        for (const glm::vec3& point : hull.points) shape.addPoint(bullet::detail::toBullet(point), false);
        shape.recalcLocalAabb();
        shape.setMargin(0);
        const Convex convex = convexOf(shape);
        const Mesh faces = hullOf(hull.points);
        for (int i = 0; i < 3000; ++i) {
            const glm::vec3 point = float(random(0.01, 3)) * random.direction();
            const NearestPoint near = convex.nearest(point, std::numeric_limits<float>::max());
            CAPTURE(i, point.x, point.y, point.z);
            REQUIRE(std::abs(near.distance) == Approx(test::distance(faces, glm::dvec3(point))).margin(2e-6));
            REQUIRE(glm::distance(near.core + near.distance * near.normal, point) < 4e-6f);
            REQUIRE(test::distance(faces, glm::dvec3(near.core)) < 2e-6);
        }
    }
}

TEST_CASE("A point next to a face has the face's normal at any distance") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const auto check = [&](const Convex& convex, const glm::vec3& place, const glm::vec3& normal,
                           bool isOnRim = false) {
        for (const float height : {1e-9f, 1e-8f, 1e-7f, 1e-6f, 1e-5f, 1e-3f}) {
            const NearestPoint near = convex.nearest(place + height * normal, 1);
            CAPTURE(height, place.x, place.y, place.z, near.normal.x, near.normal.y, near.normal.z);
            REQUIRE(near.distance == Approx(height).margin(1e-6));
            // on a rim a point within rounding of the side counts as on it too
            if (height > 1e-6f || !isOnRim) REQUIRE(glm::dot(near.normal, normal) > 0.9999f);
        }
    };
    btConvexHullShape hull;
    const std::vector<glm::vec3> points = cloud(100, {1, 0.6f, 0.3f}, random);
    for (const glm::vec3& point : points) hull.addPoint(bullet::detail::toBullet(point), false);
    hull.recalcLocalAabb();
    hull.setMargin(0);
    const Convex ofPoints = convexOf(hull);
    const Mesh faces = hullOf(points);
    for (const glm::uvec3& t : faces.triangles) {
        const glm::vec3 &p = faces.points[t.x], &q = faces.points[t.y], &r = faces.points[t.z];
        const auto u = float(random(0.1, 0.5)), v = float(random(0.1, 0.4));
        const glm::vec3 square = glm::cross(q - p, r - p);
        if (glm::length(square) < 1e-3f) continue;  // too small: rounding dominates the direction
        const glm::vec3 place = p + u * (q - p) + v * (r - p);
        check(ofPoints, place, std::copysign(1.f, glm::dot(square, place)) * glm::normalize(square));
    }
    const float radius = 0.5f, half = 0.8f;
    btCylinderShape cylinder({radius, half, radius});
    btConeShape cone(radius, 2 * half);
    cone.setMargin(0);
    const Convex round = convexOf(cylinder), pointed = convexOf(cone);
    for (int i = 0; i < 1000; ++i) {
        const float angle = float(random(0, 6.2831)), way = i % 4 ? radius * float(random(0, 1)) : radius;
        const glm::vec3 out(std::cos(angle), 0, std::sin(angle));
        const float at = float(random(-0.99, 0.99)) * half;
        check(round, way * out + glm::vec3(0, half, 0), {0, 1, 0}, way == radius);
        check(round, radius * out + glm::vec3(0, at, 0), out);
        check(pointed, way * out - glm::vec3(0, half, 0), {0, -1, 0}, way == radius);
        check(pointed, radius * (half - at) / (2 * half) * out + glm::vec3(0, at, 0),
              glm::normalize(2 * half * out + glm::vec3(0, radius, 0)));
    }
}

TEST_CASE("Straight paths enter convex shapes where the distance is zero, and only there") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    btConvexHullShape hull;
    for (const glm::vec3& point : cloud(100, {1, 0.6f, 0.3f}, random))
        hull.addPoint(bullet::detail::toBullet(point), false);
    hull.recalcLocalAabb();
    hull.setMargin(0.05f);
    btBoxShape box({0.9f, 0.5f, 0.2f});
    btSphereShape ball(0.7f);
    btCapsuleShape capsule(0.3f, 1);
    btCylinderShape cylinder({0.5f, 0.8f, 0.5f});
    btConeShape cone(0.6f, 1.5f);
    btVector3 centres[]{{-0.5f, 0, 0}, {0.5f, 0.2f, 0}, {0, 0, 0.6f}};
    btScalar radii[]{0.3f, 0.5f, 0.1f};
    btMultiSphereShape balls(centres, radii, 3);
    const float tolerance = 1e-3f;
    int entries = 0;
    for (const btConvexShape* shape :
         std::initializer_list<btConvexShape*>{&hull, &box, &ball, &capsule, &cylinder, &cone, &balls}) {
        CAPTURE(shape->getName());
        const Convex convex = convexOf(*shape);
        for (int i = 0; i < 1000; ++i) {
            const glm::vec3 start = float(random(0, 2.5)) * random.direction(),
                            way = float(random(0, 4)) * random.direction();
            CAPTURE(i);
            const auto entry = convex.castPoint(start, way, tolerance);
            // until then it is outside; without an entry, over the whole displacement
            const float until = entry ? entry->fraction : 1;
            for (float part = 0; part < until; part += 2e-3f)
                REQUIRE(convex.nearest(start + part * way, 10).distance > -1e-4f);
            if (!entry) continue;
            ++entries;
            REQUIRE(convex.nearest(start + entry->fraction * way, 10).distance ==
                    Approx(entry->nearest.distance).margin(1e-5));
            REQUIRE(entry->nearest.distance <= tolerance);
        }
    }
    CHECK(entries > 1500);
}

TEST_CASE("The side of a cone has generator lines however flat it is, and its flat end has none") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const float half : {0.5f, 0.05f, 0.01f}) {
        CAPTURE(half);
        btConeShape shape(0.6f, 2 * half);
        shape.setMargin(0);
        const Convex cone = convexOf(shape);
        for (int i = 0; i < 100; ++i) {
            const float angle = float(random(0, 6.2831)), part = float(random(0.1, 0.9));
            const glm::vec3 out(std::cos(angle), 0, std::sin(angle)),
                normal = glm::normalize(2 * half * out + glm::vec3(0, 0.6f, 0)),
                place = 0.6f * part * out + glm::vec3(0, half - 2 * half * part, 0) + 0.01f * normal;
            const auto line = cone.sideLine(cone.nearest(place, 1), place);
            REQUIRE(line);
            // from the rim to the apex, through the nearest point
            CHECK(glm::distance((*line)[0], 0.6f * out - glm::vec3(0, half, 0)) < 1e-5f);
            CHECK(glm::distance((*line)[1], glm::vec3(0, half, 0)) < 1e-5f);
            const glm::vec3 below = 0.6f * part * out - glm::vec3(0, half + 0.01f, 0);
            CHECK_FALSE(cone.sideLine(cone.nearest(below, 1), below));
        }
    }
}

TEST_CASE("Nothing is inside of a flat hull, and paths next to it do not enter it") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const glm::vec3 corners[] = {{-1, -0.5f, 0}, {1, -0.5f, 0}, {0.8f, 0.7f, 0}, {-0.5f, 1, 0}};
    btConvexHullShape shape;
    Mesh quad;
    for (const glm::vec3& corner : corners) {
        shape.addPoint(bullet::detail::toBullet(corner), false);
        quad.points.push_back(corner);
    }
    quad.triangles = {{0, 1, 2}, {0, 2, 3}};
    shape.recalcLocalAabb();
    shape.setMargin(0);
    const Convex convex = convexOf(shape);  // Bullet rounds its vertices to 1e-4 of its size
    for (int i = 0; i < 2000; ++i) {
        const glm::vec3 point(float(random(-3, 3)), float(random(-3, 3)), i % 2 ? 0.f : float(random(-1, 1)));
        CAPTURE(i, point.x, point.y, point.z);
        REQUIRE(convex.nearest(point, 10).distance == Approx(test::distance(quad, glm::dvec3(point))).margin(3e-4));
        const glm::vec3 way(float(random(-1, 1)), float(random(-1, 1)), float(random(-3, 3)));
        if (const auto entry = convex.castPoint(point, way, 1e-3f))
            REQUIRE(test::distance(quad, glm::dvec3(point + entry->fraction * way)) < 1.4e-3);
    }
}

TEST_CASE("A basis that scales gives the pose of a unit quaternion") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int i = 0; i < 100; ++i) {
        const btQuaternion rotation(toBullet(random.direction()), float(random(0, 3)));
        const btMatrix3x3 basis(rotation);
        const float scale = float(random(0.5, 2));
        const Pose plain = toPose(btTransform(basis)),
                   scaled = toPose(btTransform(basis.scaled(btVector3(scale, scale, scale))));
        CHECK(glm::length(plain.rotation) == Approx(1).epsilon(1e-6));
        CHECK(glm::length(scaled.rotation) == Approx(1).epsilon(1e-3));
    }
}
}  // namespace bilayer::convex_test
