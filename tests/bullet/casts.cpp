// Casts against a field give the results of Bullet's own triangle mesh: rays, shape sweeps, contact tests, and Bullet's
// CCD of fast bodies.
#include <BulletCollision/CollisionShapes/btMultiSphereShape.h>
#include <BulletCollision/NarrowPhaseCollision/btRaycastCallback.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <limits>
#include <random>

#include <bilayer/collider/contact.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/vdb_io.h>
#include "collider/contact/collider_data.h"
#include "demos/shared/shapes.h"
#include "integration/bullet/detail/convert.h"
#include "tests/support/support.h"
#include "world.h"

using namespace bilayer;
using namespace bilayer::detail;
using namespace bilayer::bullet::detail;
using namespace bilayer::test;
using bullet::Shape;
using bullet::detail::toBullet;

namespace {

constexpr float voxel = 0.05f;  // at scale 1 [m]
// Bullet stops a shape this far before contact, at any scale [m].
constexpr float stopsBefore = 1e-3f;

Mesh scaled(Mesh mesh, float scale) {
    for (glm::vec3& point : mesh.points) point *= scale;
    return mesh;
}

// The same body twice, as a field and as triangles, each in its own world.
struct Twins {
    /// @param scaledByBullet  scale the field by Bullet instead of its mesh
    /// @param itsScale        of the triangles
    Twins(const Mesh& mesh, float scale, bool scaledByBullet, float itsScale)
        : field(std::make_shared<Collider>(scaledByBullet ? mesh : scaled(mesh, scale),
                                           build(scaledByBullet ? mesh : scaled(mesh, scale),
                                                 {.voxelSize = scaledByBullet ? voxel : scale * voxel}))),
          triangles(scaled(mesh, itsScale)) {
        triangles.shape->setMargin(0);
        if (scaledByBullet) field.setLocalScaling({scale, scale, scale});
        const btVector3 place(0.3f, -0.2f, 0.1f);
        const btQuaternion turn(btVector3(1, 2, 3).normalized(), 0.8f);
        ofField.add(field, 0, scale * place, turn);
        ofTriangles.add(*triangles.shape, 0, itsScale * place, turn);
    }
    Shape field;
    TriangleShape triangles;
    World ofField, ofTriangles;
};

Mesh bodyOf(int kind) {
    if (kind == 0) return shapes::box({0.5f, 0.4f, 0.3f}, 3);
    return kind == 1 ? shapes::torusKnot(2, 3, 0.5f, 0.12f, 160, 16) : shapes::torus(0.5f, 0.2f);
}

class Directions {
  public:
    explicit Directions(unsigned seed) : random_(seed) {}
    float part() { return part_(random_); }
    btVector3 vector() { return {part(), part(), part()}; }
    btQuaternion turn() { return btQuaternion(part(), part(), part(), part() + 0.01f).normalized(); }
    /// From somewhere outside a ball to a place in it, and beyond.
    std::pair<btVector3, btVector3> way(float scale) {
        const btVector3 through = 0.6f * scale * vector(), from = 2 * scale * vector().normalized();
        return {from, from + 1.8f * (through - from)};
    }

