// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/plates.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <map>

#include "demos/shared/shapes.h"
#include "demos/shared/stage.h"

namespace bilayer::demo {
namespace {

constexpr float radius = 0.05f, halfPlate = 0.3f;  // of balls and plates [m]
constexpr float lane = 0.8f;                       // between balls side by side, and between the heights of plates [m]
constexpr float stepsBefore = 4, stepsAfter = 40;  // before and after the impact
constexpr double rounding = 1e-3;                  // allowed relative energy gain

constexpr Look plateLook{.colour = 0x35506b, .roughness = 0.3f, .opacity = 0.8f};
constexpr std::uint32_t colours[] = {0x81b29a, 0xf2cc8f, 0xe07a5f};  // from slow to fast

struct Shot {
    btRigidBody& ball;
    Pose plate;              // its z points towards the start of the ball
    float speed, thickness;  // [m/s], [voxels]
    glm::vec3 last;          // previous position of the ball
    bool passed = false, lost = false, gained = false;
};

std::uint32_t colourOf(float speed) {
    const float decade = std::max(0.f, std::log10(speed));
    return colours[std::min(std::size_t(decade), std::size(colours) - 1)];
}

// Balls fall straight down, side by side, and plates are rotated. All impacts happen in the same step.
Shot addLane(Stage& stage, const PlatesOptions& options, const std::shared_ptr<const BodyPrototype>& ball,
             const std::shared_ptr<const BodyPrototype>& plate, const glm::vec3& place, float angle, float thickness,
             float speed, float phase) {
    const glm::quat tilt = glm::angleAxis(glm::radians(angle), glm::vec3(0, 1, 0));
    stage.add(plate, {.friction = 0.5f, .restitution = 1}, {place, tilt}, plateLook);
    const float touching = (radius + 0.5f * thickness * options.voxelSize) / std::cos(glm::radians(angle));
    const float above = touching + speed * (stepsBefore + phase) / options.stepsPerSecond;
    const Matter matter{.mass = 1, .restitution = options.restitution, .linearDamping = 0, .angularDamping = 0};
    btRigidBody& body = stage.add(ball, matter, {place + glm::vec3(0, 0, above)},
                                  {.colour = colourOf(speed), .roughness = 0.3f, .clearcoat = 0.5f});
    body.setLinearVelocity({0, 0, -speed});
    body.setActivationState(DISABLE_DEACTIVATION);
    return {body, {place, tilt}, speed, thickness, place + glm::vec3(0, 0, above)};
}

// Returns whether the ball's centre has passed through its plate; farther out it has passed the border.
bool passes(const Shot& shot, const glm::vec3& now) {
    const glm::vec3 before = shot.plate.toBody(shot.last), after = shot.plate.toBody(now);
    if (before.z < 0 || after.z >= 0) return false;
    const glm::vec3 place = glm::mix(before, after, before.z / (before.z - after.z));
    return std::max(std::abs(place.x), std::abs(place.y)) < halfPlate;
}

void watch(Shot& shot) {
    const btVector3 &p = shot.ball.getWorldTransform().getOrigin(), &v = shot.ball.getLinearVelocity();
    const double spin = radius * double(shot.ball.getAngularVelocity().length());
    const double squares = double(v.length2()) + 0.4 * spin * spin;  // proportional to a ball's energy
    shot.lost = shot.lost || !std::isfinite(double(p.length2()) + squares);
    const glm::vec3 now(p.x(), p.y(), p.z());
    shot.passed = shot.passed || passes(shot, now);
    shot.last = now;
    shot.gained = shot.gained || squares > (1 + rounding) * double(shot.speed) * shot.speed;
}

// Returns the count of failures for each thickness and speed that has any.
std::string describe(const std::vector<Shot>& shots, bool Shot::*failed) {
    std::string text;
    std::map<std::pair<float, float>, std::pair<int, int>> counts;
    for (const Shot& shot : shots) {
        auto& [bad, all] = counts[{shot.thickness, shot.speed}];
        bad += shot.*failed;
        ++all;
    }
    for (const auto& [what, count] : counts)
        if (count.first > 0)
            text += fmt::format("{}{} voxels at {} m/s {}/{}", text.empty() ? "" : ", ", what.first, what.second,
                                count.first, count.second);
    return text.empty() ? "none" : text;
}

}  // namespace

Outcome plates(const PlatesOptions& options) {
    Stage stage("Balls shot at thin plates", {.stepsPerSecond = options.stepsPerSecond, .stepsPerFrame = 1});
    stage.world().bullet().setGravity({0, 0, 0});
    const auto ball = makePrototype(shapes::sphere(radius, 4), {options.voxelSize});
    std::vector<Shot> shots;
    float row = 0;
    for (const float thickness : options.thicknesses) {
        const glm::vec3 half(halfPlate, halfPlate, 0.5f * thickness * options.voxelSize);
        const auto plate = makePrototype(shapes::box(half), {options.voxelSize});
        for (const float angle : options.angles)
            for (int phase = 0; phase < options.phases; ++phase, ++row)
                for (std::size_t i = 0; i < options.speeds.size(); ++i) {
                    // lanes form steps, so that a deflected ball hits no other plate
                    const glm::vec3 place(lane * row, lane * float(i), lane * row);
                    shots.push_back(addLane(stage, options, ball, plate, place, angle, thickness, options.speeds[i],
                                            float(phase) / float(options.phases)));
                }
    }
    stage.run((stepsBefore + stepsAfter) / options.stepsPerSecond, [&] {
        for (Shot& shot : shots) watch(shot);
        return false;
    });
    const auto count = [&](bool Shot::*what) {
        return double(std::count_if(shots.begin(), shots.end(), [&](const Shot& shot) { return shot.*what; }));
    };
    const float middle = lane * row / 2;
    Outcome outcome = stage.finish({.target = {1.2f * middle, lane * 3, middle},
                                    .distance = 5.2f * middle,
                                    .azimuth = -1.75f,
                                    .elevation = 0.75f,
                                    .groundHeight = -1});
    outcome.facts = {{"balls", std::to_string(shots.size())},
                     {"passed", describe(shots, &Shot::passed)},
                     {"faster than before", describe(shots, &Shot::gained)}};
    outcome.criteria = {{"balls that passed their plate", count(&Shot::passed), 0},
                        {"balls with NaN", count(&Shot::lost), 0},
                        {"balls faster than before", count(&Shot::gained), 0}};
    return outcome;
}

}  // namespace bilayer::demo
