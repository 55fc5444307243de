// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/terrain.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <limits>
#include <string>
#include <vector>

#include "demos/shared/gears.h"
#include "demos/shared/shapes.h"
#include "demos/shared/stage.h"
#include "demos/shared/waves.h"

namespace bilayer::demo {
namespace {

constexpr float gravity = 9.81f;         // [m/s^2]
constexpr float startX = -5, lane = 1;   // [m]
constexpr float groundVoxel = 0.05f;     // of the field, which Bullet does not use [m]
constexpr float settled = 0.25f;         // start of the speed measurements [s]
constexpr float capsuleRadius = 0.15f;   // [m]
constexpr float rollingFriction = 0.7f;  // coefficient of a body that rolls, and of its ground
constexpr double maxSpeedError = 2;      // [%]
constexpr double maxAngle = 5;           // between a contact normal and those of the triangles around it [degrees]
constexpr double aroundContact = 0.25;   // distance within which triangles count as around it [voxels]
constexpr double maxPenetration = 0.5;   // [voxels]
constexpr double maxEnergyRise = 1e-2;   // [parts of the peak of the kinetic energy]

constexpr Look groundLook{.colour = 0x5b7553, .roughness = 0.9f};

struct Kind {
    std::string name;
    Mesh mesh;
    std::uint32_t colour;
    float radius = 0;  ///< of a body that rolls about the y axis; 0: it does not roll [m]
};

// An upright prism with an L-shaped base, 0.6 m long.
Mesh angleIron() {
    const glm::vec2 outline[] = {{-.3f, -.3f}, {.3f, -.3f}, {.3f, 0}, {0, 0}, {0, .3f}, {-.3f, .3f}};
    Mesh mesh;
    for (const float z : {-0.15f, 0.15f})
        for (const glm::vec2& p : outline) mesh.points.emplace_back(p, z);
    for (unsigned i = 1; i < 5; ++i) {
        mesh.triangles.push_back({0, i + 1, i});
        mesh.triangles.push_back({6, 6 + i, 7 + i});
    }
    for (unsigned i = 0, next = 1; i < 6; ++i, next = (i + 1) % 6) {
        mesh.triangles.push_back({i, next, 6 + next});
        mesh.triangles.push_back({i, 6 + next, 6 + i});
    }
    return mesh;
}

// A capsule along y, 0.7 m long.
Mesh capsule() {
    constexpr float radius = capsuleRadius, half = 0.2f;
    constexpr int rings = 24;
    std::vector<glm::vec2> profile;
    for (int side = -1; side <= 1; side += 2)
        for (int i = 0; i <= rings; ++i) {
            const float angle = glm::radians(90.f) * float(side < 0 ? i - rings : i) / rings;
            const bool isPole = side < 0 ? i == 0 : i == rings;
            profile.emplace_back(isPole ? 0 : radius * std::cos(angle), float(side) * half + radius * std::sin(angle));
        }
    Mesh mesh = shapes::revolve(profile);
    for (glm::vec3& p : mesh.points) p = {p.x, p.z, -p.y};
    return mesh;
}

std::vector<Kind> kinds() {
    shapes::Gear gear{.teeth = 24, .toothModule = 0.025f, .backlash = 1e-3f, .faceWidth = 0.2f, .bore = 0.2f};
    gear.edge = 0.02f;
    return {{"block", shapes::box({0.3f, 0.3f, 0.15f}), 0xe07a5f},
            {"L", angleIron(), 0x81b29a},
            {"gear", shapes::gear(gear), 0x3d5a80},
            {"ball", shapes::sphere(0.25f), 0xf2cc8f, 0.25f},
            {"capsule", capsule(), 0xb56576, capsuleRadius},
            {"bowl", shapes::bowl(0.3f, 0.05f), 0x6d597a}};
}

// A body of 1 kg, and the motion that is expected of it.
struct Rider {
    std::string name;
    btRigidBody& body;
    const World& world;
    double energy = 0;  ///< after it has settled [J]

