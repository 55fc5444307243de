// Edge-edge contacts between vertices and between surface points of a field; the hull of balls; sharp edges of bodies.
#include <BulletCollision/CollisionShapes/btHeightfieldTerrainShape.h>
#include <BulletCollision/CollisionShapes/btMultiSphereShape.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <random>

#include <bilayer/collider/contact.h>
#include <bilayer/sdf/build.h>
#include "collider/contact/collider_data.h"
#include "collider/contact/edge_search.h"
#include "demos/shared/exact_distance.h"
#include "demos/shared/shapes.h"
#include "integration/bullet/detail/convert.h"
#include "integration/bullet/detail/convex.h"
#include "integration/bullet/detail/multisphere.h"
#include "integration/bullet/detail/narrow_phase.h"
#include "tests/support/support.h"
#include "world.h"

using namespace bilayer;
using namespace bilayer::detail;
using namespace bilayer::bullet::detail;
using namespace bilayer::test;
using bullet::Shape;
using bullet::detail::Convex;
using bullet::detail::MultisphereHull;

namespace {

constexpr float h = 0.05f;             // voxel [m]
constexpr double tolerance = 0.1 * h;  // of depths

std::shared_ptr<const Collider> colliderOf(const Mesh& mesh,
                                           ContactAccuracy measure = ContactAccuracy::exactNearFeatures) {
    return std::make_shared<Collider>(mesh, build(mesh, {.voxelSize = h, .interiorWidth = 6}),
                                      ColliderOptions{.accuracy = measure});
}

// Two long bars of square section, ridge on ridge. The lower bar is along y with its ridge up. The upper bar is at an
// angle to x with its ridge down. Both are displaced along their ridges and rotated together at random.
struct Crossing {
    Pose upper, lower;
    glm::vec3 normal;  // from the lower one to the upper one
    float gap;
};

constexpr float halfBar = 0.3f;
const glm::vec3 bar(1.4f, halfBar, halfBar);

Crossing crossingOf(std::mt19937& random, float gap) {
    std::uniform_real_distribution<float> part(-1, 1);
    const glm::quat ridge = glm::angleAxis(glm::quarter_pi<float>(), glm::vec3(1, 0, 0));
    const glm::quat square = glm::angleAxis(glm::half_pi<float>(), glm::vec3(0, 0, 1));
    const glm::quat askew = glm::angleAxis(0.6f * part(random), glm::vec3(0, 0, 1));
    const float height = std::sqrt(2.f) * halfBar;
    Pose lower{{0.3f * part(random), 0.3f * part(random), -height}, square * ridge};
    Pose upper{{0.3f * part(random), 0.3f * part(random), height + gap}, askew * ridge};
    const glm::quat turn = glm::normalize(glm::quat(part(random), part(random), part(random), part(random) + 0.1f));
    for (Pose* pose : {&lower, &upper}) *pose = {turn * pose->position, glm::normalize(turn * pose->rotation)};
    return {upper, lower, turn * glm::vec3(0, 0, 1), gap};
}

const Contact& deepest(const std::vector<Contact>& contacts) {
    REQUIRE_FALSE(contacts.empty());
    return *std::min_element(contacts.begin(), contacts.end(),
                             [](const Contact& a, const Contact& b) { return a.distance < b.distance; });
}

btTransform transformOf(const Pose& pose) {
    return btTransform(bullet::detail::toBullet(pose.rotation), bullet::detail::toBullet(pose.position));
}

using Collide = std::function<std::vector<Contact>(const Crossing&, float)>;

Collide collideBars(int kind, ContactAccuracy measure) {
    const auto field = colliderOf(shapes::box(bar), measure);
    if (kind == 0)
        return [=](const Crossing& c, float margin) {
            std::vector<Contact> contacts;
            ContactCache near;
            bullet::detail::collideFields({*field, c.upper}, {*field, c.lower}, margin, false, near, contacts);
            return contacts;
        };
    if (kind == 1 || kind == 2) {
        std::shared_ptr<btConvexShape> shape = std::make_shared<btBoxShape>(bullet::detail::toBullet(bar));
        if (kind == 2) {
            const auto hull = std::make_shared<btConvexHullShape>();
            for (const glm::vec3& point : shapes::box(bar).points) hull->addPoint(bullet::detail::toBullet(point));
            hull->setMargin(0);
            shape = hull;
        }
        return [=](const Crossing& c, float margin) {
            std::vector<Contact> contacts;
            bullet::detail::collideConvex(Convex(*shape), c.upper, {}, {*field, c.lower}, margin, false, contacts);
            return contacts;
        };
    }
    const auto triangles = std::make_shared<TriangleShape>(shapes::box(bar));
    return [=](const Crossing& c, float margin) {
        std::vector<Contact> contacts;
        bullet::detail::collideTriangles(*triangles->shape, transformOf(c.upper), {}, {*field, c.lower}, margin, false,
                                         contacts);
        return contacts;
    };
}

}  // namespace

