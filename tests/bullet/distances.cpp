// SPDX-License-Identifier: Apache-2.0
// Contact tests between a field and concave shapes: they return the distance between two meshes, compared with brute
// force in double precision.
#include <BulletCollision/CollisionShapes/btHeightfieldTerrainShape.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include <bilayer/sdf/build.h>
#include "demos/shared/shapes.h"
#include "integration/bullet/detail/convert.h"
#include "tests/bullet/world.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::distances_test {
using namespace bilayer::detail;
using namespace bilayer::bullet::detail;
using namespace bilayer::test;
using bullet::Shape;

namespace {

constexpr float voxel = 0.02f;
constexpr float asked = 5 * voxel;  // distance threshold of contact tests
constexpr double error = 0.1 * double(voxel);

struct Triangle {
    std::array<glm::dvec3, 3> corners;
    glm::dvec3 middle;
    double radius;

    explicit Triangle(const std::array<glm::dvec3, 3>& c) : corners(c), middle((c[0] + c[1] + c[2]) / 3.), radius(0) {
        for (const glm::dvec3& corner : corners) radius = std::max(radius, glm::distance(corner, middle));
    }
};

glm::dvec3 toDouble(const btVector3& v) {
    return {v.x(), v.y(), v.z()};
}

std::vector<Triangle> trianglesOf(const Mesh& mesh, const btTransform& place) {
    std::vector<Triangle> triangles;
    const auto at = [&](unsigned i) { return toDouble(place * bullet::detail::toBullet(mesh.points[i])); };
    for (const glm::uvec3& t : mesh.triangles) triangles.push_back(Triangle({at(t.x), at(t.y), at(t.z)}));
    return triangles;
}

std::vector<Triangle> trianglesOf(const btConcaveShape& shape, const btTransform& place) {
    struct Collector : btTriangleCallback {
        void processTriangle(btVector3* t, int, int) override {
            triangles.push_back(Triangle({toDouble(place * t[0]), toDouble(place * t[1]), toDouble(place * t[2])}));
        }
        btTransform place;
        std::vector<Triangle> triangles;
    } collector;
    collector.place = place;
    const btVector3 all(1e4f, 1e4f, 1e4f);
    shape.processAllTriangles(&collector, -all, all);
    return collector.triangles;
}

// Distance of two line segments (C. Ericson, "Real-Time Collision Detection", 2004, 5.1.9).
double distanceBetween(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, const glm::dvec3& d) {
    const glm::dvec3 ab = b - a, cd = d - c, ca = a - c;
    const double abab = glm::dot(ab, ab), cdcd = glm::dot(cd, cd), abcd = glm::dot(ab, cd), abca = glm::dot(ab, ca),
                 cdca = glm::dot(cd, ca), square = abab * cdcd - abcd * abcd;
    const double first = square > 0 ? std::clamp((abcd * cdca - abca * cdcd) / square, 0., 1.) : 0;
    const double second = std::clamp((abcd * first + cdca) / cdcd, 0., 1.);
    const double best = std::clamp((abcd * second - abca) / abab, 0., 1.);
    return glm::distance(a + best * ab, c + second * cd);
}

double distanceBetween(const Triangle& a, const Triangle& b, double best) {
    if (glm::distance(a.middle, b.middle) - a.radius - b.radius > best) return best;
    const auto &p = a.corners, &q = b.corners;
    for (int i = 0; i < 3; ++i) {
        best = std::min({best, std::sqrt(squaredDistance(p[i], q[0], q[1], q[2])),
                         std::sqrt(squaredDistance(q[i], p[0], p[1], p[2]))});
        for (int k = 0; k < 3; ++k) best = std::min(best, distanceBetween(p[i], p[(i + 1) % 3], q[k], q[(k + 1) % 3]));
    }
    return best;
}

// Whether an edge of A intersects B.
bool crosses(const Triangle& a, const Triangle& b) {
    const auto& q = b.corners;
    const glm::dvec3 normal = glm::cross(q[1] - q[0], q[2] - q[0]);
    for (int i = 0; i < 3; ++i) {
        const glm::dvec3 &from = a.corners[i], &to = a.corners[(i + 1) % 3];
        const double before = glm::dot(normal, from - q[0]), after = glm::dot(normal, to - q[0]);
        if (before * after >= 0) continue;
        const glm::dvec3 place = from + before / (before - after) * (to - from);
        bool isBeside = false;
        for (int k = 0; k < 3; ++k) isBeside |= glm::dot(glm::cross(q[(k + 1) % 3] - q[k], place - q[k]), normal) < 0;
        if (!isBeside) return true;
    }
    return false;
}

// The distance up to a bound; nothing if they intersect.
std::optional<double> distanceBetween(const std::vector<Triangle>& a, const std::vector<Triangle>& b, double bound) {
    double best = bound;
    for (const Triangle& one : a)
        for (const Triangle& other : b) {
            best = distanceBetween(one, other, best);
            const bool meet = glm::distance(one.middle, other.middle) < one.radius + other.radius;
            if (meet && (crosses(one, other) || crosses(other, one))) return std::nullopt;
        }
    return best;
}

Mesh bodyOf(int kind) {
    switch (kind) {
        case 0:
            return shapes::box({0.3f, 0.2f, 0.1f});
        case 1:
            return shapes::cone(0.3f, 0.4f, 24);
        case 2:
            return shapes::cylinder(0.2f, 0.5f, 24);
        default:
            return shapes::bowl(0.35f, 0.1f, 24);
    }
}

Mesh ring() {
    return shapes::torus(0.3f, 0.12f, 16, 10);
}

std::shared_ptr<const Collider> colliderOf(const Mesh& mesh, ContactAccuracy accuracy) {
    return std::make_shared<Collider>(mesh, build(mesh, {.voxelSize = voxel}), ColliderOptions{.accuracy = accuracy});
}

// The other shape of a query, and its triangles.
class Other {
  public:
    Other(int kind, Random& random, ContactAccuracy accuracy)
        : triangles_(ring()), field_(colliderOf(ring(), accuracy)) {
        for (float& height : heights_) height = float(random(-0.1, 0.1));
        terrain_ = std::make_unique<btHeightfieldTerrainShape>(side, side, heights_.data(), 1, -0.1f, 0.1f, 2,
                                                               PHY_FLOAT, false);
        terrain_->setLocalScaling({0.1f, 0.1f, 1});
        const btTransform inCompound(btQuaternion({1, 2, 0}, 0.7f), {0.2f, 0.1f, -0.3f});
        compound_.addChildShape(inCompound, &field_);
        switch (kind) {
            case 0:
                shape = triangles_.shape.get();
                break;
            case 1:
                shape = terrain_.get();
                break;
            case 2:
                shape = &field_;
                break;
            default:
                shape = &compound_;
                place = inCompound;
        }
    }