  private:
    std::mt19937 random_;
    std::uniform_real_distribution<float> part_{-1, 1};
};

// Sets the sizes minus the margin, which Bullet itself rounds differently at each scale.
void setSize(btConvexInternalShape& shape, float s, const btVector3& halfExtents, float margin) {
    shape.setMargin(s * margin);
    shape.setImplicitShapeDimensions(s * (halfExtents - btVector3(margin, margin, margin)));
}

std::unique_ptr<btConvexShape> shapeOf(int kind, float s) {
    switch (kind) {
        case 0:
            return std::make_unique<btSphereShape>(0.12f * s);
        case 1: {
            // Bullet rounds the shape off by this
            const btVector3 halfExtents(0.1f, 0.15f, 0.2f);
            auto box = std::make_unique<btBoxShape>(s * halfExtents);
            setSize(*box, s, halfExtents, 0.005f);
            return box;
        }
        case 2:
            return std::make_unique<btCapsuleShape>(0.08f * s, 0.3f * s);
        case 3: {
            const btVector3 halfExtents(0.1f, 0.2f, 0.1f);
            auto cylinder = std::make_unique<btCylinderShape>(s * halfExtents);
            setSize(*cylinder, s, halfExtents, 0.005f);
            return cylinder;
        }
        case 4: {
            auto cone = std::make_unique<btConeShape>(0.12f * s, 0.3f * s);
            cone->setMargin(0.01f * s);
            return cone;
        }
        case 5: {
            auto hull = std::make_unique<btConvexHullShape>();
            for (const glm::vec3& point : shapes::sphere(0.15f * s, 1).points) hull->addPoint(toBullet(point));
            hull->setMargin(0.01f * s);
            return hull;
        }
        default: {
            const btVector3 centres[] = {{-0.1f * s, 0, 0}, {0.1f * s, 0, 0}};
            const float radii[] = {0.1f * s, 0.06f * s};
            auto spheres = std::make_unique<btMultiSphereShape>(centres, radii, 2);
            spheres->setMargin(0.05f * s);
            return spheres;
        }
    }
}

// The first contact of a sphere along its displacement, over all triangles, in double precision. Bisects a brute-force
// distance that decreases until contact.
double firstTouch(const Mesh& mesh, const glm::dvec3& from, const glm::dvec3& to, double radius) {
    double along = 0;
    const double length = glm::distance(from, to);
    for (int i = 0; i < 100000 && along <= length; ++i) {
        const double gap = distance(mesh, from + along / length * (to - from)) - radius;
        if (gap < 1e-9 * length) return along / length;
        along += gap;
    }
    return 2;
}

// The first hit of a ray over all triangles, in double precision (Moller and Trumbore 1997), as a fraction of the
// displacement; 1 if there is none. Triangles are grown by a fraction of their sides.
double firstHit(const Mesh& mesh, const glm::dvec3& from, const glm::dvec3& to, bool oneSided, double grown) {
    double first = 1;
    const glm::dvec3 way = to - from;
    for (const glm::uvec3& t : mesh.triangles) {
        const glm::dvec3 a = mesh.points[t.x], u = glm::dvec3(mesh.points[t.y]) - a,
                         v = glm::dvec3(mesh.points[t.z]) - a;
        const glm::dvec3 p = glm::cross(way, v), q = glm::cross(from - a, u);
        const double volume = glm::dot(u, p);
        if (oneSided ? volume <= 0 : volume == 0) continue;
        const double alongU = glm::dot(from - a, p) / volume, alongV = glm::dot(way, q) / volume;
        if (alongU < -grown || alongV < -grown || alongU + alongV > 1 + grown) continue;
        if (const double part = glm::dot(v, q) / volume; part >= 0) first = std::min(first, part);
    }
    return first;
}

// The distance from the first body of a world to a shape, by a contact test.
float distanceOf(btCollisionShape& shape, const btTransform& place, World& world) {
    btCollisionObject object;
    object.setCollisionShape(&shape);
    object.setWorldTransform(place);
    Nearest nearest;
    nearest.m_closestDistanceThreshold = 0.1f;
    world.dynamics.contactPairTest(world.dynamics.getCollisionObjectArray()[0], &object, nearest);
    return nearest.distance;
}

}  // namespace

