// SPDX-License-Identifier: Apache-2.0
// The field of the other body of a pair, as the contact search queries it.
// Tested by tests/collider/collide.cpp through collide().
#pragma once

#include <bilayer/collider/contact.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <optional>

#include "collider/contact/body/collider_data.h"
#include "collider/contact/search/surface_query.h"
#include "sdf/base/access.h"

namespace bilayer::detail {

/// How far a straight edge between two surface points of a body lies over the body's triangles at a place. Exact
/// contacts are between the triangles. In the body's units.
inline float edgeHeight(const Collider& collider, const glm::vec3& place) {
    const ClosestPoint closest = collider.exactField().closest(place, collider.field().voxelSize());
    return closest.found ? std::max(closest.distance, 0.f) : 0;
}

class ContactField {
  public:
    /// @param exact       as ContactOptions::exact
    /// @param beyondBand  whether to search for the surface from points beyond the band, too
    ContactField(const Collider& collider, bool exact, bool beyondBand)
        : collider_(collider),
          field_(exact ? collider.exactField() : collider.field()),
          exact_(exact),
          beyondBand_(beyondBand) {}

    const Field& field() const { return field_; }
    const Collider& collider() const { return collider_; }
    bool isExact() const { return exact_; }  ///< as the constructor's argument
    float voxelSize() const { return field_.voxelSize(); }

    /// The surface near a point in the band, from its sample or from the triangles.
    SurfaceSample inBand(const glm::vec3& point, const Sample& sample) const {
        return surfaceSampleAt(field_, point, sample, dataOf(collider_).isExactAt(point, exact_));
    }

    /// The same at any point. Outside the band the surface is known up to `maxDistance`, if it is searched for there.
    std::optional<SurfaceSample> at(const glm::vec3& point, const Sample& sample, float maxDistance) const {
        if (sample.inBand) return inBand(point, sample);
        if (!beyondBand_ || sample.distance < 0) return std::nullopt;
        const ClosestPoint closest = collider_.exactField().closest(point, maxDistance);
        if (!closest.found) return std::nullopt;
        return SurfaceSample{closest.distance, directionOf(closest, point, field_.voxelSize())};
    }

    /// The speculative contact of a point outside the field with a displacement.
    std::optional<SurfaceSample> impact(const glm::vec3& point, const glm::vec3& displacement) const {
        const auto hit = field_.segment(point, point + displacement);
        if (!hit) return std::nullopt;
        return SurfaceSample{std::max(glm::dot(point - hit->position, hit->normal), 0.f), hit->normal,
                             -glm::dot(displacement, hit->normal)};
    }

    /// The crossing of a sharp edge of another body with one of this body's edges (SharpEdges::crossing()).
    std::optional<SharpEdges::Crossing> crossing(const glm::vec3& from, const glm::vec3& to, const Conormals& conormals,
                                                 const glm::vec3& place, float distance) const {
        return dataOf(collider_).edges().crossing(dataOf(collider_).points(), from, to, conormals, place, distance,
                                                  field_.voxelSize());
    }

  private:
    const Collider& collider_;
    const Field& field_;
    bool exact_, beyondBand_;
};

}  // namespace bilayer::detail
