// The placement of a body that becomes liquid or solid in a fluid's voxels.
// Tested by tests/fluid/seed.cpp.
#pragma once

#include <glm/vec3.hpp>

#include <bilayer/collider/pose.h>

namespace bilayer::fluid {

/// The pose of a body in the world, after scaling along its own axes: body coordinates x become pose.toWorld(scale *
/// x).
struct Placement {
    Pose pose{};
    glm::vec3 scale{1};  ///< positive: a reflection would invert the body

    Placement() = default;
    Placement(const Pose& placed, const glm::vec3& stretch = glm::vec3(1)) : pose(placed), scale(stretch) {}

    glm::dvec3 toWorld(const glm::dvec3& point) const {
        return glm::dquat(pose.rotation) * (glm::dvec3(scale) * point) + glm::dvec3(pose.position);
    }
};

/// Throws std::invalid_argument if a number is not finite, the rotation is not of unit length, or a scale is not
/// positive.
void check(const Placement& placement);

}  // namespace bilayer::fluid