TEST_CASE("Rays meet a field where they meet its triangles") {
    const int kind = GENERATE(0, 1);
    const float scale = GENERATE(0.01f, 1.f, 100.f);
    const bool scaledByBullet = GENERATE(false, true);
    const unsigned start = seed();
    CAPTURE(kind, scale, scaledByBullet, start);
    const Mesh mesh = scaled(bodyOf(kind), scale);
    Twins twins(bodyOf(kind), scale, scaledByBullet, scale);
    Directions random(start);
    int hits = 0, turned = 0;
    for (int i = 0; i < 300; ++i) {
        const auto [from, to] = random.way(scale);
        btCollisionWorld::ClosestRayResultCallback ray(from, to), expected(from, to);
        const bool oneSided = i % 3 == 0;
        if (oneSided) ray.m_flags = expected.m_flags = btTriangleRaycastCallback::kF_FilterBackfaces;
        // every fifth starts inside
        const btVector3 begin = i % 5 ? from : 0.5f * (from + to);
        twins.ofField.dynamics.rayTest(begin, to, ray);
        twins.ofTriangles.dynamics.rayTest(begin, to, expected);
        CAPTURE(i, ray.m_closestHitFraction, expected.m_closestHitFraction);
        // rays that pass the outline of the mesh within rounding may hit or miss; Bullet grows its triangles
        const btTransform body = twins.ofField.dynamics.getCollisionObjectArray()[0]->getWorldTransform();
        const auto exact = [&, to = to](double grown) {
            return firstHit(mesh, glm::dvec3(bullet::detail::toGlm(body.invXform(begin))),
                            glm::dvec3(bullet::detail::toGlm(body.invXform(to))), oneSided, grown);
        };
        CHECK(ray.m_closestHitFraction > exact(1e-5) - 1e-5);
        CHECK(ray.m_closestHitFraction < exact(-1e-5) + 1e-5);
        CHECK(expected.m_closestHitFraction > exact(1e-3) - 1e-4);
        CHECK(expected.m_closestHitFraction < exact(-1e-3) + 1e-4);
        if (!ray.hasHit() || !expected.hasHit()) continue;
        ++hits;
        turned += ray.m_hitNormalWorld.dot(expected.m_hitNormalWorld) < 0.999f;
    }
    CHECK(hits > 100);
    // on an edge the normal of either triangle is valid
    CHECK(turned <= hits / 50);
}

TEST_CASE("Shapes of all kinds on their way meet a field as they meet its triangles") {
    const int kind = GENERATE(range(0, 7));
    // powers of two: all values of Bullet's search are rounded alike
    const float scale = GENERATE(1.f / 128, 1.f, 128.f);
    const bool scaledByBullet = GENERATE(false, true);
    const unsigned start = seed();
    CAPTURE(kind, scale, scaledByBullet, start);
    // Bullet's own search is inaccurate for small bodies; its result at the scale of 1 m is the reference at any scale
    Twins twins(bodyOf(kind % 2), scale, scaledByBullet, 1);
    const auto shape = shapeOf(kind, scale), itsShape = shapeOf(kind, 1);
    Directions random(start);
    int hits = 0, turned = 0;
    for (int i = 0; i < 60; ++i) {
        const auto [itsFrom, itsTo] = random.way(1);
        const btVector3 from = scale * itsFrom, to = scale * itsTo;
        const btTransform turn(random.turn());
        const auto at = [&](const btVector3& place) { return btTransform(turn.getBasis(), place); };
        btCollisionWorld::ClosestConvexResultCallback sweep(from, to), expected(itsFrom, itsTo);
        twins.ofField.dynamics.convexSweepTest(shape.get(), at(from), at(to), sweep);
        twins.ofTriangles.dynamics.convexSweepTest(itsShape.get(), at(itsFrom), at(itsTo), expected);
        CAPTURE(i, sweep.m_closestHitFraction, expected.m_closestHitFraction);
        if (kind == 0) {
            // spheres are exact; Bullet's own search stops a millimetre early, or where it does not converge
            const btTransform body = twins.ofField.dynamics.getCollisionObjectArray()[0]->getWorldTransform();
            const double exact =
                firstTouch(scaled(bodyOf(kind % 2), scale), glm::dvec3(bullet::detail::toGlm(body.invXform(from))),
                           glm::dvec3(bullet::detail::toGlm(body.invXform(to))), 0.12 * double(scale));
            if (std::abs(exact - 1) < 1e-4) continue;
            REQUIRE(sweep.hasHit() == (exact <= 1));
            if (!sweep.hasHit()) continue;
            ++hits;
            CHECK(sweep.m_closestHitFraction == Approx(exact).margin(1e-4));
        } else {
            // Either search ends within a millimetre of contact, at the scale of 1. They may differ by more, for
            // example where a shape grazes the surface. Then ours must be as near to the triangles, and must not have
            // penetrated them after Bullet's hit.
            const float ours = sweep.hasHit() ? sweep.m_closestHitFraction : 1;
            const float bullets = expected.hasHit() ? expected.m_closestHitFraction : 1;
            const float apart = itsFrom.distance(itsTo) * (ours - bullets);
            if (!sweep.hasHit() && !expected.hasHit()) continue;
            if (sweep.hasHit() && expected.hasHit()) {
                ++hits;
                turned += sweep.m_hitNormalWorld.dot(expected.m_hitNormalWorld) < 0.99f;
                const float down = -expected.m_hitNormalWorld.dot((itsTo - itsFrom).normalized());
                if (std::abs(apart) * std::max(down, 0.05f) < stopsBefore) continue;
            }
            const auto gapAt = [&, itsFrom = itsFrom, itsTo = itsTo](float fraction) {
                return distanceOf(*itsShape, at(itsFrom.lerp(itsTo, fraction)), twins.ofTriangles);
            };
            if (sweep.hasHit()) CHECK(gapAt(ours) < stopsBefore);
            if (ours <= bullets) continue;
            for (const float part : {0.f, 0.25f, 0.5f, 0.75f, 1.f})
                CHECK(gapAt(bullets + part * (ours - bullets)) > -stopsBefore / 10);
        }
    }
    CHECK(hits > 15);
    // where a shape touches two triangles at once, their order determines which normal Bullet returns
    CHECK(turned <= hits / 20);
}

