// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/incline.h"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

#include "demos/shared/shapes.h"
#include "demos/shared/stage.h"

namespace bilayer::demo {
namespace {

constexpr float gravity = 9.81f;                          // [m/s^2]
constexpr glm::vec3 halfBlock{0.12f, 0.12f, 0.06f};       // low: it would not tip over on a slope of 60 degrees [m]
constexpr float lane = 0.36f;                             // between blocks [m]
constexpr float halfThickness = 0.1f;                     // of the inclines [m]
constexpr float settled = 0.25f;                          // start of the measurement of acceleration [s]
constexpr double maxDrift = 0.1;                          // drift of blocks that stick, over the whole time [voxels]
constexpr float maxSliding = 0.98f, minSticking = 1.02f;  // friction divided by the tangent

constexpr Look rampLook{.colour = 0x35506b, .roughness = 0.6f};
constexpr std::uint32_t slidingColour = 0xe07a5f, stickingColour = 0x81b29a;

// A block and its expected behaviour.
struct Rider {
    btRigidBody& body;
    float slope, friction;  // [rad]; divided by the tangent
    glm::vec3 start{0};
    float speedWhenSettled = 0;

    float acceleration() const { return gravity * (std::sin(slope) - friction * std::tan(slope) * std::cos(slope)); }
};

glm::vec3 positionOf(const btRigidBody& body) {
    const btVector3& p = body.getWorldTransform().getOrigin();
    return {p.x(), p.y(), p.z()};
}

// Adds an incline that descends towards +x, with its lower end at `y`, and one block per friction at its upper end.
void addIncline(Stage& stage, std::vector<Rider>& riders, const InclineOptions& options, float degrees, float y,
                const std::shared_ptr<const BodyPrototype>& block) {
    const float slope = glm::radians(degrees);
    // as long as the fastest block needs, plus a margin
    const float distance = 0.5f * gravity * std::sin(slope) * options.seconds * options.seconds;
    const float halfLength = 0.5f * distance + 4 * halfBlock.x, width = lane * float(options.frictions.size());
    const glm::quat tilt = glm::angleAxis(slope, glm::vec3(0, 1, 0));
    const auto ramp = makePrototype(shapes::box({halfLength, width / 2, halfThickness}), {options.voxelSize});
    const Pose pose{{0, y + width / 2, halfLength * std::sin(slope)}, tilt};
    stage.add(ramp, {.friction = 1}, pose, rampLook);

    for (std::size_t i = 0; i < options.frictions.size(); ++i) {
        const float friction = options.frictions[i];
        const glm::vec3 place(2 * halfBlock.x - halfLength, lane * (float(i) + 0.5f) - width / 2,
                              halfThickness + halfBlock.z);
        const Matter matter{.mass = 1, .friction = friction * std::tan(slope), .linearDamping = 0, .angularDamping = 0};
        btRigidBody& body = stage.add(block, matter, {pose.toWorld(place), tilt},
                                      {.colour = friction < 1 ? slidingColour : stickingColour});
        body.setActivationState(DISABLE_DEACTIVATION);  // a block that drifts must not be put to sleep
        riders.push_back({body, slope, friction, positionOf(body)});
    }
}

std::vector<Criterion> judge(const std::vector<Rider>& riders, double time, float voxelSize) {
    double drift = 0, worst = 0;
    int sticking = 0, sliding = 0, stuck = 0;
    for (const Rider& rider : riders) {
        const double distance = glm::distance(positionOf(rider.body), rider.start);
        if (rider.friction > minSticking) {
            ++sticking;
            drift = worse(drift, distance / voxelSize);
        }
        if (rider.friction < maxSliding) {
            ++sliding;
            const double expected = rider.acceleration();
            const double measured =
                (rider.body.getLinearVelocity().length() - rider.speedWhenSettled) / (time - settled);
            stuck += distance < 0.5 * (0.5 * expected * time * time);
            worst = worse(worst, std::abs(measured / expected - 1));
        }
    }
    std::vector<Criterion> criteria;
    if (sliding > 0)
        criteria = {{"blocks that should slide and stick", double(stuck), 0},
                    {"acceleration off theory", 100 * worst, 2, "%"}};
    if (sticking > 0) criteria.push_back({"drift of blocks that should stick", drift, maxDrift, "voxels"});
    if (criteria.empty()) criteria.push_back({"only frictions for which theory makes no prediction", 1, 0});
    return criteria;
}

}  // namespace

Outcome incline(const InclineOptions& options) {
    Stage stage("Blocks on inclines");
    const auto block = makePrototype(shapes::box(halfBlock), {options.voxelSize});
    std::vector<Rider> riders;
    const float width = lane * float(options.frictions.size() + 1);
    for (std::size_t i = 0; i < options.slopes.size(); ++i)
        addIncline(stage, riders, options, options.slopes[i], width * float(i), block);

    stage.run(settled);
    for (Rider& rider : riders) rider.speedWhenSettled = rider.body.getLinearVelocity().length();
    stage.run(options.seconds);

    const float middle = width * float(options.slopes.size()) / 2;
    Outcome outcome = stage.finish({.target = {0.6f, 1.05f * middle, 1.6f},
                                    .distance = 3.3f * middle,
                                    .azimuth = -0.6f,
                                    .elevation = 0.5f,
                                    .groundHeight = -0.3f});
    outcome.criteria = judge(riders, stage.time(), options.voxelSize);
    return outcome;
}

}  // namespace bilayer::demo