TEST_CASE("Edges that cross touch where they cross, however their points lie") {
    const int kind = GENERATE(0, 1, 2, 3);
    const ContactAccuracy measure =
        GENERATE(ContactAccuracy::samples, ContactAccuracy::exactNearFeatures, ContactAccuracy::exact);
    const unsigned start = seed();
    CAPTURE(kind, nameOf(measure), start);
    const Collide collide = collideBars(kind, measure);
    std::mt19937 random(start);
    std::uniform_real_distribution<float> gaps(-0.6f * h, 0.4f * h);
    for (int i = 0; i < 200; ++i) {
        const Crossing crossing = crossingOf(random, gaps(random));
        const auto contacts = collide(crossing, h);
        const Contact& contact = deepest(contacts);
        CAPTURE(i, crossing.gap / h, contact.distance / h);
        CHECK(contact.distance == Approx(crossing.gap).margin(tolerance));
        CHECK(glm::dot(contact.normal, crossing.normal) > 0.99f);
    }
}

TEST_CASE("A plane of many triangles makes the contacts of a plane of two") {
    const unsigned start = seed();
    CAPTURE(start);
    const glm::vec3 halfSlab(1.6f, 1.6f, 0.3f);
    const Mesh knot = shapes::torusKnot(2, 3, 0.4f, 0.1f, 200, 16);
    const auto body = colliderOf(knot);
    const TriangleShape two(shapes::box(halfSlab)), many(shapes::box(halfSlab, 20));
    std::mt19937 random(start);
    std::uniform_real_distribution<float> part(-1, 1);
    int touching = 0;
    for (int i = 0; i < 100; ++i) {
        const bool overMiddle = i % 2;  // over the middle, else anywhere: over the rim, or next to it
        const float spread = overMiddle ? 0.4f : 2;
        Pose pose{{spread * part(random), spread * part(random), 0},
                  glm::normalize(glm::quat(part(random), part(random), part(random), part(random) + 0.1f))};
        float lowest = 1;
        for (const glm::vec3& point : knot.points) lowest = std::min(lowest, pose.toWorld(point).z);
        pose.position.z = halfSlab.z - lowest + 0.5f * h * part(random);
        const auto collide = [&](const TriangleShape& slab) {
            std::vector<Contact> contacts;
            bullet::detail::collideTriangles(*slab.shape, btTransform::getIdentity(), {}, {*body, pose}, h, false,
                                             contacts);
            return contacts;
        };
        const auto few = collide(two), others = collide(many);
        CAPTURE(i, few.size(), others.size());
        if (few.empty() || others.empty()) {
            // near the margin either search may find a slightly nearer place
            for (const auto& found : {few, others})
                if (!found.empty()) REQUIRE(deepest(found).distance > h - tolerance);
            continue;
        }
        ++touching;
        CHECK(deepest(others).distance == Approx(deepest(few).distance).margin(tolerance));
        // each surface piece at the rim is searched separately
        if (!overMiddle) continue;
        CHECK(others.size() <= few.size() + few.size() / 8);
        CHECK(others.size() >= few.size() - few.size() / 8);
    }
    CHECK(touching > 40);
}

