// What a collider samples: distance, gradient, rays. Built from a LevelSet, independent of OpenVDB afterwards.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "sdf/level_set.h"
#include "sdf/mesh.h"

namespace bilayer {

/// The answer to a query at a point.
struct Sample {
    /// In the band: the signed distance [m]. Elsewhere: a bound with the right sign, whose magnitude the true distance
    /// is not below (but for the field's own error), and no distance. A band narrower than sqrt(3) voxels can bound
    /// nothing just beside it: the magnitude is 0 there. +infinity for a point that is not finite.
    float distance = 0;
    /// In the band: the analytic gradient of the same trilinear interpolant (its length is near 1, not exactly 1).
    /// Elsewhere: zero.
    glm::vec3 gradient{0};
    /// All eight voxels around the point are active: sure up to sqrt(3) voxels less than the band's width on either
    /// side.
    bool inBand = false;
};

/// Where a ray meets the surface.
struct RayHit {
    float distance = 0;     ///< along the ray [m]
    glm::vec3 position{0};  ///< [m]
    glm::vec3 normal{0};    ///< outward, of unit length; against the ray if it starts deeper than the band
};

/// A field laid out for queries. Copies share memory. All queries are noexcept, allocate nothing, and may run on any
/// number of threads at once.
class Field {
  public:
    /// Takes about 1.5 times the level set's memory and 4 bytes a block of its box. Throws std::invalid_argument if the
    /// box is so large for its voxels that it holds more than 2^28 blocks of 8^3 voxels.
    explicit Field(const LevelSet& levelSet);

    /// Distance and gradient at a point in the field's own coordinates [m].
    Sample sample(const glm::vec3& point) const noexcept;

    /// The distance alone, with the same meaning as Sample::distance, at half the cost.
    float distance(const glm::vec3& point) const noexcept;

    /// The first point from outside to inside along a ray, by sphere tracing; also when the ray starts inside (distance
    /// 0). The crossing of the interpolant is found to 1e-4 voxels. Chords shorter than a tenth of a voxel may be
    /// missed.
    /// @param direction    of any length but zero
    /// @param maxDistance  [m], may be infinite
    std::optional<RayHit> raycast(const glm::vec3& origin, const glm::vec3& direction,
                                  float maxDistance) const noexcept;

    float voxelSize() const noexcept;       ///< [m]
    float exteriorWidth() const noexcept;   ///< [m]
    float interiorWidth() const noexcept;   ///< [m]
    const Bounds& bounds() const noexcept;  ///< around all points in the band [m]
    std::size_t memoryBytes() const noexcept;

  private:
    struct Data;
    std::shared_ptr<const Data> data_;
};

}  // namespace bilayer
