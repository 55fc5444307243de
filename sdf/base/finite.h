// SPDX-License-Identifier: Apache-2.0
// Whether vectors are finite.
// Tested by tests/collider/extremes.cpp.
#pragma once

#include <cmath>
#include <glm/vec3.hpp>

namespace bilayer::detail {

inline bool isFinite(const glm::vec3& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

}  // namespace bilayer::detail
