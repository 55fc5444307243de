#include "collider/touch.h"

#include <cmath>
#include <glm/geometric.hpp>

#include "collider/interpolant.h"

namespace bilayer {

namespace {

constexpr float flattest = 0.1f;       // a gradient shorter than this tells no direction: the point is on a medial axis
constexpr float nearestAside = 0.01f;  // [voxels] from an edge or corner: nearer, rounding spoils the way's direction

glm::vec3 directionOf(const glm::vec3& gradient) {
    const float length = glm::length(gradient);
    return length > flattest ? gradient / length : glm::vec3(0);
}

}  // namespace

glm::vec3 directionOf(const ClosestPoint& closest, const glm::vec3& point, float voxelSize) {
    const bool mayBeAside = closest.feature != Feature::face || closest.triangle == noTriangle;
    const bool isAside = mayBeAside && std::abs(closest.distance) > nearestAside * voxelSize;
    return isAside ? (point - closest.position) / closest.distance : closest.normal;
}

Touch touchInBand(const Field& field, const glm::vec3& point, const Sample& sample) {
    if (field.mesh()) {
        const float most = std::abs(sample.distance) + mostInterpolationError * field.voxelSize();
        if (const ClosestPoint closest = field.closest(point, most); closest.found)
            return {closest.distance, directionOf(closest, point, field.voxelSize())};
    }
    return {sample.distance, directionOf(sample.gradient)};
}

}  // namespace bilayer
