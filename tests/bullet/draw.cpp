// SPDX-License-Identifier: Apache-2.0
// Debug drawing of fields, contacts and bands.
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>
#include <vector>

#include <bilayer/integration/bullet/draw.h>
#include <bilayer/sdf/build.h>
#include "collider/contact/body/collider_data.h"
#include "demos/shared/shapes.h"
#include "sdf/base/access.h"
#include "tests/bullet/world.h"

namespace bilayer::draw_test {
using namespace bilayer::test;
using bullet::Shape;

namespace {

constexpr float h = 0.05f;  // voxel [m]

struct CountingDrawer : btIDebugDraw {
    void drawLine(const btVector3& from, const btVector3& to, const btVector3&) override {
        ++lines;
        for (const btVector3& p : {from, to}) upper.setMax(p), lower.setMin(p);
    }
    void drawContactPoint(const btVector3& place, const btVector3& normal, btScalar, int, const btVector3&) override {
        contacts.emplace_back(place, normal);
    }
    void reportErrorWarning(const char*) override {}
    void draw3dText(const btVector3&, const char*) override {}
    void setDebugMode(int) override {}
    int getDebugMode() const override { return mode; }
    int mode = DBG_DrawWireframe;
    int lines = 0;
    std::vector<std::pair<btVector3, btVector3>> contacts;
    btVector3 lower{1e9f, 1e9f, 1e9f}, upper{-1e9f, -1e9f, -1e9f};
};

}  // namespace

TEST_CASE("Drawing shows the mesh where the body is") {
    const Mesh mesh = shapes::sphere(0.5f, 3);
    Shape shape(std::make_shared<Collider>(mesh, build(mesh, {.voxelSize = h})),
                {.frame = {{0.1f, 0, 0}, {1, 0, 0, 0}}});
    shape.setLocalScaling({2, 2, 2});
    World world;
    btRigidBody* body = world.add(shape, 1, {1, 2, 3});
    CountingDrawer drawer;
    world.dynamics.setDebugDrawer(&drawer);
    world.dynamics.debugDrawObject(body->getWorldTransform(), &shape, {1, 1, 1});
    CHECK(drawer.lines == static_cast<int>(3 * mesh.triangles.size()));
    CHECK((0.5f * (drawer.lower + drawer.upper) - btVector3(1.2f, 2, 3)).length() < 0.01f);
    world.dynamics.setDebugDrawer(nullptr);
}

TEST_CASE("The surface of a body without a mesh is drawn") {
    const Mesh mesh = shapes::sphere(0.5f, 4);
    const LevelSet field = build(mesh, {.voxelSize = h});
    Shape shape(withoutMesh(mesh, field));
    World world;
    btRigidBody* body = world.add(shape, 1, {1, 2, 3});
    CountingDrawer drawer;
    world.dynamics.setDebugDrawer(&drawer);
    world.dynamics.debugDrawObject(body->getWorldTransform(), &shape, {1, 1, 1});
    CHECK(drawer.lines > 1000);
    for (int axis = 0; axis < 3; ++axis) {
        CHECK(drawer.lower[axis] == Approx(axis + 0.5f).margin(0.1 * h));
        CHECK(drawer.upper[axis] == Approx(axis + 1.5f).margin(0.1 * h));
    }
    world.dynamics.setDebugDrawer(nullptr);
}

TEST_CASE("Contacts are drawn where bodies touch") {
    Shape box(exactBox({0.5f, 0.4f, 0.3f}, h));
    btStaticPlaneShape ground({0, 0, 1}, 0);
    World world;
    world.add(ground, 0, {0, 0, 0});
    world.add(box, 1, {0, 0, 0.3f});
    world.run(0.1f);
    CountingDrawer drawer;
    drawer.mode = btIDebugDraw::DBG_DrawContactPoints;
    world.dynamics.setDebugDrawer(&drawer);
    world.dynamics.debugDrawWorld();
    world.dynamics.setDebugDrawer(nullptr);
    int contacts = 0;
    for (int i = 0; i < world.dispatcher.getNumManifolds(); ++i)
        contacts += world.dispatcher.getManifoldByIndexInternal(i)->getNumContacts();
    REQUIRE(contacts >= 3);
    REQUIRE(static_cast<int>(drawer.contacts.size()) == contacts);
    for (const auto& [place, normal] : drawer.contacts) {
        CHECK(std::abs(place.z()) < 0.1f * h);
        CHECK(std::abs(normal.z()) == Approx(1).margin(1e-3));
    }
}

TEST_CASE("A band is outlined by the blocks that it lies in") {
    // a ball in the middle of a leaf, whose band extends one voxel beyond each side: seven leaves in a cross
    const glm::vec3 centre(4 * h, 4 * h, 4 * h);
    const float radius = 2.5f * h;
    Mesh mesh = shapes::sphere(radius, 3);
    for (glm::vec3& point : mesh.points) point += centre;
    Shape shape(exactCollider(
        mesh, [&](const glm::vec3& p) { return glm::distance(p, centre) - radius; }, h));
    shape.setLocalScaling({2, 2, 2});
    CountingDrawer drawer;
    bullet::drawField(shape, btTransform(btQuaternion::getIdentity(), {1, 2, 3}), drawer);
    // four edges at the end of each arm, four along each axis that arms and the middle share
    CHECK(drawer.lines == 6 * 4 + 3 * 4);
    const float block = 2 * 8 * h;
    CHECK((drawer.lower - btVector3(1, 2, 3) - btVector3(-block, -block, -block)).length() < 1e-5f);
    CHECK((drawer.upper - btVector3(1, 2, 3) - btVector3(2 * block, 2 * block, 2 * block)).length() < 1e-5f);

    // also inside a compound, with a line per surface point
    btCompoundShape compound;
    compound.addChildShape(btTransform(btQuaternion::getIdentity(), {0, 0, 1}), &shape);
    World world;
    world.add(compound, 0, {1, 2, 2});
    CountingDrawer again;
    bullet::drawFields(world.dynamics, again);
    CHECK(again.lines == drawer.lines);
    CHECK((again.lower - drawer.lower).length() < 1e-5f);
    CountingDrawer points;
    bullet::drawFields(world.dynamics, points, {.band = false, .points = true});
    CHECK(points.lines == static_cast<int>(bilayer::detail::dataOf(shape.collider()).points().points().size()));
}
}  // namespace bilayer::draw_test
