// SPDX-License-Identifier: Apache-2.0
#include "tests/bullet/world.h"
#include "collider/contact/body/collider_data.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <limits>
#include <utility>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include "demos/shared/shapes.h"
#include "demos/shared/world.h"
#include "integration/bullet/detail/convert.h"
#include "sdf/base/openvdb.h"

namespace bilayer::test {

using namespace bilayer::detail;
using namespace bilayer::bullet::detail;

World::World(PointSampler sampler) : dispatcher(&configuration, std::move(sampler)) {
    dynamics.setGravity({0, 0, -9.81f});
    dynamics.getDispatchInfo().m_deterministicOverlappingPairs = true;
    // Small parts: avoids adding velocity for penetration of centimetres.
    dynamics.getSolverInfo().m_splitImpulsePenetrationThreshold = -1e-3f;
}

World::~World() {
    for (const auto& body : bodies_) dynamics.removeRigidBody(body.get());
}

btRigidBody* World::add(btCollisionShape& shape, float mass, const btVector3& position, const btQuaternion& rotation) {
    btVector3 inertia(0, 0, 0);
    if (mass > 0) shape.calculateLocalInertia(mass, inertia);
    btRigidBody::btRigidBodyConstructionInfo info(mass, nullptr, &shape, inertia);
    info.m_startWorldTransform = btTransform(rotation, position);
    info.m_friction = 0.5f;
    bodies_.push_back(std::make_unique<btRigidBody>(info));
    dynamics.addRigidBody(bodies_.back().get());
    return bodies_.back().get();
}

void World::run(float seconds) {
    const float step = 1.f / 240;
    for (int i = 0; i < std::lround(seconds / step); ++i) dynamics.stepSimulation(step, 1, step);
}

double energyOf(const btRigidBody& body, float seconds) {
    const float height = body.getCenterOfMassPosition().z() - 0.5f * seconds * body.getLinearVelocity().z();
    return demo::kineticEnergyOf(body) + 9.81 * double(height) / double(body.getInvMass());
}

std::shared_ptr<const Collider> exactCollider(const Mesh& mesh, const std::function<float(const glm::vec3&)>& distance,
                                              float voxelSize) {
    const float width = 3 * voxelSize;
    auto grid = openvdb::FloatGrid::create(width);
    grid->setTransform(openvdb::math::Transform::createLinearTransform(voxelSize));
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    const Bounds box = bounds(mesh);
    const auto first = glm::ivec3(glm::floor((box.lower - width) / voxelSize)) - 1;
    const auto last = glm::ivec3(glm::ceil((box.upper + width) / voxelSize)) + 1;
    auto accessor = grid->getAccessor();
    for (int x = first.x; x <= last.x; ++x)
        for (int y = first.y; y <= last.y; ++y)
            for (int z = first.z; z <= last.z; ++z) {
                const float d = distance(voxelSize * glm::vec3(x, y, z));
                if (std::abs(d) < width)
                    accessor.setValueOn({x, y, z}, d);
                else if (d < 0)
                    accessor.setValueOff({x, y, z}, -width);
            }
    auto grids = std::make_shared<Grids>();
    grids->distance = grid;
    return std::make_shared<Collider>(mesh, LevelSet(grids));
}

std::shared_ptr<const Collider> deepCollider(const Mesh& mesh, float voxelSize, ContactAccuracy accuracy) {
    return std::make_shared<Collider>(mesh, build(mesh, {.voxelSize = voxelSize, .interiorWidthVoxels = 6}),
                                      ColliderOptions{.accuracy = accuracy});
}

std::shared_ptr<const Collider> exactBox(const glm::vec3& halfExtents, float voxelSize) {
    return exactCollider(
        shapes::box(halfExtents),
        [=](const glm::vec3& p) {
            const glm::vec3 q = glm::abs(p) - halfExtents;
            return glm::length(glm::max(q, 0.f)) + std::min(std::max({q.x, q.y, q.z}), 0.f);
        },
        voxelSize);
}

std::shared_ptr<const Collider> exactSphere(float radius, float voxelSize) {
    return exactCollider(
        shapes::sphere(radius, 5), [=](const glm::vec3& p) { return glm::length(p) - radius; }, voxelSize);
}

std::shared_ptr<const Collider> exactTorus(float major, float minor, float voxelSize) {
    const auto distance = [=](const glm::vec3& p) {
        return glm::length(glm::vec2(glm::length(glm::vec2(p)) - major, p.z)) - minor;
    };
    return exactCollider(shapes::torus(major, minor, 192, 96), distance, voxelSize);
}

std::shared_ptr<const Collider> exactBowl(float radius, float wall, float voxelSize) {
    const float middle = radius - 0.5f * wall;
    const auto distance = [=](const glm::vec3& p) {
        const glm::vec2 q(glm::length(glm::vec2(p)), p.z);
        const float toArc = q.y < 0 ? std::abs(glm::length(q) - middle) : glm::distance(q, glm::vec2(middle, 0));
        return toArc - 0.5f * wall;
    };
    return exactCollider(shapes::bowl(radius, wall, 256), distance, voxelSize);
}

float lowest(const Mesh& mesh, const btTransform& at) {
    float least = std::numeric_limits<float>::max();
    for (const glm::vec3& point : mesh.points)
        least = std::min(least, float((at * bullet::detail::toBullet(point)).z()));
    return least;
}

std::shared_ptr<const Collider> withoutMesh(const Mesh& mesh, const LevelSet& field) {
    Body body = makeBody(mesh, field, {});
    body.mesh.reset();
    return std::make_shared<Collider>(withBody(field, body));
}

float motion(const btRigidBody& body) {
    return body.getLinearVelocity().length() + body.getAngularVelocity().length();
}

Mesh grooveOf(float slope, float cell, int cells) {
    Mesh groove;
    for (int j = -cells; j <= cells; ++j)
        for (int i = -cells; i <= cells; ++i) {
            const float x = cell * float(i);
            groove.points.push_back({x, cell * float(j), slope * std::abs(x)});
        }
    const unsigned row = 2 * unsigned(cells) + 1;
    for (unsigned j = 0; j + 1 < row; ++j)
        for (unsigned i = 0; i + 1 < row; ++i) {
            const unsigned k = j * row + i;
            groove.triangles.push_back({k, k + 1, k + row + 1});
            groove.triangles.push_back({k, k + row + 1, k + row});
        }
    return groove;
}

}  // namespace bilayer::test