TEST_CASE("A body from a file answers casts and contact tests as the one of its mesh, to the bit") {
    const int kind = GENERATE(range(0, 7));
    const unsigned start = seed();
    CAPTURE(kind, start);
    const Mesh mesh = bodyOf(kind % 2);
    const LevelSet field = build(mesh, {.voxelSize = voxel});
    const auto path = scratch("casts.vdb");
    const auto made = std::make_shared<Collider>(mesh, field);
    writeVdb(path, withBody(field, made->data().body));
    Shape ofMesh(made), ofFile(std::make_shared<Collider>(readVdb(path)));
    World meshes, files;
    meshes.add(ofMesh, 0, {0, 0, 0});
    files.add(ofFile, 0, {0, 0, 0});
    const auto shape = shapeOf(kind, 1);
    Directions random(start);
    int hits = 0, touches = 0;
    for (int i = 0; i < 60; ++i) {
        const auto [from, to] = random.way(1);
        const btTransform begin(random.turn(), from), end(begin.getBasis(), to),
            near(random.turn(), 0.8f * random.vector());
        const auto ask = [&, from = from, to = to](World& world) {
            btCollisionWorld::ClosestRayResultCallback ray(from, to);
            world.dynamics.rayTest(from, to, ray);
            btCollisionWorld::ClosestConvexResultCallback sweep(from, to);
            world.dynamics.convexSweepTest(shape.get(), begin, end, sweep);
            return std::array{ray.m_closestHitFraction, sweep.m_closestHitFraction, distanceOf(*shape, near, world)};
        };
        const auto expected = ask(meshes);
        CAPTURE(i);
        REQUIRE(ask(files) == expected);
        hits += expected[0] < 1 && expected[1] < 1;
        touches += expected[2] < 1;
    }
    CHECK(hits > 10);
    CHECK(touches > 0);
}

TEST_CASE("A shape that turns on its way meets what lies beside its last rotation") {
    Twins twins(bodyOf(0), 1, false, 1);
    const btBoxShape plank({0.02f, 0.02f, 0.9f});
    // upright at the end, horizontal in between
    const btVector3 from(0.3f, 0.75f, 1.5f), to(0.3f, 0.75f, -1.5f);
    const btTransform first(btQuaternion({1, 0, 0}, SIMD_HALF_PI), from), last(btQuaternion({1, 0, 0}, 0), to);
    btCollisionWorld::ClosestConvexResultCallback sweep(from, to);
    twins.ofField.dynamics.convexSweepTest(&plank, first, last, sweep);
    CHECK(sweep.hasHit());
}