TEST_CASE("A contact on an edge goes as evenly as the edge that slides") {
    const int kind = GENERATE(0, 1, 2, 3);
    const ContactAccuracy measure =
        GENERATE(ContactAccuracy::samples, ContactAccuracy::exactNearFeatures, ContactAccuracy::exact);
    const unsigned start = seed();
    CAPTURE(kind, nameOf(measure), start);
    const Collide collide = collideBars(kind, measure);
    std::mt19937 random(start);
    for (int run = 0; run < 10; ++run) {
        Crossing crossing = crossingOf(random, -0.2f * h);
        const glm::vec3 along = crossing.upper.rotation * glm::vec3(1, 0, 0);
        const glm::vec3 its = crossing.lower.rotation * glm::vec3(1, 0, 0);
        const float step = 0.02f * h;
        glm::vec3 before(0);
        for (int i = 0; i < 150; ++i) {
            // along both edges, obliquely
            crossing.upper.position += step * glm::normalize(along + 0.6f * its);
            const auto contacts = collide(crossing, h);
            const glm::vec3 place = deepest(contacts).position;
            CAPTURE(run, i, glm::distance(place, before) / h);
            if (i > 0) CHECK(glm::distance(place, before) < 2 * step + 0.05f * h);
            before = place;
        }
    }
}

TEST_CASE("An edge finds a bump between its probes, and stays on it") {
    // a small ball of three voxels' radius under the edge of a long box
    const float radius = 3 * h;
    static const auto ball = exactSphere(radius, h);
    const float side = std::sqrt(2.f) * halfBar;
    const glm::quat ridge = glm::angleAxis(glm::quarter_pi<float>(), glm::vec3(1, 0, 0));
    const btBoxShape box(bullet::detail::toBullet(bar));
    const Convex convex(box);
    float before = 0;
    for (int i = 0; i < 200; ++i) {
        const float way = 0.02f * h * float(i), gap = -0.1f * h;
        std::vector<Contact> contacts;
        bullet::detail::collideConvex(convex, {{0.3f + way, 0, radius + side + gap}, ridge}, {}, {*ball, {}}, h, false,
                                      contacts);
        const Contact& contact = deepest(contacts);
        CAPTURE(i, contact.distance / h);
        CHECK(contact.distance == Approx(gap).margin(tolerance));
        // gradients of the interpolant are off by up to h / (2 R) along either tangent
        CHECK(contact.normal.z > std::cos(h / radius));
        if (i > 0) CHECK(std::abs(contact.position.x - before) < 0.25f * h);
        before = contact.position.x;
    }
}

TEST_CASE("Contacts of solids of revolution are numbers, wherever a line of their sides ends") {
    const auto plate = exactBox({1.2f, 1.2f, 0.1f}, h);
    const Convex cylinder(btCylinderShape({0.15f, 0.1f, 0.15f})), cone(btConeShape(0.12f, 0.3f));
    // an orientation where the lowest point of a rim is also that of a side
    const glm::quat aslant(-0.3470952f, -0.3281656f, 0.4082684f, 0.7779134f);
    const unsigned start = seed();
    std::mt19937 random(start);
    std::uniform_real_distribution<float> part(-1, 1);
    int found = 0;
    for (int i = 0; i < 4000; ++i) {
        const bool isPlace = i % 2;
        const glm::quat any(part(random), part(random), part(random), part(random) + 0.01f);
        const glm::vec3 at(0.29426688f + 2e-4f * part(random), 0.296223223f,
                           isPlace ? 0.263574898f : 0.25f + 0.05f * part(random));
        std::vector<Contact> contacts;
        bullet::detail::collideConvex(isPlace || i % 4 ? cylinder : cone, {at, isPlace ? aslant : glm::normalize(any)},
                                      {}, {*plate, {}}, h, false, contacts);
        for (const Contact& contact : contacts) {
            CAPTURE(start, i, contact.distance, contact.feature);
            REQUIRE(glm::length(contact.normal) == Approx(1).margin(1e-4));
            REQUIRE(std::isfinite(glm::length(contact.position) + contact.distance));
            ++found;
        }
    }
    CHECK(found > 4000);
}

