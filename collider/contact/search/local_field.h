// SPDX-License-Identifier: Apache-2.0
// A field from the view of the other body of a pair: in metres, in the field's axes, with the relative motion of the
// other body.
// Tested by tests/collider/local_field.cpp.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include "collider/contact/body/motion.h"

namespace bilayer::detail {

/// A field in world units [m] and in the axes of its body, with the motion of another body relative to it.
class LocalField {
  public:
    /// @param reach  maximum separation of contacts [m]
    /// @param exact  as ContactOptions::exact
    LocalField(const Placed& field, const Pose& other, const Motion& motion, float reach, bool exact);

    const Collider& collider() const { return collider_; }
    bool isExact() const { return exact_; }  ///< as the constructor's argument
    /// From the field's units to metres.
    float scale() const { return scale_; }
    float voxel() const { return voxel_; }  ///< [m]
    /// The motion of the other body's points relative to the field.
    const RelativeMotion& relativeMotion() const { return relativeMotion_; }
    /// The maximum displacement of the points that are in the field's box. Points that come from afar may move farther
    /// by rotation.
    float maxDisplacement() const { return maxDisplacement_; }

    /// The field at a point.
    struct FieldSample {
        /// `noNormal` is near the surface too, but on the medial axis.
        enum { nearSurface, outside, inside, noNormal } where = noNormal;
        float distance = 0;   ///< [m]
        glm::vec3 normal{0};  ///< of unit length if near the surface
        glm::vec3 gradient{0};

        bool isKnown() const { return where == nearSurface || where == noNormal; }
    };

    /// @param radius  growth of the point [m]
    FieldSample at(const glm::vec3& point, float radius = 0) const;

    /// The contact of a point of the other body's core, grown by a radius.
    std::optional<Contact> probe(const glm::vec3& point, const FieldSample& sample, float radius, std::uint32_t feature,
                                 float margin, ContactReport& report) const;

    /// Contact::approach for a point of the other body.
    float approach(const glm::vec3& point, const glm::vec3& normal, float margin) const;

    Contact contact(const glm::vec3& position, const glm::vec3& normal, float distance, std::uint32_t feature,
                    float approach = 0, float roundingRadius = -1) const;

  private:
    std::optional<Contact> speculativeContact(const glm::vec3& point, const FieldSample& sample, float radius,
                                              std::uint32_t feature, float margin) const;
    FieldSample exactSample(const glm::vec3& point, const Sample& sample) const;
    FieldSample sampleBeyondBand(const glm::vec3& point, float radius, float bound) const;

    const Collider& collider_;
    const Field& field_;
    bool exact_;
    float scale_, voxel_;
    Pose pose_;
    RelativeMotion relativeMotion_;
    float maxDisplacement_;
    float exactReach_;    ///< maximum distance for exact queries of the triangles, where the field has any [m]
    float farReach_ = 0;  ///< the same beyond the band, if contacts there are requested [field's units]
};

}  // namespace bilayer::detail