TEST_CASE("Fast bodies that Bullet follows itself stop at a field as at its triangles") {
    const float speed = GENERATE(20.f, 100.f, 500.f);
    const bool isBox = GENERATE(false, true);
    CAPTURE(speed, isBox);
    const Mesh plate = shapes::box({1, 1, 0.1f});
    const auto play = [&](bool asField) {
        Shape field(std::make_shared<Collider>(plate, build(plate, {.voxelSize = voxel})), {.speculative = false});
        const TriangleShape triangles(plate);
        triangles.shape->setMargin(0);
        World world;
        world.add(asField ? static_cast<btCollisionShape&>(field) : *triangles.shape, 0, {0, 0, 0});
        btSphereShape ball(0.1f);
        btBoxShape box({0.1f, 0.1f, 0.1f});
        btRigidBody* body = world.add(isBox ? static_cast<btCollisionShape&>(box) : ball, 1, {0.2f, 0.1f, 2});
        body->setLinearVelocity({0, 0, -speed});
        body->setCcdMotionThreshold(0.05f);
        body->setCcdSweptSphereRadius(0.08f);
        float lowest = 2;
        for (int i = 0; i < 60; ++i) {
            world.dynamics.stepSimulation(1.f / 60, 1, 1.f / 60);
            lowest = std::min(lowest, float(body->getWorldTransform().getOrigin().z()));
        }
        return std::pair(lowest, float(body->getWorldTransform().getOrigin().z()));
    };
    const auto [lowest, last] = play(true);
    const auto [expectedLowest, expectedLast] = play(false);
    CAPTURE(lowest, last, expectedLowest, expectedLast);
    CHECK(lowest > 0.1f);
    CHECK(last == Approx(expectedLast).margin(0.1 * voxel + stopsBefore));
}

namespace {

// The minimum of a convex function between two places, by golden-section search.
double minBetween(const glm::dvec3& from, const glm::dvec3& to,
                  const std::function<double(const glm::dvec3&)>& function) {
    constexpr double golden = 0.6180339887498949;
    const auto at = [&](double part) { return function(glm::mix(from, to, part)); };
    double lower = 0, upper = 1, left = 1 - golden, right = golden, onLeft = at(left), onRight = at(right);
    for (int i = 0; i < 24; ++i)
        if (onLeft < onRight) {
            upper = right, right = left, onRight = onLeft;
            onLeft = at(left = upper - golden * (upper - lower));
        } else {
            lower = left, left = right, onLeft = onRight;
            onRight = at(right = lower + golden * (upper - lower));
        }
    return std::min({at(0), at(1), onLeft, onRight});
}

// Distance from a point to the box of shapeOf(1, 1), whose corners Bullet rounds off.
double fromBox(const glm::dvec3& p) {
    const glm::dvec3 beyond = glm::abs(p) - glm::dvec3(0.1, 0.15, 0.2);
    return glm::length(glm::max(beyond, 0.)) + std::min(std::max({beyond.x, beyond.y, beyond.z}), 0.);
}

// Distance from a point to the cylinder of shapeOf(3, 1).
double fromCylinder(const glm::dvec3& p) {
    const glm::dvec2 beyond(std::hypot(p.x, p.z) - 0.1, std::abs(p.y) - 0.2);
    return glm::length(glm::max(beyond, 0.)) + std::min(std::max(beyond.x, beyond.y), 0.);
}

// Distance from a point to the cone of shapeOf(4, 1), which its margin rounds off.
double fromCone(const glm::dvec3& p) {
    const glm::dvec2 at(std::hypot(p.x, p.z), p.y), apex(0, 0.15), rim(0.12, -0.15), side = rim - apex;
    const double part = std::clamp(glm::dot(at - apex, side) / glm::dot(side, side), 0., 1.);
    const double toSide = glm::distance(at, apex + part * side), above = -0.15 - at.y,
                 beyond = (side.x * (at.y - apex.y) - side.y * (at.x - apex.x)) / glm::length(side);
    const bool isInside = above <= 0 && beyond <= 0;
    const double toBase = std::hypot(std::max(at.x - rim.x, 0.), above);
    return (isInside ? std::max(above, beyond) : std::min(toSide, toBase)) - 0.01;
}

// Distance between triangles and a convex solid, in the solid's coordinates. Bullet's own search rounds off a
// cylinder's rims, and stops up to 0.1 voxels before it has found the nearest place of a triangle.
double distanceTo(const Mesh& mesh, double ofPoint(const glm::dvec3&)) {
    double least = std::numeric_limits<double>::max();
    for (const glm::uvec3& t : mesh.triangles) {
        const glm::dvec3 a = mesh.points[t.x], b = mesh.points[t.y], c = mesh.points[t.z];
        if (ofPoint(a) - std::max(glm::distance(a, b), glm::distance(a, c)) >= least) continue;
        const auto ofLine = [&](const glm::dvec3& p) { return minBetween(a, p, ofPoint); };
        least = std::min(least, minBetween(b, c, ofLine));
    }
    return least;
}

}  // namespace