TEST_CASE("The lowest place between two is found at kinks and on parabolas") {
    const float lowest = GENERATE(0.13f, 0.5f, 0.91f);
    const auto kink = [&](float x) {
        return x < lowest ? Slope{x, 0.7f * (lowest - x), -0.7f} : Slope{x, x - lowest, 1};
    };
    const auto parabola = [&](float x) { return Slope{x, (x - lowest) * (x - lowest), 2 * (x - lowest)}; };
    int asked = 0;
    const auto search = [&](auto&& function) {
        asked = 0;
        const auto at = [&](float x) { return ++asked, std::optional(function(x)); };
        return lowestBetween(function(0), function(1), 1e-4f, at);
    };
    const auto atKink = search(kink);
    REQUIRE(atKink);
    CHECK(atKink->place == Approx(lowest).margin(1e-3));
    CHECK(asked <= 2);
    const auto onParabola = search(parabola);
    REQUIRE(onParabola);
    CHECK(onParabola->place == Approx(lowest).margin(6e-3));
    CHECK(asked <= 3);
    CHECK_FALSE(lowestBetween(kink(0), kink(1), 1e-4f, [](float) { return std::optional<Slope>(); }));
}

TEST_CASE("Sharp edges are those of the mesh, and none lies across a groove") {
    const bool grooved = GENERATE(false, true);
    Mesh mesh = shapes::box({0.5f, 0.4f, 0.3f});
    // a comb: teeth four voxels apart
    if (grooved) {
        std::vector<Mesh> parts{shapes::box({0.5f, 0.4f, 0.1f})};
        for (int i = 0; i < 3; ++i) {
            parts.push_back(shapes::box({1.5f * h, 0.4f, 0.2f}));
            for (glm::vec3& p : parts.back().points) p += glm::vec3(float(i - 1) * 5 * h, 0, 0.15f);
        }
        mesh = shapes::join(parts);
    }
    const auto collider = colliderOf(mesh);
    const auto points = collider->data().points().points();
    double total = 0;
    for (const SharpEdge& edge : collider->data().edges().edges()) {
        REQUIRE(edge.from < edge.to);
        const glm::vec3 &a = points[edge.from].position, &b = points[edge.to].position;
        total += glm::distance(a, b);
        CHECK(std::abs(signedDistance(mesh, 0.5f * (a + b))) < 0.5 * h);
    }
    // the pieces cover all twelve edges once
    if (!grooved) CHECK(total == Approx(4 * 2 * (0.5 + 0.4 + 0.3)).epsilon(1e-3));
}

TEST_CASE("Tips that have sunk into faces are told how deep, and each contact that is kept gets to the solver") {
    const int kind = GENERATE(0, 1, 2, 3, 4);
    const unsigned start = seed();
    CAPTURE(kind, start);
    const glm::vec3 half(1.6f, 1.6f, 0.3f);
    const Mesh slab = shapes::box(half), needle = shapes::cone(0.25f, 0.6f);
    Mesh pyramid;
    pyramid.points = {{-0.5f, -0.4f, -0.2f}, {0.6f, -0.3f, -0.2f}, {0.05f, 0.6f, -0.2f}, {0.05f, 0, 0.5f}};
    pyramid.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
    Shape fields[] = {Shape(colliderOf(pyramid)), Shape(colliderOf(needle))}, field(colliderOf(slab));
    btBoxShape box(bullet::detail::toBullet(half));
    btConvexHullShape hull;
    for (const glm::vec3& point : slab.points) hull.addPoint(bullet::detail::toBullet(point));
    hull.setMargin(0);
    TriangleShape few(slab), many(shapes::box(half, 20));
    btCollisionShape* grounds[] = {&field, &box, &hull, few.shape.get(), many.shape.get()};
    std::mt19937 random(start);
    std::uniform_real_distribution<float> part(-1, 1), depths(0.05f, 2.5f);
    for (int i = 0, tested = 0; tested < 100; ++i) {
        const Mesh& mesh = i % 2 ? needle : pyramid;
        Pose pose{{0.6f * part(random), 0.6f * part(random), 0},
                  glm::normalize(glm::quat(part(random), part(random), part(random), part(random) + 0.01f))};
        std::vector<float> heights;
        for (const glm::vec3& point : mesh.points) heights.push_back(pose.toWorld(point).z);
        std::sort(heights.begin(), heights.end());
        const float depth = depths(random) * h;
        if (heights[1] - heights[0] < 0.06f) continue;  // an edge lies on the face
        pose.position.z = half.z - heights[0] - depth;
        ++tested;

        World world;
        world.add(*grounds[kind], 0, {0, 0, 0});
        world.add(fields[i % 2], 1, {0, 0, 0})->setWorldTransform(transformOf(pose));
        world.dynamics.performDiscreteCollisionDetection();
        int contacts = 0;
        float deepest = 1;
        for (int m = 0; m < world.dispatcher.getNumManifolds(); ++m) {
            const btPersistentManifold& manifold = *world.dispatcher.getManifoldByIndexInternal(m);
            contacts += manifold.getNumContacts();
            for (int k = 0; k < manifold.getNumContacts(); ++k)
                deepest = std::min(deepest, float(manifold.getContactPoint(k).getDistance()));
        }
        CAPTURE(i, depth / h, deepest / h);
        CHECK(contacts == world.dispatcher.statistics().contactsKept);
        CHECK(deepest == Approx(-depth).margin(tolerance));
    }
}

