// SPDX-License-Identifier: Apache-2.0
// Contacts at edges and vertices, between bodies of all kinds.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <glm/gtc/quaternion.hpp>
#include <random>

#include <bilayer/collider/contact.h>
#include "collider/contact/body/collider_data.h"
#include "collider/contact/open_surface/triangle_contacts.h"
#include "collider/contact/search/convex_contacts.h"
#include "collider/contact/shapes/convex.h"
#include "demos/shared/exact_distance.h"
#include "demos/shared/shapes.h"
#include "integration/bullet/detail/contact_shapes.h"
#include "integration/bullet/detail/convert.h"
#include "sdf/base/access.h"
#include "tests/bullet/world.h"
#include "tests/support/contacts.h"
#include "tests/support/support.h"

namespace bilayer::edges_test {
using namespace bilayer::detail;
using namespace bilayer::bullet::detail;
using namespace bilayer::test;
using bullet::Shape;

namespace {

constexpr float h = 0.05f;             // voxel [m]
constexpr double tolerance = 0.1 * h;  // of depths

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
    const glm::quat oblique = glm::angleAxis(0.6f * part(random), glm::vec3(0, 0, 1));
    const float height = std::sqrt(2.f) * halfBar;
    Pose lower{{0.3f * part(random), 0.3f * part(random), -height}, square * ridge};
    Pose upper{{0.3f * part(random), 0.3f * part(random), height + gap}, oblique * ridge};
    const glm::quat rotation = glm::normalize(glm::quat(part(random), part(random), part(random), part(random) + 0.1f));
    for (Pose* pose : {&lower, &upper}) *pose = {rotation * pose->position, glm::normalize(rotation * pose->rotation)};
    return {upper, lower, rotation * glm::vec3(0, 0, 1), gap};
}

btTransform transformOf(const Pose& pose) {
    return btTransform(bullet::detail::toBullet(pose.rotation), bullet::detail::toBullet(pose.position));
}

using Collide = std::function<std::vector<Contact>(const Crossing&, float)>;

Collide collideBars(int kind, ContactAccuracy accuracy) {
    const auto field = deepCollider(shapes::box(bar), h, accuracy);
    if (kind == 0)
        return [=](const Crossing& c, float margin) {
            std::vector<Contact> contacts;
            ContactCache near;
            collide({*field, c.upper}, {*field, c.lower}, {.margin = margin}, contacts, &near);
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
            collideConvex(convexOf(*shape), c.upper, {}, {*field, c.lower}, {.margin = margin}, contacts);
            return contacts;
        };
    }
    const auto triangles = std::make_shared<TriangleShape>(shapes::box(bar));
    return [=](const Crossing& c, float margin) {
        std::vector<Contact> contacts;
        collideTriangles(openSurfaceOf(*triangles->shape), c.upper, {}, {*field, c.lower}, {.margin = margin},
                         contacts);
        return contacts;
    };
}

}  // namespace

