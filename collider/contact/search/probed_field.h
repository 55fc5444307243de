// SPDX-License-Identifier: Apache-2.0
// A field that is collided with the triangles of an open surface, and the lengths of the search.
// Tested by tests/bullet/sliding.cpp through bullet::Dispatcher.
#pragma once

#include <bilayer/collider/contact.h>

#include <algorithm>

#include "collider/contact/search/edge_probes.h"
#include "collider/contact/search/local_field.h"

namespace bilayer::detail {

struct ProbedField {
    const Placed& placed;
    LocalField local;
    const ContactOptions& options;
    float margin;   ///< ContactOptions::margin [m]
    float reach;    ///< maximum distance of the field's surface points from a face that they may touch [m]
    float voxel;    ///< [m]
    float spacing;  ///< of probes, and of the field's surface points [m]

    /// @param mesh, motion  pose and motion of the triangles
    ProbedField(const Placed& field, const Pose& mesh, const Motion& motion, const ContactOptions& options)
        : placed(field),
          local(field, mesh, motion, options.margin, options.exact),
          options(options),
          margin(options.margin),
          reach(std::max(margin, field.scale * field.collider.field().interiorWidth()) + local.maxDisplacement()),
          voxel(field.scale * field.collider.field().voxelSize()),
          spacing(probeSpacing * voxel) {}

    /// Maximum distance of relevant triangles from the field's box [m].
    float maxTriangleDistance() const { return margin + local.maxDisplacement(); }
};

/// Replaces the normal of a contact at a point of the triangles by one in the field's axes.
inline void setNormal(Contact& contact, const ProbedField& field, const glm::vec3& normal) {
    const glm::vec3 place = contact.position + contact.distance * contact.normal;
    contact.normal = field.placed.pose.rotation * normal;
    contact.position = place - contact.distance * contact.normal;
}

}  // namespace bilayer::detail