TEST_CASE("The distance from a hull of balls is that of its support function, outside and inside") {
    const unsigned start = seed();
    CAPTURE(start);
    std::mt19937 random(start);
    std::uniform_real_distribution<float> part(-1, 1);
    const auto vector = [&] { return glm::vec3(part(random), part(random), part(random)); };
    for (int run = 0; run < 60; ++run) {
        std::vector<MultisphereHull::Sphere> balls;
        for (int i = 0; i <= run % 6; ++i) balls.push_back({0.5f * vector(), 0.02f + 0.2f * std::abs(part(random))});
        if (run % 3 == 0)
            for (auto& ball : balls) ball.radius = 0.2f;
        const MultisphereHull hull(balls);
        for (int i = 0; i < 20; ++i) {
            const glm::vec3 point = 1.2f * vector();
            const auto near = hull.nearest(point);
            const auto along = [&](const glm::vec3& v) {
                float least = std::numeric_limits<float>::max();
                for (const auto& ball : balls) least = std::min(least, glm::dot(v, point - ball.centre) - ball.radius);
                return least;
            };
            // hill climbing from many directions
            float best = -std::numeric_limits<float>::max();
            for (int k = 0; k < 40; ++k) {
                glm::vec3 v = glm::normalize(vector());
                float value = along(v);
                for (float step = 0.5f; step > 1e-5f;) {
                    const glm::vec3 next = glm::normalize(v + step * vector());
                    if (const float there = along(next); there > value)
                        v = next, value = there;
                    else
                        step *= 0.93f;
                }
                best = std::max(best, value);
            }
            CAPTURE(run, i, balls.size());
            // no direction gives a greater distance, and the returned one attains it
            CHECK(best < near.distance + 1e-5f);
            CHECK(best > near.distance - 1e-2f);
            CHECK(along(near.normal) == Approx(near.distance).margin(1e-5));
            // the returned ball touches the surface there
            const glm::vec3 foot = point - near.distance * near.normal;
            CHECK(glm::distance(foot, near.core + near.radius * near.normal) < 1e-4f);
        }
    }
}

TEST_CASE("A multisphere is that of its balls, whatever its margin and scale") {
    const float scale = GENERATE(0.01f, 1.f, 100.f);
    const btVector3 centres[] = {scale * btVector3(-0.3f, -0.2f, 0), scale * btVector3(0.3f, -0.2f, 0),
                                 scale * btVector3(0, 0.3f, 0)};
    const float radii[] = {scale * 0.25f, scale * 0.2f, scale * 0.15f};
    const btMultiSphereShape spheres(centres, radii, 3);
    const Convex convex(spheres);
    for (int i = 0; i < 3; ++i) {
        const glm::vec3 above = bullet::detail::toGlm(centres[i]) + glm::vec3(0, 0, scale);
        CHECK(convex.nearest(above, scale).distance <= Approx(scale - radii[i]));
    }
    const glm::vec3 beside = scale * glm::vec3(-1, -0.2f, 0);
    CHECK(convex.nearest(beside, scale).distance == Approx(0.45f * scale));
    CHECK(convex.nearest(beside, scale).normal.x == Approx(-1));
}

