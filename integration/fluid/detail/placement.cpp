#include "integration/fluid/detail/placement.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <stdexcept>

namespace bilayer::fluid::detail {
namespace {

constexpr float unitTolerance = 1e-3f;  // tolerance of a rotation's length: rounding of float products

bool isFinite(const glm::vec3& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

}  // namespace

void checkPlacement(const Placement& placement) {
    const auto& [position, rotation] = placement.pose;
    if (!isFinite(position)) throw std::invalid_argument("the pose's position is not finite");
    const float length = glm::length(rotation);
    if (!std::isfinite(length)) throw std::invalid_argument("the pose's rotation is not finite");
    if (!(std::abs(length - 1) <= unitTolerance))
        throw std::invalid_argument("the pose's rotation is not of unit length");
    if (!isFinite(placement.scale)) throw std::invalid_argument("the scale is not finite");
    if (!(std::min({placement.scale.x, placement.scale.y, placement.scale.z}) > 0))
        throw std::invalid_argument("the scale is not positive: a mirror would turn the body inside out");
}

}  // namespace bilayer::fluid::detail
