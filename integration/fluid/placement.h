// Where a body stands that becomes liquid or solid in a fluid's voxels.
#pragma once

#include <glm/vec3.hpp>

#include <bilayer/collider/pose.h>

namespace bilayer::fluid {

/// A body's place in the world, stretched along its own axes first: body coordinates x become pose.toWorld(scale * x).
struct Placement {
    Pose pose{};
    glm::vec3 scale{1};  ///< positive: a mirror would turn the body inside out

    Placement() = default;
    Placement(const Pose& placed, const glm::vec3& stretch = glm::vec3(1)) : pose(placed), scale(stretch) {}

    glm::dvec3 toWorld(const glm::dvec3& point) const {
        return glm::dquat(pose.rotation) * (glm::dvec3(scale) * point) + glm::dvec3(pose.position);
    }
};

/// Throws std::invalid_argument where a number is not finite, the rotation is not of unit length, or a scale is not
/// positive.
void check(const Placement& placement);

}  // namespace bilayer::fluid
