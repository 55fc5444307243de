// SPDX-License-Identifier: Apache-2.0
// When a moving body first penetrates another one.
// Tested by tests/collider/time_of_impact.cpp through timeOfImpact().
#pragma once

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include <bilayer/collider/contact.h>
#include <bilayer/collider/pose.h>
#include <bilayer/collider/shapes.h>
#include "collider/contact/impact/sweep.h"

namespace bilayer::detail {

/// A shape that is fixed to a moving body.
struct SweptShape {
    const ContactShape& shape;
    const Sweep& sweep;
    Pose local{};     ///< of the shape in the coordinates of the body
    float scale = 1;  ///< positive

    Pose at(double time) const {
        const Pose body = sweep.at(time);
        return {body.toWorld(local.position), body.rotation * local.rotation};
    }
};

/// When and where a body first penetrates another one too deeply.
struct Penetration {
    float time = 1;         ///< fraction of the step; 1: never
    glm::vec3 position{0};  ///< in world coordinates [m]
    glm::vec3 normal{0};    ///< of the surface there; unit vector from B to A

    bool found() const { return time < 1; }
    Penetration reversed() const { return {time, position, -normal}; }
};

/// Returns the earlier of two penetrations of the same bodies. If both are at the same time, as where an edge meets a
/// face, returns the one whose normal opposes the motion more. So the order of bodies and parts does not matter.
/// @param motion  relativeDisplacement() of the bodies [m]
inline Penetration earlier(const Penetration& one, const Penetration& other, const glm::vec3& motion) {
    if (one.time != other.time) return other.time < one.time ? other : one;
    return glm::dot(other.normal, motion) < glm::dot(one.normal, motion) ? other : one;
}

/// When a point of one shape first penetrates the other shape. One of the shapes is a collider. The points are the
/// surface points of a collider, and the vertices and edges of a convex body and of an open surface. A point penetrates
/// where it gets more than a third of a voxel into the other body, or noticeably deeper than it is at the start. So
/// bodies may rest, slide and roll on each other, and start in contact. The time found is at most that at which the
/// point enters.
Penetration firstPenetration(const SweptShape& a, const SweptShape& b);

}  // namespace bilayer::detail
