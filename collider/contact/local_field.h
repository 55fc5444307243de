// SPDX-License-Identifier: Apache-2.0
// A field from the view of the other body of a pair: in metres, in the field's axes, with the relative motion of the
// other body.
// Tested by tests/bullet/edges.cpp through collideConvex().
#pragma once

#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <optional>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include "collider/contact/edge_search.h"
#include "collider/contact/motion.h"
#include "collider/contact/sharp_edges.h"

namespace bilayer::detail {

// Bits of the number of a probe on an edge. This limits the probes: higher numbers are the features of the next edge.
inline constexpr int probeBits = 15;

/// An edge of the other body, or the axis of a rounded one.
struct ProbedEdge {
    std::function<glm::vec3(float)> place;  ///< by the fraction of the edge
    float radius[2];                        ///< growth at its ends [m]
    bool isStraight;
    std::uint32_t feature;               ///< the first of 2^(probeBits + 1)
    std::optional<Conormals> conormals;  ///< of a sharp edge between two faces
    bool isSearched = true;              ///< whether to search between the probes for deeper points

    float radiusAt(float fraction) const { return radius[0] + fraction * (radius[1] - radius[0]); }
    glm::vec3 directionAt(float fraction) const;
};

/// A field in world units [m] and in the axes of its body, with the motion of another body relative to it.
class LocalField {
  public:
    /// @param reach  maximum separation of contacts [m]
    /// @param exact  as ContactOptions::exact
    LocalField(const Placed& field, const Pose& other, const Motion& motion, float reach, bool exact);

    const Collider& collider() const { return collider_; }
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

    /// Finds the contacts along an edge, ends excluded: those of the probes, and between two probes that of the deepest
    /// point, if the edge is deeper there.
    /// @param first, last  the field at its ends
    void probeEdge(const ProbedEdge& edge, const FieldSample& first, const FieldSample& last, float margin,
                   ContactReport& report, std::vector<Contact>& contacts) const;

    /// The contact at the deepest point of an edge between two probes. Nothing unless the edge descends from either
    /// probe, or crosses a sharp edge.
    std::optional<Contact> deepestContact(const ProbedEdge& edge, float from, const FieldSample& atFrom, float to,
                                          const FieldSample& atTo, float margin) const;

    /// Contact::approach for a point of the other body.
    float approach(const glm::vec3& point, const glm::vec3& normal, float margin) const;

    Contact contact(const glm::vec3& position, const glm::vec3& normal, float distance, std::uint32_t feature,
                    float approach = 0, float turningRadius = -1) const;

  private:
    /// The interval of an edge between two probes.
    struct EdgeInterval {
        const ProbedEdge& edge;
        float from, to;  ///< fractions of the edge
        float length;    ///< [m]

        float fractionAt(float distance) const { return from + distance / length * (to - from); }
    };

    bool mayReach(const glm::vec3& from, const glm::vec3& to, float reach) const;
    std::optional<Contact> speculativeContact(const glm::vec3& point, float radius, std::uint32_t feature, float margin,
                                              float distance) const;
    ValueAndSlope slopeOf(const EdgeInterval& interval, float distance, const FieldSample& sample) const;
    std::optional<SharpEdges::Crossing> crossingAt(const ProbedEdge& edge, float fraction,
                                                   const FieldSample& there) const;
    std::optional<Contact> contactAcross(const EdgeInterval& interval, float distance, const FieldSample& there,
                                         float margin) const;
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