TEST_CASE("Crossing edges are in contact where they cross, wherever their sample points are") {
    const int kind = GENERATE(0, 1, 2, 3);
    const ContactAccuracy accuracy =
        GENERATE(ContactAccuracy::samples, ContactAccuracy::exactNearFeatures, ContactAccuracy::exact);
    const unsigned start = seed();
    CAPTURE(kind, nameOf(accuracy), start);
    const Collide collide = collideBars(kind, accuracy);
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

TEST_CASE("A contact on an edge moves as smoothly as the sliding edge") {
    const int kind = GENERATE(0, 1, 2, 3);
    const ContactAccuracy accuracy =
        GENERATE(ContactAccuracy::samples, ContactAccuracy::exactNearFeatures, ContactAccuracy::exact);
    const unsigned start = seed();
    CAPTURE(kind, nameOf(accuracy), start);
    const Collide collide = collideBars(kind, accuracy);
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

TEST_CASE("Edge descent finds a bump between its samples, and keeps it") {
    // a small ball of three voxels' radius under the edge of a long box
    const float radius = 3 * h;
    static const auto ball = exactSphere(radius, h);
    const float side = std::sqrt(2.f) * halfBar;
    const glm::quat ridge = glm::angleAxis(glm::quarter_pi<float>(), glm::vec3(1, 0, 0));
    const btBoxShape box(bullet::detail::toBullet(bar));
    const Convex convex = convexOf(box);
    float before = 0;
    for (int i = 0; i < 200; ++i) {
        const float displacement = 0.02f * h * float(i), gap = -0.1f * h;
        std::vector<Contact> contacts;
        collideConvex(convex, {{0.3f + displacement, 0, radius + side + gap}, ridge}, {}, {*ball, {}}, {.margin = h},
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

TEST_CASE("Contacts of solids of revolution are finite in all orientations") {
    const auto plate = exactBox({1.2f, 1.2f, 0.1f}, h);
    const Convex cylinder = convexOf(btCylinderShape({0.15f, 0.1f, 0.15f})), cone = convexOf(btConeShape(0.12f, 0.3f));
    // an orientation where the lowest point of a rim is also that of a side
    const glm::quat oblique(-0.3470952f, -0.3281656f, 0.4082684f, 0.7779134f);
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
        collideConvex(isPlace || i % 4 ? cylinder : cone, {at, isPlace ? oblique : glm::normalize(any)}, {},
                      {*plate, {}}, {.margin = h}, contacts);
        for (const Contact& contact : contacts) {
            CAPTURE(start, i, contact.distance, contact.feature);
            REQUIRE(glm::length(contact.normal) == Approx(1).margin(1e-4));
            REQUIRE(std::isfinite(glm::length(contact.position) + contact.distance));
            ++found;
        }
    }
    CHECK(found > 4000);
}

TEST_CASE("A flat end above a flat face has the face's normal at each contact, also next to its rim") {
    const auto plate = exactBox({0.6f, 0.6f, 0.1f}, h);
    const float radius = 0.15f, height = 0.1f;
    const Convex cylinder = convexOf(btCylinderShapeZ({radius, radius, height}));
    const unsigned start = seed();
    CAPTURE(start);
    std::mt19937 random(start);
    std::uniform_real_distribution<float> part(0, 1);
    std::vector<glm::vec3> onTop;
    for (const SurfacePoint& point : dataOf(*plate).points().points())
        if (point.normal.z > 0.9999f && std::max(std::abs(point.position.x), std::abs(point.position.y)) < 0.2f)
            onTop.push_back(point.position);
    REQUIRE(onTop.size() > 20);
    std::size_t found = 0;
    for (int i = 0; i < 2000; ++i) {
        // the rim passes next to a surface point, by a tenth of a voxel and less
        const float angle = 6.28f * part(random), beyond = radius + 0.1f * h * std::pow(10.f, -4 * part(random));
        const float gap = 0.5f * h * part(random);
        const glm::vec3 place = onTop[random() % onTop.size()] +
                                glm::vec3(beyond * std::cos(angle), beyond * std::sin(angle), height + gap);
        std::vector<Contact> contacts;
        collideConvex(cylinder, {place}, {{0, 0, -1.1f * gap}}, {*plate, {}}, {.margin = h}, contacts);
        for (const Contact& contact : contacts) {
            CAPTURE(i, gap, beyond - radius, contact.distance, contact.feature, contact.normal.x, contact.normal.y);
            REQUIRE(glm::length(glm::vec2(contact.normal)) < 2e-3f);
        }
        found += contacts.size();
    }
    CHECK(found > 8000);
}

TEST_CASE("Convex vertices below faces have the right penetration depth, and each kept contact reaches the solver") {
    const int kind = GENERATE(0, 1, 2, 3, 4);
    const unsigned start = seed();
    CAPTURE(kind, start);
    const glm::vec3 half(1.6f, 1.6f, 0.3f);
    const Mesh slab = shapes::box(half), needle = shapes::cone(0.25f, 0.6f);
    Mesh pyramid;
    pyramid.points = {{-0.5f, -0.4f, -0.2f}, {0.6f, -0.3f, -0.2f}, {0.05f, 0.6f, -0.2f}, {0.05f, 0, 0.5f}};
    pyramid.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
    Shape fields[] = {Shape(deepCollider(pyramid, h)), Shape(deepCollider(needle, h))}, field(deepCollider(slab, h));
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

TEST_CASE("No contact is much deeper than the penetration depth of the bodies, whichever edges cross") {
    const unsigned start = seed();
    const ContactAccuracy accuracy =
        GENERATE(ContactAccuracy::samples, ContactAccuracy::exactNearFeatures, ContactAccuracy::exact);
    CAPTURE(start, nameOf(accuracy));
    std::mt19937 random(start);
    std::normal_distribution<float> normal;
    const std::vector<Mesh> meshes{shapes::box({0.5f, 0.4f, 0.3f}, 3), shapes::cone(0.4f, 0.9f, 48),
                                   shapes::box({0.9f, 0.1f, 0.1f})};
    std::vector<std::shared_ptr<const Collider>> colliders;
    std::vector<demo::Specimen> specimens;
    for (const Mesh& mesh : meshes) {
        colliders.push_back(deepCollider(mesh, h, accuracy));
        specimens.emplace_back(mesh, 0.5 * double(h));
    }
    const TriangleShape triangles[] = {TriangleShape(meshes[0]), TriangleShape(meshes[1]), TriangleShape(meshes[2])};
    // the plank also as Bullet's box
    const btBoxShape plank({0.9f, 0.1f, 0.1f});
    const Convex convex = convexOf(plank);
    int overlapping = 0;
    for (int run = 0; run < 200; ++run) {
        const std::size_t a = random() % 3, b = random() % 3;
        const glm::quat rotation =
            glm::normalize(glm::quat(normal(random), normal(random), normal(random), normal(random)));
        const glm::vec3 axis = glm::normalize(glm::vec3(normal(random), normal(random), normal(random)));
        const auto depthAt = [&](float away) {
            return float(demo::penetration(specimens[a], {away * axis, rotation}, specimens[b], {}));
        };
        // penetration of up to half a voxel
        const float wanted = (0.05f + 0.05f * float(run % 10)) * h;
        float near = 0, far = 2.5f;
        for (int i = 0; i < 20; ++i) (depthAt(0.5f * (near + far)) > wanted ? near : far) = 0.5f * (near + far);
        const float depth = depthAt(near);
        if (depth > h) continue;
        ++overlapping;
        const Pose pose{near * axis, rotation};
        const auto check = [&](const char* as, const std::vector<Contact>& contacts) {
            float deepest = 0;
            for (const Contact& contact : contacts) deepest = std::min(deepest, contact.distance);
            CAPTURE(run, as, a, b, depth / h, deepest / h);
            CHECK(-deepest < depth + h);
        };
        std::vector<Contact> contacts;
        ContactCache points;
        collide({*colliders[a], pose}, {*colliders[b], {}}, {.margin = h}, contacts, &points);
        check("fields", contacts);
        // as triangles: B collides with A
        contacts.clear();
        collideTriangles(openSurfaceOf(*triangles[a].shape), pose, {}, {*colliders[b], {}}, {.margin = h}, contacts);
        check("triangles", contacts);
        if (a != 2) continue;
        contacts.clear();
        collideConvex(convex, pose, {}, {*colliders[b], {}}, {.margin = h}, contacts);
        check("convex", contacts);
    }
    CHECK(overlapping > 150);
}

TEST_CASE("Exact contacts are exact against Bullet's shapes too") {
    // small balls around the edges of a box, where trilinear samples are rounded off
    const glm::vec3 half(0.5f, 0.4f, 0.3f);
    const auto exact = deepCollider(shapes::box(half), h, ContactAccuracy::exact),
               usual = deepCollider(shapes::box(half), h, ContactAccuracy::exactNearFeatures),
               sampled = deepCollider(shapes::box(half), h, ContactAccuracy::samples);
    const float radius = 0.1f * h;
    btSphereShape ball(radius);
    const Convex convex = convexOf(ball);
    float worstSampled = 0;
    for (int i = 0; i < 40; ++i) {
        const float angle = glm::half_pi<float>() * (float(i) + 0.5f) / 40;
        const glm::vec3 away = 0.4f * h * glm::vec3(std::cos(angle), std::sin(angle), 0);
        const Pose pose{glm::vec3(half.x, half.y, 0.013f * float(i - 20)) + away, {1, 0, 0, 0}};
        const auto errorOf = [&](const Collider& collider) {
            std::vector<Contact> contacts;
            collideConvex(convex, pose, {}, {collider, {}}, {.margin = h}, contacts);
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
}  // namespace bilayer::edges_test
