// SPDX-License-Identifier: Apache-2.0
#include "integration/fluid/detail/placement.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <stdexcept>

#include "sdf/base/finite.h"
#include "sdf/base/unit_tolerance.h"

namespace bilayer::fluid::detail {

void checkPlacement(const Placement& placement) {
    const auto& [position, rotation] = placement.pose;
    if (!bilayer::detail::isFinite(position)) throw std::invalid_argument("the pose's position is not finite");
    const float length = glm::length(rotation);
    if (!std::isfinite(length)) throw std::invalid_argument("the pose's rotation is not finite");
    if (!(std::abs(length - 1) <= bilayer::detail::unitTolerance))
        throw std::invalid_argument("the pose's rotation is not of unit length");
    if (!bilayer::detail::isFinite(placement.scale)) throw std::invalid_argument("the scale is not finite");
    if (!(std::min({placement.scale.x, placement.scale.y, placement.scale.z}) > 0))
        throw std::invalid_argument("the scale is not positive: mirrored, the body would be inside out");
}

}  // namespace bilayer::fluid::detail
