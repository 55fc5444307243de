// SPDX-License-Identifier: Apache-2.0
// The data of a ContactShape.
// Tested by tests/collider/shapes.cpp through ContactShape.
#pragma once

#include <bilayer/collider/collider.h>
#include <bilayer/collider/shapes.h>

#include <glm/vec3.hpp>
#include <variant>

#include "collider/contact/shapes/convex.h"

namespace bilayer::detail {

/// The half-space of all x with dot(normal, x) <= offset.
struct HalfSpace {
    glm::vec3 normal;  ///< of unit length
    float offset;      ///< [m]
};

struct ContactShapeData {
    std::variant<Collider, Convex, HalfSpace, OpenSurface> shape;
};

}  // namespace bilayer::detail
