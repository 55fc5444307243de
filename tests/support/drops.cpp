// SPDX-License-Identifier: Apache-2.0
#include "tests/support/drops.h"

#include <BulletCollision/CollisionShapes/btHeightfieldTerrainShape.h>
#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/constants.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>

#include <bilayer/integration/bullet/shape.h>
#include <bilayer/sdf/build.h>
#include "demos/shared/shapes.h"
#include "demos/shared/triangle_shape.h"
#include "integration/bullet/detail/convert.h"
#include "tests/bullet/world.h"

namespace bilayer::test {
namespace {

constexpr float height = 0.03f;          // amplitude of the waves, and top of the box [m]
constexpr float cell = 0.25f;            // of the triangle mesh and the height field [m]
constexpr int groundCells = 20;          // along each of their sides
constexpr float boxSide = 3;             // half of it [m]
constexpr float fieldSide = 2.5f;        // half of it: as that of the triangle mesh [m]
constexpr float fieldDepth = 0.3f;       // below the waves [m]
constexpr int fieldCells = 80;           // along each side of the field's mesh
constexpr float fieldVoxel = 0.025f;     // near twice a body's voxel [m]
constexpr float longestSide = 0.8f;      // of a body [m]
constexpr float stepsPerSecond = 240;    // of the simulation
constexpr double gravity = 9.81;         // as in World [m/s^2]
constexpr float minUpwardCosine = 0.5f;  // contacts below it point sideways

float wave(float x, float y) {
    return height * std::sin(2.1f * x + 1) * std::cos(1.3f * y);
}

Mesh waves() {
    Mesh mesh;
    const float corner = 0.5f * cell * float(groundCells);
    for (int j = 0; j <= groundCells; ++j)
        for (int i = 0; i <= groundCells; ++i) {
            const float x = cell * float(i) - corner, y = cell * float(j) - corner;
            mesh.points.emplace_back(x, y, wave(x, y));
        }
    for (int j = 0; j < groundCells; ++j)
        for (int i = 0; i < groundCells; ++i) {
            const auto a = unsigned(j * (groundCells + 1) + i), c = a + unsigned(groundCells) + 1;
            mesh.triangles.insert(mesh.triangles.end(), {{a, a + 1, c + 1}, {a, c + 1, c}});
        }
    return mesh;
}

std::shared_ptr<btCollisionShape> wavyField() {
    Mesh slab = shapes::box({fieldSide, fieldSide, 0.5f * fieldDepth}, fieldCells);
    for (glm::vec3& p : slab.points) p.z += p.z > 0 ? wave(p.x, p.y) - 0.5f * fieldDepth : -0.5f * fieldDepth;
    return std::make_shared<bullet::Shape>(
        std::make_shared<const Collider>(slab, build(slab, {.voxelSize = fieldVoxel})));
}

std::shared_ptr<btCollisionShape> wavyTriangles() {
    const auto triangles = std::make_shared<demo::TriangleShape>(waves());
    return {triangles, triangles->shape.get()};
}

std::shared_ptr<btCollisionShape> wavyHeightField() {
    const auto heights = std::make_shared<std::vector<float>>();
    for (const glm::vec3& p : waves().points) heights->push_back(p.z);
    // Bullet keeps a pointer to the heights: they are destroyed with the shape
    const std::shared_ptr<btHeightfieldTerrainShape> shape(
        new btHeightfieldTerrainShape(groundCells + 1, groundCells + 1, heights->data(), 1.f, -height, height, 2,
                                      PHY_FLOAT, false),
        [heights](btHeightfieldTerrainShape* owned) { delete owned; });
    shape->setLocalScaling({cell, cell, 1});
    return shape;
}

int contactsAside(btDispatcher& dispatcher, const btRigidBody& body) {
    int count = 0;
    for (int i = 0; i < dispatcher.getNumManifolds(); ++i) {
        const btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(i);
        const float side = manifold.getBody0() == &body ? 1.f : -1.f;
        for (int k = 0; k < manifold.getNumContacts(); ++k)
            count += side * manifold.getContactPoint(k).m_normalWorldOnB.z() < minUpwardCosine;
    }
    return count;
}

// The body's transform where the mesh is turned and placed as asked, its lowest point at the drop height.
btTransform start(const Collider& collider, const Pose& frame, const DropPlace& place) {
    const btTransform inMesh(bullet::detail::toBullet(frame.rotation), bullet::detail::toBullet(frame.position));
    const btTransform mesh(bullet::detail::toBullet(place.rotation), btVector3(place.centre.x, place.centre.y, 0));
    btTransform body = mesh * inMesh.inverse();
    body.getOrigin().setZ(body.getOrigin().z() + height + dropHeight - lowest(collider.mesh(), mesh));
    return body;
}

}  // namespace

std::vector<Ground> grounds() {
    return {{"plane", std::make_shared<btStaticPlaneShape>(btVector3(0, 0, 1), 0.f)},
            {"box", std::make_shared<btBoxShape>(btVector3(boxSide, boxSide, height))},
            {"field", wavyField()},
            {"mesh", wavyTriangles()},
            {"height field", wavyHeightField()}};
}

Drop drop(const std::shared_ptr<const Collider>& collider, btCollisionShape& ground, const DropPlace& place,
          float seconds) {
    bullet::Shape shape(collider, {.frame = bullet::centreOfMassFrame(*collider)});
    World world;
    world.dynamics.getSolverInfo().m_splitImpulsePenetrationThreshold = -shape.voxelSize();
    world.add(ground, 0, {0, 0, 0});
    const btTransform at = start(*collider, shape.frame(), place);
    const btRigidBody& body = *world.add(shape, 1, at.getOrigin(), at.getRotation());
    double smallest = energyOf(body, 1 / stepsPerSecond), gain = 0;
    Drop result;
    for (int step = 0; step < int(stepsPerSecond * seconds); ++step) {
        world.dynamics.stepSimulation(1 / stepsPerSecond, 1, 1 / stepsPerSecond);
        const double now = energyOf(body, 1 / stepsPerSecond);
        if (!std::isfinite(now)) {
            result.gain = std::numeric_limits<double>::infinity();
            return result;
        }
        smallest = std::min(smallest, now);
        gain = std::max(gain, now - smallest);
        result.sidewaysContacts += contactsAside(world.dispatcher, body);
    }
    result.gain = gain / (gravity * double(dropHeight));  // of 1 kg
    result.sleeps = !body.isActive();
    result.fell = body.getWorldTransform().getOrigin().z() < -height;
    return result;
}

Mesh droppable(const Mesh& mesh) {
    const Bounds box = bounds(mesh);
    glm::mat4 map = glm::rotate(glm::mat4(1), glm::half_pi<float>(), glm::vec3(1, 0, 0));
    map = glm::scale(map, glm::vec3(longestSide / box.longestSide()));
    return transformed(mesh, glm::translate(map, -box.centre()));
}

}  // namespace bilayer::test
