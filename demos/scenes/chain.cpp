// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/chain.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>

#include "demos/shared/shapes.h"
#include "demos/shared/stage.h"

namespace bilayer::demo {
namespace {

constexpr float major = 0.1f, minor = 0.025f;  // of a link's circle and tube [m]
constexpr float bobSize = 1.6f;                // of the last ring [links]
constexpr float linkMass = 0.5f;               // [kg]
constexpr int circlePoints = 96;  // for the integral: more have no effect for distances down to a tenth of the radius
constexpr double maxStretch = 2;  // [%]

constexpr std::uint32_t linkColours[] = {0x9db4d6, 0xf4f1de};
constexpr Look bobLook{.colour = 0xe07a5f, .roughness = 0.35f, .metalness = 0.2f, .clearcoat = 0.4f};

using Circle = std::vector<std::pair<glm::dvec3, glm::dvec3>>;  // points and steps to the next

Circle circleOf(const Pose& pose, double radius) {
    const glm::dquat rotation = glm::normalize(glm::dquat(pose.rotation));
    const double step = 2 * glm::pi<double>() / circlePoints;
    Circle circle;
    for (int i = 0; i < circlePoints; ++i) {
        const double c = std::cos(i * step), s = std::sin(i * step);
        circle.emplace_back(glm::dvec3(pose.position) + radius * (rotation * glm::dvec3(c, s, 0)),
                            radius * step * (rotation * glm::dvec3(-s, c, 0)));
    }
    return circle;
}

// Counts the neighbours whose linking number has changed.
int parted(const std::vector<Pose>& start, const std::vector<Pose>& now) {
    int count = 0;
    for (std::size_t i = 1; i < now.size(); ++i) {
        const double radius = i + 1 == now.size() ? bobSize * major : major;
        const double before = gaussLinkingNumber(start[i - 1], major, start[i], radius);
        const double after = gaussLinkingNumber(now[i - 1], major, now[i], radius);
        count += std::lround(before) != std::lround(after);
    }
    return count;
}

// Returns the length along the rings' centres [m].
double lengthOf(const std::vector<Pose>& poses) {
    double length = 0;
    for (std::size_t i = 1; i < poses.size(); ++i)
        length += glm::distance(glm::dvec3(poses[i].position), glm::dvec3(poses[i - 1].position));
    return length;
}

}  // namespace

// Both integrands are periodic and analytic, so sums at equal steps converge exponentially.
double gaussLinkingNumber(const Pose& a, double radiusA, const Pose& b, double radiusB) {
    const Circle first = circleOf(a, radiusA), second = circleOf(b, radiusB);
    double sum = 0;
    for (const auto& [p, dp] : first)
        for (const auto& [q, dq] : second) {
            const glm::dvec3 gap = p - q;
            const double distance = glm::length(gap);
            sum += glm::dot(gap, glm::cross(dp, dq)) / (distance * distance * distance);
        }
    return sum / (4 * glm::pi<double>());
}

Outcome chain(const ChainOptions& options) {
    Stage stage(fmt::format("A chain of {} rings", options.links), {.stepsPerSecond = options.stepsPerSecond});
    stage.world().bullet().getSolverInfo().m_numIterations = options.iterations;
    const auto link = makePrototype(shapes::torus(major, minor, 64, 24), {options.voxelSize});
    const auto bob = makePrototype(shapes::torus(bobSize * major, bobSize * minor, 64, 24), {options.voxelSize});

    // upright rings, every second one rotated by 90 degrees, each hanging in the previous one, surface on surface
    const glm::quat upright = glm::angleAxis(glm::half_pi<float>(), glm::vec3(1, 0, 0));
    float height = 0, above = 0;  // of the ring's centre; from the centre above to the centre of this one's tube
    for (int i = 0; i < options.links; ++i) {
        const bool isLast = i + 1 == options.links;
        const float size = isLast ? bobSize : 1;
        if (i > 0) height -= above + size * (major - minor);
        above = size * (major - minor);
        const glm::quat rotation = glm::angleAxis(i % 2 * glm::half_pi<float>(), glm::vec3(0, 0, 1));
        const float mass = i == 0 ? 0 : isLast ? options.bob * linkMass : linkMass;
        const Look look = isLast ? bobLook : Look{.colour = linkColours[i % 2], .roughness = 0.3f, .metalness = 0.3f};
        btRigidBody& body = stage.add(isLast ? bob : link, {.mass = mass}, {{0, 0, height}, rotation * upright}, look);
        if (isLast) body.setLinearVelocity({options.push, 0, 0});
        if (mass > 0) body.setActivationState(DISABLE_DEACTIVATION);
    }
    stage.run(options.seconds);

    const auto& frames = stage.frames();
    int largest = 0;
    double longest = 0;
    for (const auto& poses : frames) {
        largest = std::max(largest, parted(frames.front(), poses));
        longest = worse(longest, lengthOf(poses) / lengthOf(frames.front()) - 1);
    }
    Outcome outcome = stage.finish({.target = {0, 0, height + 3 * major},
                                    .distance = 26 * major,
                                    .elevation = -0.14f,
                                    .groundHeight = height - 0.5f});
    outcome.criteria = {{"links that parted", double(largest), 0}, {"stretch", 100 * longest, maxStretch, "%"}};
    return outcome;
}

}  // namespace bilayer::demo