    std::vector<Triangle> trianglesAt(const btTransform& body) const {
        if (shape == triangles_.shape.get() || shape == terrain_.get())
            return trianglesOf(static_cast<const btConcaveShape&>(*shape), body);
        return trianglesOf(field_.collider().mesh(), body * place);
    }

    btCollisionShape* shape;
    btTransform place{btTransform::getIdentity()};  // of the ring, in a compound

  private:
    static constexpr int side = 17;
    std::array<float, std::size_t(side* side)> heights_{};
    TriangleShape triangles_;
    Shape field_;
    std::unique_ptr<btHeightfieldTerrainShape> terrain_;
    btCompoundShape compound_;
};

btTransform anywhere(Random& random, double reach) {
    const glm::vec3 axis(random.direction()), place(random.point(reach));
    return btTransform(btQuaternion(bullet::detail::toBullet(axis), float(random(0, 6.28))),
                       bullet::detail::toBullet(place));
}

// Compares the distances of contact tests with those of the triangles, at random poses.
void compareDistances(int kind, int other, ContactAccuracy accuracy, unsigned start) {
    CAPTURE(kind, other, nameOf(accuracy), start);
    Random random(start);
    const Mesh mesh = bodyOf(kind);
    Shape field(colliderOf(mesh, accuracy));
    const Other it(other, random, accuracy);
    World world;
    btCollisionObject a, b;
    a.setCollisionShape(&field);
    b.setCollisionShape(it.shape);
    int found = 0;
    for (int i = 0; i < 60; ++i) {
        a.setWorldTransform(anywhere(random, 0.6));
        b.setWorldTransform(anywhere(random, 0.1));
        const auto expected =
            distanceBetween(trianglesOf(mesh, a.getWorldTransform()), it.trianglesAt(b.getWorldTransform()), 1);
        if (!expected || *expected > 0.95 * double(asked)) continue;
        ++found;
        Nearest nearest;
        nearest.m_closestDistanceThreshold = asked;
        world.dynamics.contactPairTest(i % 2 ? &a : &b, i % 2 ? &b : &a, nearest);
        CAPTURE(i, nearest.distance / double(voxel), *expected / double(voxel));
        CHECK(nearest.distance == Approx(*expected).margin(error));
    }
    CHECK(found > 0);
}

}  // namespace

