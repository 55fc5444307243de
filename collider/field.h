// What a collider samples: distance, gradient, rays. Built from a LevelSet, independent of OpenVDB afterwards.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <limits>
#include <memory>
#include <optional>
#include <span>

#include "collider/closest_point.h"
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

    /// The same with its mesh: what is said to be exact below is exact against the triangles. Takes about 140 bytes a
    /// triangle and 6 a vertex more, and up to 80 a triangle for where searches begin, and throws std::invalid_argument
    /// as well if the level set is of another mesh, or the mesh is not valid. Triangles that build() turned around are
    /// turned around in mesh() too.
    Field(const LevelSet& levelSet, Mesh mesh, const FieldOptions& options = {});

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

    /// The closest point of the mesh, wherever the point lies; in the band it takes the least time. Exact: to 1e-5
    /// voxels up to ten voxels away, to a millionth of the distance farther away. The side is that of the normal at the
    /// closest feature; that of the field where the field is not signed by normals, or where normals cancel out. Of
    /// features that are equally near to within that, any one. Nothing is found for a point that is not finite, and
    /// by fields without their mesh.
    /// @param maxDistance  nothing is found beyond [m]
    ClosestPoint closest(const glm::vec3& point,
                         float maxDistance = std::numeric_limits<float>::infinity()) const noexcept;

    /// The same for many points, in less time. Throws std::invalid_argument if `answers` is not as long as `points`.
    void closest(std::span<const glm::vec3> points, std::span<ClosestPoint> answers,
                 float maxDistance = std::numeric_limits<float>::infinity()) const;

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
    const Mesh* mesh() const noexcept;      ///< null for a field without; valid as long as the field or a copy lives
    std::size_t memoryBytes() const noexcept;

  private:
    std::shared_ptr<const FieldData> data_;
};

}  // namespace bilayer
