// What a collider samples: distance, gradient, rays. Built from a LevelSet, independent of OpenVDB afterwards.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <span>

#include "sdf/clearance.h"
#include "sdf/field_layout.h"
#include "sdf/level_set.h"
#include "sdf/mesh.h"
#include "sdf/sample.h"

namespace bilayer {

/// Where a ray meets the surface.
struct RayHit {
    float distance = 0;     ///< along the ray [m]
    glm::vec3 position{0};  ///< [m]
    glm::vec3 normal{0};    ///< outward, of unit length; against the ray if it starts deeper than the band
};

struct FieldOptions {
    Storage storage = Storage::float32;
};

struct FieldData;

/// A field laid out for queries. Copies share memory. All queries are noexcept, allocate nothing, and may run on any
/// number of threads at once.
class Field {
  public:
    /// Takes about 1.4 times the level set's memory, or half of that with fixed16, and 12 bytes a block of 8^3 voxels
    /// of its box. Throws std::invalid_argument if the box is so large for its voxels that it holds more than 2^26
    /// blocks.
    explicit Field(const LevelSet& levelSet, const FieldOptions& options = {});

    /// Distance and gradient at a point in the field's own coordinates [m].
    Sample sample(const glm::vec3& point) const noexcept;

    /// The same for many points, sorted or not, at a multiple of the speed: the bytes are those of single samples.
    /// Throws std::invalid_argument if `samples` is not as long as `points`.
    void sample(std::span<const glm::vec3> points, std::span<Sample> samples) const;

    /// The same, but with a gradient only where the distance is no more than `reach` [m], and zero elsewhere: less work
    /// where most points are farther away.
    Sample sampleWithin(const glm::vec3& point, float reach) const noexcept;

    /// The distance alone, with the same meaning as Sample::distance, at half the cost.
    float distance(const glm::vec3& point) const noexcept;

    /// The first point from outside to inside along a ray, by sphere tracing; also when the ray starts inside (distance
    /// 0). The crossing of the interpolant is found to 1e-4 voxels. Chords shorter than a tenth of a voxel may be
    /// missed.
    /// @param direction    of any length but zero
    /// @param maxDistance  [m], may be infinite
    std::optional<RayHit> raycast(const glm::vec3& origin, const glm::vec3& direction,
                                  float maxDistance) const noexcept;

    /// Valid as long as the field or a copy of it lives.
    Clearance clearance() const noexcept;
    glm::dvec3 origin() const noexcept;  ///< [m]

    float voxelSize() const noexcept;       ///< [m]
    float exteriorWidth() const noexcept;   ///< [m]
    float interiorWidth() const noexcept;   ///< [m]
    const Bounds& bounds() const noexcept;  ///< around all points in the band [m]
    std::size_t memoryBytes() const noexcept;

  private:
    std::shared_ptr<const FieldData> data_;
};

}  // namespace bilayer
