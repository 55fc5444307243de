// SPDX-License-Identifier: Apache-2.0
// The contacts of another body's edges with a field.
// Tested by tests/bullet/edges.cpp through collideConvex().
#pragma once

#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <optional>
#include <vector>

#include "collider/contact/body/sharp_edges.h"
#include "collider/contact/search/edge_search.h"
#include "collider/contact/search/local_field.h"

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

/// Finds contacts along edges.
class EdgeContacts {
  public:
    using FieldSample = LocalField::FieldSample;

    /// @param margin  maximum separation of contacts [m]
    EdgeContacts(const LocalField& field, float margin) : field_(field), margin_(margin) {}

    /// Finds the contacts along an edge, ends excluded: those of the probes, and between two probes that of the deepest
    /// point, if the edge is deeper there.
    /// @param first, last  the field at its ends
    void find(const ProbedEdge& edge, const FieldSample& first, const FieldSample& last, ContactReport& report,
              std::vector<Contact>& contacts) const;

    /// The contact at the deepest point of an edge between two probes. Nothing unless the edge descends from either
    /// probe, or crosses a sharp edge.
    std::optional<Contact> deepest(const ProbedEdge& edge, float from, const FieldSample& atFrom, float to,
                                   const FieldSample& atTo) const;

  private:
    /// The interval of an edge between two probes.
    struct Interval {
        const ProbedEdge& edge;
        float from, to;  ///< fractions of the edge
        float length;    ///< [m]

        float fractionAt(float distance) const { return from + distance / length * (to - from); }
    };

    bool mayReach(const glm::vec3& from, const glm::vec3& to, float reach) const;
    FieldSample sampleAt(const ProbedEdge& edge, float fraction) const;
    ValueAndSlope slopeOf(const Interval& interval, float distance, const FieldSample& sample) const;
    std::optional<SharpEdges::Crossing> crossingAt(const ProbedEdge& edge, float fraction,
                                                   const FieldSample& there) const;
    std::optional<Contact> across(const Interval& interval, float distance, const FieldSample& there) const;

    const LocalField& field_;
    float margin_;
};

}  // namespace bilayer::detail
