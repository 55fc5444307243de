// SPDX-License-Identifier: Apache-2.0
// Whether vectors are finite.
// Tested by tests/collider/extremes.cpp.
#pragma once

#include <cmath>
#include <glm/vec3.hpp>

namespace bilayer::detail {

template <class Scalar>
bool isFinite(const glm::vec<3, Scalar>& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

}  // namespace bilayer::detail
