// SPDX-License-Identifier: Apache-2.0
// A small Bullet world for tests, and fields to put into it.
#pragma once

#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <functional>
#include <glm/vec3.hpp>
#include <limits>
#include <memory>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include <bilayer/integration/bullet/dispatcher.h>
#include <bilayer/integration/bullet/shape.h>
#include "demos/shared/triangle_shape.h"

namespace bilayer::test {

using demo::TriangleShape;

/// A world with gravity (0, 0, -9.81) m/s^2 that owns its bodies.
class World {
  public:
    /// @param sampler  passed to the dispatcher
    explicit World(PointSampler sampler = {});
    ~World();

    /// Mass 0: static. The shape must outlive the world.
    btRigidBody* add(btCollisionShape& shape, float mass, const btVector3& position,
                     const btQuaternion& rotation = btQuaternion::getIdentity());
    /// Steps of 1/240 s.
    void run(float seconds);

    btDefaultCollisionConfiguration configuration;
    bullet::Dispatcher dispatcher;
    btDbvtBroadphase broadphase;
    btSequentialImpulseConstraintSolver solver;
    btDiscreteDynamicsWorld dynamics{&dispatcher, &broadphase, &solver, &configuration};

  private:
    std::vector<std::unique_ptr<btRigidBody>> bodies_;
};

/// Returns the kinetic and potential energy of a dynamic body in the middle of the last step, where the velocity at its
/// end belongs: constant in free flight [J].
/// @param seconds  length of the step
double energyOf(const btRigidBody& body, float seconds);

/// A field with the distances of a formula, not of the mesh's triangles. Remaining errors are those of the contacts.
std::shared_ptr<const Collider> exactCollider(const Mesh& mesh, const std::function<float(const glm::vec3&)>& distance,
                                              float voxelSize);

/// The collider of a mesh by the exact method, with a field that reaches six voxels inside.
std::shared_ptr<const Collider> deepCollider(const Mesh& mesh, float voxelSize,
                                             ContactAccuracy accuracy = ContactAccuracy::exactNearFeatures);

std::shared_ptr<const Collider> exactBox(const glm::vec3& halfExtents, float voxelSize);
std::shared_ptr<const Collider> exactSphere(float radius, float voxelSize);
std::shared_ptr<const Collider> exactTorus(float major, float minor, float voxelSize);
/// A shell like shapes::bowl: the lower half of the sphere of `radius`, with wall thickness `wall` and a round rim.
std::shared_ptr<const Collider> exactBowl(float radius, float wall, float voxelSize);

/// The height of the lowest vertex [m].
float lowest(const Mesh& mesh, const btTransform& at);

/// The collider of a mesh as it is read from a file without the mesh.
std::shared_ptr<const Collider> withoutMesh(const Mesh& mesh, const LevelSet& field);

/// Keeps the nearest contact of a contact test.
struct Nearest : btCollisionWorld::ContactResultCallback {
    btScalar addSingleResult(btManifoldPoint& point, const btCollisionObjectWrapper*, int, int,
                             const btCollisionObjectWrapper*, int, int) override {
        distance = std::min(distance, float(point.getDistance()));
        return 0;
    }
    float distance = std::numeric_limits<float>::max();
};

/// Linear [m/s] plus angular [1/s] speed: the measure of residual drift of resting bodies.
float motion(const btRigidBody& body);

/// A groove along y with two slopes, made of squares of two triangles each.
Mesh grooveOf(float slope, float cell, int cells);

}  // namespace bilayer::test
