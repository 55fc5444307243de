// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/spin.h"

#include <fmt/core.h>

#include <cmath>
#include <glm/geometric.hpp>

#include <bilayer/collider/mass.h>
#include <bilayer/integration/bullet/extensions.h>
#include "demos/shared/shapes.h"
#include "demos/shared/stage.h"

namespace bilayer::demo {

using namespace bilayer::detail;
namespace {

constexpr float size = 0.05f, halfThickness = 0.04f;  // of the handle's squares; of the handle [m]
constexpr float mass = 2;                             // [kg]

// A T of squares, three across and four down. Its three moments of inertia differ by tens of percent.
Mesh handle() {
    constexpr glm::vec2 outline[] = {{-3, 1}, {-1, 1}, {1, 1},   {3, 1},   {3, -1},
                                     {1, -1}, {1, -9}, {-1, -9}, {-1, -1}, {-3, -1}};
    constexpr unsigned count = std::size(outline);
    Mesh mesh;
    for (const float z : {-halfThickness, halfThickness})
        for (const glm::vec2& corner : outline) mesh.points.push_back(glm::vec3(size / 2 * corner, z));
    const auto quad = [&](unsigned a, unsigned b, unsigned c, unsigned d) {
        mesh.triangles.push_back({a, b, c});
        mesh.triangles.push_back({a, c, d});
    };
    // clockwise as seen from above
    for (unsigned i = 0, next = 1; i < count; ++i, next = (i + 1) % count) quad(i, count + i, count + next, next);
    constexpr unsigned squares[][4] = {{0, 1, 8, 9}, {1, 2, 5, 8}, {2, 3, 4, 5}, {8, 5, 6, 7}};
    for (const auto& [a, b, c, d] : squares) {
        quad(a, b, c, d);
        quad(count + d, count + c, count + b, count + a);
    }
    return mesh;
}

glm::dvec3 angularMomentum(const btRigidBody& body) {
    const btMatrix3x3& axes = body.getWorldTransform().getBasis();
    const btVector3 spin = axes.transpose() * body.getAngularVelocity();
    glm::dvec3 inBody, inWorld(0);
    for (int i = 0; i < 3; ++i) inBody[i] = double(spin[i]) / double(body.getInvInertiaDiagLocal()[i]);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) inWorld[i] += double(axes[i][j]) * inBody[j];
    return inWorld;
}

// Returns the max relative difference of the mass and moments of inertia of two solids.
double difference(const MassProperties& a, const MassProperties& b) {
    double largest = std::abs(a.volume / b.volume - 1);
    for (int i = 0; i < 3; ++i)
        largest = worse(largest, std::abs(double(a.principalInertia[i]) / b.principalInertia[i] - 1));
    return largest;
}

}  // namespace

Outcome spin(const SpinOptions& options) {
    Stage stage("A free body that spins");
    stage.world().bullet().setGravity({0, 0, 0});
    const bullet::WorldExtensions keeps(stage.world().bullet(),
                                        {.continuousCollision = false, .gyroscopicIntegration = true});
    const auto prototype = makePrototype(handle(), {options.voxelSize});
    btRigidBody& body = stage.add(prototype, {.mass = mass, .linearDamping = 0, .angularDamping = 0}, {},
                                  {.colour = 0xf2cc8f, .roughness = 0.4f, .clearcoat = 0.4f});
    // the body's axes are the principal axes, in ascending order of their moments
    body.setActivationState(DISABLE_DEACTIVATION);
    const btVector3 middle = body.getWorldTransform().getBasis().getColumn(1);
    body.setAngularVelocity(body.getWorldTransform().getBasis() *
                            btVector3(options.perturbation, options.spin, options.perturbation));

    const glm::dvec3 start = angularMomentum(body);
    double drift = 0;
    int turns = 0;
    float side = 1;
    stage.run(options.seconds, [&] {
        drift = worse(drift, glm::distance(angularMomentum(body), start) / glm::length(start));
        // the handle has flipped over when the intermediate axis points in the opposite direction
        const float cosine = body.getWorldTransform().getBasis().getColumn(1).dot(middle);
        if (side * cosine < -0.5f) {
            side = -side;
            ++turns;
        }
        return false;
    });

    Outcome outcome = stage.finish({.distance = 1.2f, .elevation = 0.4f, .groundHeight = -0.5f});
    outcome.facts.emplace_back("turned over", fmt::format("{} times", turns));
    outcome.criteria = {
        {"drift of angular momentum a minute", 100 * drift * 60 / stage.time(), 1, "%"},
        {"did not turn over", double(turns == 0), 0},
        {"error of the field's mass and inertia",
         100 * difference(massProperties(prototype->field), massProperties(prototype->mesh)), 0.5, "%"}};
    return outcome;
}

}  // namespace bilayer::demo
