// SPDX-License-Identifier: Apache-2.0
// The size of a posed body, and the transform from the coordinates of one body into those of another.
// Tested by tests/collider/collide.cpp through collide().
#pragma once

#include <bilayer/collider/contact.h>

#include <glm/common.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "collider/field/samples/field_data.h"
#include "sdf/base/access.h"

namespace bilayer::detail {

/// The longest side of a body's bounding box in its own coordinates, times its scale [m].
inline double lengthOf(const Placed& body) {
    return double(body.scale) * double(body.collider.bounds().longestSide());
}

struct BodyTransform {
    glm::mat3 linear;
    glm::vec3 shift;
    float scale;  ///< the factor by which `linear` scales lengths

    BodyTransform(const Pose& from, float fromScale, const Pose& into, float intoScale) : scale(fromScale / intoScale) {
        const Pose pose = relative(into, from);
        linear = scale * glm::mat3_cast(pose.rotation);
        shift = pose.position / intoScale;
    }
    BodyTransform(const Placed& from, const Placed& into)
        : BodyTransform(from.pose, from.scale, into.pose, into.scale) {}
    glm::vec3 operator()(const glm::vec3& point) const { return linear * point + shift; }
    glm::vec3 rotated(const glm::vec3& direction) const { return linear * direction / scale; }

    /// The bounding box of a transformed box, grown by `reach` on all sides.
    Bounds boxAround(const Bounds& box, float reach) const {
        const glm::vec3 centre = (*this)(box.centre()), half = 0.5f * box.size();
        const glm::vec3 extent =
            glm::abs(linear[0]) * half.x + glm::abs(linear[1]) * half.y + glm::abs(linear[2]) * half.z + reach;
        return {centre - extent, centre + extent};
    }

    /// The same transform, into the coarse cells of a field's clearance.
    BodyTransform intoCoarseCells(const Field& field) const {
        const float edge = float(Clearance::cellSide) * field.voxelSize();
        BodyTransform transform = *this;
        transform.scale /= edge;
        transform.linear *= 1 / edge;
        transform.shift = glm::vec3((glm::dvec3(shift) - dataOf(field).origin) / double(edge));
        return transform;
    }
};

}  // namespace bilayer::detail