TEST_CASE("Contact tests tell the distance that the triangles have") {
    const int kind = GENERATE(range(0, 7));
    const float scale = GENERATE(0.01f, 1.f, 100.f);
    // with the first two seeds, the nearest places lie between surface points that are outside the margin
    const unsigned start = GENERATE(28u, 116239924u, seed());
    CAPTURE(kind, scale, start);
    Twins twins(bodyOf(kind % 2 ? 2 : 0), scale, false, 1);
    // a ring of four voxels' radius: for thinner ones the interpolation error reaches 0.1 voxels
    const Mesh mesh = bodyOf(kind % 2 ? 2 : 0);
    const auto shape = shapeOf(kind, scale), itsShape = shapeOf(kind, 1);
    Directions random(start);
    btRigidBody* ofField = twins.ofField.add(*shape, 1, {0, 0, 0});
    btRigidBody* ofTriangles = twins.ofTriangles.add(*itsShape, 1, {0, 0, 0});
    int found = 0;
    const float most = 0.1f;
    for (int i = 0; i < 100; ++i) {
        const btTransform turn(random.turn());
        const btVector3 place = 0.9f * random.vector() + btVector3(0.3f, -0.2f, 0.1f);
        const auto ask = [&](World& world, btRigidBody* body, float factor) {
            body->setWorldTransform(btTransform(turn.getBasis(), factor * place));
            Nearest nearest;
            nearest.m_closestDistanceThreshold = factor * most;
            world.dynamics.contactPairTest(world.dynamics.getCollisionObjectArray()[0], body, nearest);
            return nearest.distance / factor;
        };
        // triangles give no penetration depth of a solid
        const auto body = twins.ofTriangles.dynamics.getCollisionObjectArray()[0]->getWorldTransform();
        const float distance = ask(twins.ofField, ofField, scale), byBullet = ask(twins.ofTriangles, ofTriangles, 1);
        Mesh seen = mesh;
        for (glm::vec3& p : seen.points)
            p = bullet::detail::toGlm(btTransform(turn.getBasis(), place).inverse() * (body * toBullet(p)));
        const float expected = kind == 1   ? float(distanceTo(seen, fromBox))
                               : kind == 3 ? float(distanceTo(seen, fromCylinder))
                               : kind == 4 ? float(distanceTo(seen, fromCone))
                                           : byBullet;
        CAPTURE(i, distance / voxel, expected / voxel, byBullet / voxel);
        if (windingNumber(mesh, glm::dvec3(bullet::detail::toGlm(body.invXform(place)))) > 0.5) continue;
        if (expected < 0.1f * voxel || expected > 0.9f * most) continue;
        ++found;
        CHECK(distance == Approx(expected).margin(0.1 * double(voxel)));
    }
    CHECK(found > 0);
}