TEST_CASE("An edge that has sunk into two faces is as deep as the least way out over the ridge between them") {
    const unsigned start = seed();
    CAPTURE(start);
    std::mt19937 random(start);
    std::normal_distribution<float> normal;
    const auto direction = [&] { return glm::normalize(glm::vec3(normal(random), normal(random), normal(random))); };
    int tried = 0;
    while (tried < 1000) {
        const glm::vec3 along = direction(), before = direction(), after = direction();
        const float fall = -glm::dot(before, along), rise = glm::dot(after, along);
        if (fall < 0.1f || rise < 0.1f || fall > 0.9f || rise > 0.9f || glm::dot(before, after) < -0.9f) continue;
        ++tried;
        const auto found = acrossEdge(along, {-1, before}, SurfaceSample{-1, before}, SurfaceSample{-1, after});
        REQUIRE(found);
        // reference by sampling: depenetration directions all around the edge. Displaced by s, the edge's line leaves
        // either face where it meets the other
        const glm::vec3 aside = glm::normalize(glm::cross(along, before)), up = glm::cross(aside, along);
        float least = 100;
        for (int k = 0; k < 3600; ++k) {
            const float angle = glm::two_pi<float>() * float(k) / 3600;
            const glm::vec3 way = std::cos(angle) * up + std::sin(angle) * aside;
            // before * (s way + t along) = after * (s way + t along) = 1
            const float s = (fall + rise) / (glm::dot(before, way) * rise + glm::dot(after, way) * fall);
            if (s > 0) least = std::min(least, s);
        }
        CHECK(-found->distance == Approx(std::min(least, 1.5f)).epsilon(1e-4));
        CHECK(glm::dot(found->normal, along) == Approx(0).margin(1e-5));
    }
}

TEST_CASE("No contact is much deeper than the bodies overlap, whichever edges cross") {
    const unsigned start = seed();
    const ContactAccuracy measure =
        GENERATE(ContactAccuracy::samples, ContactAccuracy::exactNearFeatures, ContactAccuracy::exact);
    CAPTURE(start, nameOf(measure));
    std::mt19937 random(start);
    std::normal_distribution<float> normal;
    const std::vector<Mesh> meshes{shapes::box({0.5f, 0.4f, 0.3f}, 3), shapes::cone(0.4f, 0.9f, 48),
                                   shapes::box({0.9f, 0.1f, 0.1f})};
    std::vector<std::shared_ptr<const Collider>> colliders;
    std::vector<demo::Specimen> specimens;
    for (const Mesh& mesh : meshes) {
        colliders.push_back(colliderOf(mesh, measure));
        specimens.emplace_back(mesh, 0.5 * double(h));
    }
    const TriangleShape triangles[] = {TriangleShape(meshes[0]), TriangleShape(meshes[1]), TriangleShape(meshes[2])};
    // the plank also as Bullet's box
    const btBoxShape plank({0.9f, 0.1f, 0.1f});
    const Convex convex(plank);
    int overlapping = 0;
    for (int run = 0; run < 200; ++run) {
        const std::size_t a = random() % 3, b = random() % 3;
        const glm::quat turn =
            glm::normalize(glm::quat(normal(random), normal(random), normal(random), normal(random)));
        const glm::vec3 way = glm::normalize(glm::vec3(normal(random), normal(random), normal(random)));
        const auto depthAt = [&](float away) {
            return float(demo::penetration(specimens[a], {away * way, turn}, specimens[b], {}));
        };
        // penetration of up to half a voxel
        const float wanted = (0.05f + 0.05f * float(run % 10)) * h;
        float near = 0, far = 2.5f;
        for (int i = 0; i < 20; ++i) (depthAt(0.5f * (near + far)) > wanted ? near : far) = 0.5f * (near + far);
        const float depth = depthAt(near);
        if (depth > h) continue;
        ++overlapping;
        const Pose pose{near * way, turn};
        const auto check = [&](const char* as, const std::vector<Contact>& contacts) {
            float deepest = 0;
            for (const Contact& contact : contacts) deepest = std::min(deepest, contact.distance);
            CAPTURE(run, as, a, b, depth / h, deepest / h);
            CHECK(-deepest < depth + h);
        };
        std::vector<Contact> contacts;
        ContactCache points;
        bullet::detail::collideFields({*colliders[a], pose}, {*colliders[b], {}}, h, false, points, contacts);
        check("fields", contacts);
        // as triangles: B collides with A
        contacts.clear();
        bullet::detail::collideTriangles(
            *triangles[a].shape,
            btTransform(bullet::detail::toBullet(pose.rotation), bullet::detail::toBullet(pose.position)), {},
            {*colliders[b], {}}, h, false, contacts);
        check("triangles", contacts);
        if (a != 2) continue;
        contacts.clear();
        bullet::detail::collideConvex(convex, pose, {}, {*colliders[b], {}}, h, false, contacts);
        check("convex", contacts);
    }
    CHECK(overlapping > 150);
}

