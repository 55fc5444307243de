// SPDX-License-Identifier: Apache-2.0
// The transform from the coordinates of one body into those of another.
// Tested by tests/collider/collide.cpp.
#pragma once

#include <bilayer/collider/contact.h>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "collider/field/field_data.h"

namespace bilayer::detail {

struct BodyTransform {
    glm::mat3 linear;
    glm::vec3 shift;
    float scale;  ///< the factor by which `linear` scales lengths

    BodyTransform(const Placed& from, const Placed& into) : scale(from.scale / into.scale) {
        const Pose pose = relative(into.pose, from.pose);
        linear = scale * glm::mat3_cast(pose.rotation);
        shift = pose.position / into.scale;
    }
    glm::vec3 operator()(const glm::vec3& point) const { return linear * point + shift; }
    glm::vec3 rotated(const glm::vec3& direction) const { return linear * direction / scale; }

    /// The same transform, into the coarse cells of a field's clearance.
    BodyTransform intoCoarseCells(const Field& field) const {
        const float edge = float(Clearance::partSide) * field.voxelSize();
        BodyTransform transform = *this;
        transform.scale /= edge;
        transform.linear *= 1 / edge;
        transform.shift = glm::vec3((glm::dvec3(shift) - field.origin()) / double(edge));
        return transform;
    }
};

}  // namespace bilayer::detail