    double kinetic() const { return kineticEnergyOf(body); }
    double potential() const { return double(gravity) * double(world.middleOfStep(body).z()); }
    /// Returns the error of its speed, by energy: of a point with the kinetic energy of the body [%].
    double speedError() const { return 100 * (std::sqrt(kinetic() / std::max(energy - potential(), 0.0)) - 1); }
    /// Returns the part of its kinetic energy that is in its rotation [%].
    double rotation() const { return 100 * (1 - 0.5 * double(body.getLinearVelocity().length2()) / kinetic()); }
};

float frictionOf(const TerrainOptions& options) {
    return options.rolls ? rollingFriction : 0;
}

/// Rolls a body about the y axis, which it keeps.
void roll(btRigidBody& body, float radius, float speed) {
    body.setAngularFactor({0, 1, 0});
    body.setAngularVelocity({0, speed / radius, 0});
}

std::vector<Rider> addRiders(Stage& stage, const Waves& waves, const TerrainOptions& options) {
    std::vector<Rider> riders;
    const std::vector<Kind> all = kinds();
    for (std::size_t i = 0; i < all.size(); ++i) {
        if (options.rolls && all[i].radius == 0) continue;
        const float y = lane * (float(i) - 0.5f * float(all.size() - 1));
        const auto prototype = makePrototype(all[i].mesh, {options.voxelSize});
        float lowest = 0, farthest = 0;
        for (const glm::vec3& p : all[i].mesh.points) {
            lowest = std::min(lowest, p.z);
            farthest = std::max(farthest, glm::length(glm::vec2(p)));
        }
        const float z = waves.highestAround(startX, y, farthest) - lowest;
        const Matter matter{.mass = 1, .friction = frictionOf(options), .linearDamping = 0, .angularDamping = 0};
        btRigidBody& body = stage.add(prototype, matter, {{startX, y, z}}, {.colour = all[i].colour});
        body.setActivationState(DISABLE_DEACTIVATION);
        body.setLinearVelocity({options.speed, 0, 0});
        body.setLinearFactor({1, 0, 1});  // moves as between frictionless rails: slopes would move it into other lanes
        riders.push_back({all[i].name, body, stage.world()});
        if (options.rolls) roll(body, all[i].radius, options.speed);
    }
    return riders;
}

glm::dvec3 toGlm(const btVector3& v) {
    return {v.x(), v.y(), v.z()};
}

// Counts contacts whose normals deviate from those of the ground.
int ghostsIn(btDispatcher& dispatcher, const btCollisionObject& ground, const Waves& waves, double around) {
    int ghosts = 0;
    for (int m = 0; m < dispatcher.getNumManifolds(); ++m) {
        const btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(m);
        const bool isFirst = manifold.getBody0() == &ground;
        if (!isFirst && manifold.getBody1() != &ground) continue;
        for (int i = 0; i < manifold.getNumContacts(); ++i) {
            const btManifoldPoint& point = manifold.getContactPoint(i);
            const btVector3 onB = point.getPositionWorldOnB(), normalOnB = point.m_normalWorldOnB;
            // friction anchors replace one of the two contact points, and rotating bodies report predicted contact
            // points
            const btVector3 places[] = {isFirst ? point.getPositionWorldOnA() : onB,
                                        isFirst ? onB + point.getDistance() * normalOnB : point.getPositionWorldOnA()};
            double angle = std::numeric_limits<double>::infinity();
            for (const btVector3& place : places)
                angle = std::min(angle,
                                 waves.angleToNormals(toGlm(place), (isFirst ? -1.0 : 1.0) * toGlm(normalOnB), around));
            ghosts += !(glm::degrees(angle) <= maxAngle);
        }
    }
    return ghosts;
}

}  // namespace

Outcome terrain(const TerrainOptions& options) {
    Stage stage("Bodies slide over waves", {.stepsPerSecond = options.stepsPerSecond,
                                            .stepsPerFrame = std::max(1, int(options.stepsPerSecond / 60)),
                                            .framesPerMeasuring = 4,
                                            .smoothGround = options.smoothGround});
    const Waves waves({options.height, options.cell, options.heightField});
    const btRigidBody& ground = stage.add(makePrototype(waves.solid(), waves.shape(), groundVoxel),
                                          {.friction = frictionOf(options)}, {}, groundLook);
    std::vector<Rider> riders = addRiders(stage, waves, options);
    stage.run(settled);
    for (Rider& rider : riders) rider.energy = rider.kinetic() + rider.potential();
    int ghosts = 0;
    stage.run(options.seconds, [&] {
        ghosts += ghostsIn(*stage.world().bullet().getDispatcher(), ground, waves, aroundContact * options.voxelSize);
        return false;
    });

    double worst = 0;
    std::vector<std::pair<std::string, std::string>> facts;
    for (const Rider& rider : riders) {
        worst = worse(worst, std::abs(rider.speedError()));
        facts.emplace_back(
            "speed of the " + rider.name,
            fmt::format("{:.3f} m/s, off by {:.2f} % by energy, {:.1f} % of it in rotation",
                        double(rider.body.getLinearVelocity().length()), rider.speedError(), rider.rotation()));
    }
    Outcome outcome =
        stage.finish({.target = {0, 0, 0}, .distance = 9, .azimuth = -1.1f, .elevation = 0.45f, .groundHeight = -0.4f});
    outcome.facts = std::move(facts);
    outcome.criteria = {{"error of the speed, by energy, against a frictionless point", worst, maxSpeedError, "%"},
                        {"contacts with normals unlike the ground's", double(ghosts), 0},
                        {"deepest penetration", outcome.deepest() / options.voxelSize, maxPenetration, "voxels"},
                        {"rise of energy", outcome.energies.rise(), maxEnergyRise}};
    return outcome;
}

}  // namespace bilayer::demo