TEST_CASE("A corner is as deep in triangles as below their plane, however the body stands") {
    const unsigned start = seed();
    const ContactAccuracy measure =
        GENERATE(ContactAccuracy::samples, ContactAccuracy::exactNearFeatures, ContactAccuracy::exact);
    const bool asTerrain = GENERATE(false, true);
    const float depth = h * GENERATE(-0.5f, 0.05f, 0.2f, 0.5f);
    CAPTURE(start, nameOf(measure), asTerrain, depth / h);
    std::mt19937 random(start);
    std::normal_distribution<float> normal;
    const glm::vec3 half(0.5f, 0.4f, 0.3f);
    const auto box = colliderOf(shapes::box(half, 3), measure);
    const float heights[4] = {};
    btHeightfieldTerrainShape terrain(2, 2, heights, 1, -1, 1, 2, PHY_FLOAT, false);
    terrain.setLocalScaling({6, 6, 1});
    btTriangleMesh triangles;
    triangles.addTriangle({-3, -3, 0}, {3, -3, 0}, {3, 3, 0});
    triangles.addTriangle({-3, -3, 0}, {3, 3, 0}, {-3, 3, 0});
    const btBvhTriangleMeshShape mesh(&triangles, true);
    const btConcaveShape& ground = asTerrain ? static_cast<const btConcaveShape&>(terrain) : mesh;
    for (int run = 0; run < 50; ++run) {
        Pose pose{{0.1f, 0.2f, 0},
                  glm::normalize(glm::quat(normal(random), normal(random), normal(random), normal(random)))};
        float lowest = 0;
        for (int i = 0; i < 8; ++i)
            lowest = std::min(lowest,
                              (pose.rotation * (half * glm::vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1))).z);
        pose.position.z = -lowest - depth;
        std::vector<Contact> contacts;
        bullet::detail::collideTriangles(ground, btTransform::getIdentity(), {}, {*box, pose}, h, false, contacts);
        float deepest = h;
        glm::vec3 direction(0);
        for (const Contact& contact : contacts)
            if (contact.distance < deepest) deepest = contact.distance, direction = contact.normal;
        CAPTURE(run, deepest / h, direction.z);
        CHECK(deepest == Approx(-depth).margin(0.02 * h));
        CHECK(direction.z < -0.99f);
    }
}

TEST_CASE("A tip below a crease of triangles is as deep as below both of its faces") {
    const unsigned start = seed();
    const ContactAccuracy measure =
        GENERATE(ContactAccuracy::samples, ContactAccuracy::exactNearFeatures, ContactAccuracy::exact);
    const float cell = GENERATE(0.7f, 20.f);  // [voxels]
    CAPTURE(start, nameOf(measure), cell);
    std::mt19937 random(start);
    std::uniform_real_distribution<float> any(-1, 1);
    const float height = 1, slope = 0.6f;
    const auto cone = colliderOf(shapes::cone(0.3f, height, 12), measure);
    const TriangleShape groove(grooveOf(slope, cell * h, cell > 1 ? 2 : 20));
    const glm::vec3 left = glm::normalize(glm::vec3(slope, 0, 1)), right = glm::normalize(glm::vec3(-slope, 0, 1));
    for (int run = 0; run < 50; ++run) {
        const float below = (0.5f + 0.4f * any(random)) * h;
        const glm::vec3 tip(0.9f * slope * below * any(random), 3 * h * any(random), -below);
        const glm::vec3 axis = glm::normalize(glm::vec3(0.3f * any(random), 0.3f * any(random), -1));
        const glm::quat turn = glm::angleAxis(std::acos(axis.z), glm::normalize(glm::vec3(-axis.y, axis.x, 0)));
        std::vector<Contact> contacts;
        bullet::detail::collideTriangles(*groove.shape, btTransform::getIdentity(), {},
                                         {*cone, {tip - 0.5f * height * axis, turn}}, h, false, contacts);
        for (const glm::vec3& up : {left, right}) {
            float deepest = h;
            for (const Contact& contact : contacts)
                if (glm::dot(contact.normal, up) < -0.99f) deepest = std::min(deepest, contact.distance);
            CAPTURE(run, tip.x / h, tip.z / h, up.x, deepest / h);
            CHECK(deepest == Approx(glm::dot(up, tip)).margin(0.03f * h));
        }
    }
}