TEST_CASE("Contact tests between concave bodies return the distance of their meshes") {
    const int kind = GENERATE(range(0, 4)), other = GENERATE(range(0, 4));
    const ContactAccuracy accuracy =
        GENERATE(ContactAccuracy::samples, ContactAccuracy::exactNearFeatures, ContactAccuracy::exact);
    compareDistances(kind, other, accuracy, seed());
}

TEST_CASE("Contact tests return the distance of meshes, not of edges between surface points, which lie over them") {
    // among these poses, an edge of the ring crosses one of the cylinder where it lies 0.13 voxels over the ring
    compareDistances(2, 3, ContactAccuracy::samples, 2780991757);
}

TEST_CASE("Contact tests that ask for no distance accuracy the depth by the triangles, in a groove") {
    const unsigned start = seed();
    CAPTURE(start);
    Random random(start);
    const Mesh pulley = shapes::revolve({{0, -0.3f}, {0.4f, -0.15f}, {0.25f, 0}, {0.4f, 0.15f}, {0, 0.3f}}, 48);
    Shape field(colliderOf(pulley, ContactAccuracy::samples));
    const float radius = 0.4f * voxel;  // between surface points
    btSphereShape ball(radius);
    World world;
    btCollisionObject a, b;
    a.setCollisionShape(&field);
    b.setCollisionShape(&ball);
    int found = 0;
    for (int i = 0; i < 200; ++i) {
        const double angle = random(0, 6.28), around = 0.25 + random(0.1, 0.5) * double(voxel);
        const glm::dvec3 place(around * std::cos(angle), around * std::sin(angle), random(-0.1, 0.1) * double(voxel));
        const double expected = distance(pulley, place) - double(radius);
        if (expected > -0.05 * double(voxel)) continue;
        ++found;
        b.setWorldTransform(btTransform(btQuaternion::getIdentity(), bullet::detail::toBullet(glm::vec3(place))));
        Nearest nearest;
        world.dynamics.contactPairTest(&a, &b, nearest);
        CAPTURE(i, nearest.distance / double(voxel), expected / double(voxel));
        CHECK(nearest.distance == Approx(expected).margin(0.02 * double(voxel)));
    }
    CHECK(found > 20);
}

TEST_CASE("Contact tests return the distance of round bodies that nearly touch each other or a plane") {
    const float radius = GENERATE(2.f, 3.f, 5.f, 9.f) * voxel;
    const float gap = GENERATE(0.5f, 0.1f, 0.001f) * voxel;
    const bool overPlane = GENERATE(false, true);
    const ContactAccuracy accuracy =
        GENERATE(ContactAccuracy::samples, ContactAccuracy::exactNearFeatures, ContactAccuracy::exact);
    const unsigned start = seed();
    CAPTURE(radius / voxel, gap / voxel, overPlane, nameOf(accuracy), start);
    Random random(start);
    const Mesh ball = shapes::sphere(radius, 4);
    Shape field(colliderOf(ball, accuracy));
    btStaticPlaneShape plane({0, 0, 1}, 0);
    World world;
    btCollisionObject a, b;
    a.setCollisionShape(&field);
    b.setCollisionShape(overPlane ? static_cast<btCollisionShape*>(&plane) : &field);
    for (int i = 0; i < 30; ++i) {
        const glm::vec3 way = overPlane ? glm::vec3(0, 0, 1) : random.direction();
        a.setWorldTransform(anywhere(random, 0));
        if (!overPlane) b.setWorldTransform(anywhere(random, 0));
        a.getWorldTransform().setOrigin(bullet::detail::toBullet((gap + (overPlane ? radius : 2 * radius)) * way));
        Nearest nearest;
        nearest.m_closestDistanceThreshold = 3 * voxel;
        world.dynamics.contactPairTest(&a, &b, nearest);
        CAPTURE(i, nearest.distance / double(voxel));
        // the facets of either ball lie below its surface by 0.0013 of the radius
        CHECK(nearest.distance ==
              Approx(gap + 0.0013f * radius).margin(0.003 * double(radius) + 0.005 * double(voxel)));
    }
}
}  // namespace bilayer::distances_test
