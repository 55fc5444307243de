// SPDX-License-Identifier: Apache-2.0
// Conversions and checks that the parts of a stored body share.
// Tested by tests/collider/body.cpp through withBody().
#pragma once

#include <openvdb/Types.h>

#include <cmath>
#include <glm/vec3.hpp>
#include <stdexcept>
#include <string>

#include "sdf/base/unit_tolerance.h"

namespace bilayer::detail {

/// Throws the error for a body that cannot be what was written.
[[noreturn]] inline void refuseBody(const std::string& why) {
    throw std::invalid_argument("the body is damaged: " + why);
}

/// Whether a vector or a quaternion has unit length, up to rounding.
inline bool isUnit(float length) {
    return std::abs(length - 1) < unitTolerance;
}

inline openvdb::Vec3s toVdb(const glm::vec3& v) {
    return {v.x, v.y, v.z};
}

inline glm::vec3 toGlm(const openvdb::Vec3s& v) {
    return {v.x(), v.y(), v.z()};
}

}  // namespace bilayer::detail