TEST_CASE("What is exact is so against Bullet's shapes too") {
    // small balls around the edges of a box, where trilinear samples are rounded off
    const glm::vec3 half(0.5f, 0.4f, 0.3f);
    const auto exact = colliderOf(shapes::box(half), ContactAccuracy::exact),
               usual = colliderOf(shapes::box(half), ContactAccuracy::exactNearFeatures),
               sampled = colliderOf(shapes::box(half), ContactAccuracy::samples);
    const float radius = 0.1f * h;
    btSphereShape ball(radius);
    const Convex convex(ball);
    float worstSampled = 0;
    for (int i = 0; i < 40; ++i) {
        const float angle = glm::half_pi<float>() * (float(i) + 0.5f) / 40;
        const glm::vec3 away = 0.4f * h * glm::vec3(std::cos(angle), std::sin(angle), 0);
        const Pose pose{glm::vec3(half.x, half.y, 0.013f * float(i - 20)) + away, {1, 0, 0, 0}};
        const auto errorOf = [&](const Collider& collider) {
            std::vector<Contact> contacts;
            bullet::detail::collideConvex(convex, pose, {}, {collider, {}}, h, false, contacts);
            // measures the ball's own centre in the field, not the box's edge in the ball
            float error = h;
            for (const Contact& contact : contacts)
                if (!(contact.feature & featureOfB))
                    error = std::min(error, std::abs(contact.distance - (0.4f * h - radius)));
            return error;
        };
        CAPTURE(i, angle);
        CHECK(errorOf(*exact) < 1e-3f * h);
        CHECK(errorOf(*usual) < 0.1f * h);
        worstSampled = std::max(worstSampled, errorOf(*sampled));
    }
    CHECK(worstSampled > 0.1f * h);
}

TEST_CASE("Balls lie in a groove as deep as they do between two faces") {
    // a right-angled groove along x, its bottom off the voxel centres
    const glm::vec3 bottom(0, 0.37f * h, 0.61f * h);
    const glm::vec2 section[] = {{-0.3f, -0.2f}, {0.3f, -0.2f}, {0.3f, 0.3f}, {0, 0}, {-0.3f, 0.3f}};
    Mesh mesh;
    for (const float x : {-0.5f, 0.5f})
        for (const glm::vec2& p : section) mesh.points.push_back(bottom + glm::vec3(x, p.x, p.y));
    for (unsigned i = 0; i < 5; ++i) {
        const unsigned next = (i + 1) % 5;
        mesh.triangles.push_back({i, next, 5 + next});
        mesh.triangles.push_back({i, 5 + next, 5 + i});
    }
    for (const glm::uvec3& t : {glm::uvec3(3, 4, 0), glm::uvec3(3, 0, 1), glm::uvec3(3, 1, 2)}) {
        mesh.triangles.push_back({t.x, t.z, t.y});
        mesh.triangles.push_back(t + 5u);
    }
    const auto deepestWith = [&](ContactAccuracy measure, float radius) {
        const auto groove = colliderOf(mesh, measure);
        btSphereShape ball(radius);
        std::vector<Contact> contacts;
        const Pose lying{bottom + glm::vec3(0, 0, std::sqrt(2.f) * radius)};
        bullet::detail::collideConvex(Convex(ball), lying, {}, {*groove, {}}, h, false, contacts);
        return deepest(contacts).distance;
    };
    for (const float voxels : {0.9f, 1.5f, 2.f}) {
        CAPTURE(voxels);
        CHECK(std::abs(deepestWith(ContactAccuracy::exactNearFeatures, voxels * h)) < 0.01f * h);
        CHECK(std::abs(deepestWith(ContactAccuracy::exact, voxels * h)) < 0.01f * h);
        CHECK(std::abs(deepestWith(ContactAccuracy::samples, voxels * h)) > 0.1f * h);
    }
}
