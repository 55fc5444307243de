// SPDX-License-Identifier: Apache-2.0
// On which side of a field's surface a point lies.
// Tested by tests/collider/field_closest.cpp through closest().
#pragma once

#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "collider/field/samples/field_data.h"

namespace bilayer::detail {

/// The field's answer to the side of a point.
struct FieldSide {
    bool inside, certain;
    float distance;  ///< of the nearest voxel if that is certain, else of the sample [m]
};

/// The height of a point over its nearest feature, along the feature's normal. The normal of an edge or vertex may be
/// shorter than 1, and the height is then smaller by the same factor.
inline double heightOver(const NearestFeature& nearest) {
    return -glm::dot(nearest.normal, nearest.offset);
}

/// Decides by the rules at Field::closest(). A view of a field.
class SideQuery {
  public:
    explicit SideQuery(const FieldData& field) : field_(field) {}

    /// The side by the field alone.
    /// @param local  in the field's frame [voxels]
    FieldSide at(const glm::dvec3& local) const;
    /// Prefetches the data that at() reads.
    void fetch(const glm::dvec3& local) const;

    /// Whether a point is inside, by the field, the mesh and winding numbers.
    /// @param nearest  the feature of the mesh nearest to the point
    bool isInside(const NearestFeature& nearest, const glm::vec3& point) const;

  private:
    struct Probes {
        float outer, inner;  ///< samples [m]
    };

    std::ptrdiff_t nearestVoxel(const glm::dvec3& local) const;
    Probes probesAt(const glm::dvec3& place, const glm::dvec3& normal) const;
    bool divides(const glm::dvec3& place, const glm::dvec3& normal) const;
    bool isNextToWall(const NearestFeature& nearest, const glm::vec3& point) const;
    bool confirms(const NearestFeature& nearest, const FieldSide& side) const;
    bool isBehind(const NearestFeature& nearest, const FieldSide& side, const glm::vec3& point) const;

    const FieldData& field_;
};

}  // namespace bilayer::detail
