// What a collider samples: distance, gradient, rays. Built from a LevelSet, independent of OpenVDB afterwards.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <limits>
#include <memory>
#include <optional>
#include <span>

#include <bilayer/collider/query.h>
#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>

namespace bilayer {

namespace detail {
struct FieldData;
}

/// How a layout keeps its distances.
enum class Storage {
    float32,
    /// In steps of the wider half of the band over 32,766: distances are off by half a step, 4.6e-5 voxels for a half
    /// width of 3, in half the memory.
    fixed16,
};

struct FieldOptions {
    Storage storage = Storage::float32;
};

/// A field laid out for queries. Copies share memory. All queries are noexcept, allocate nothing, and may run on any
/// number of threads at once.
class Field {
  public:
    /// Takes about 1.4 times the level set's memory, or half of that with fixed16, and 12 bytes a block of 8^3 voxels
    /// of its box. Throws std::invalid_argument if the box is so large for its voxels that it holds more than 2^26
    /// blocks, or more than 2^19 along an axis.
    explicit Field(const LevelSet& levelSet, const FieldOptions& options = {});

    /// The same with its mesh: what is said to be exact below is exact against the triangles. Takes about 140 bytes a
    /// triangle and 6 a vertex more, and 64 to 384 a stored block for where searches begin, and throws
    /// std::invalid_argument as well if the level set is of another mesh, or the mesh is not valid. Triangles that
    /// build() turned around are turned around in mesh() too.
    Field(const LevelSet& levelSet, Mesh mesh, const FieldOptions& options = {});

    /// Of data that the library shares.
    explicit Field(std::shared_ptr<const detail::FieldData> data);

    /// Distance and gradient at a point in the field's own coordinates [m].
    Sample sample(const glm::vec3& point) const noexcept { return sample_(*data_, point); }

    /// The same for many points, sorted or not, at a multiple of the speed: the bytes are those of single samples.
    /// Throws std::invalid_argument if `samples` is not as long as `points`.
    void sample(std::span<const glm::vec3> points, std::span<Sample> samples) const;

    /// The same, but with a gradient only where the distance is no more than `reach` [m], and zero elsewhere: less work
    /// where most points are farther away.
    Sample sampleWithin(const glm::vec3& point, float reach) const noexcept;

    /// The distance alone, with the same meaning as Sample::distance.
    float distance(const glm::vec3& point) const noexcept;

    /// The closest point of the surface, wherever the point lies; in the band it takes the least time. With the mesh it
    /// is exact: to 1e-5 voxels up to ten voxels away, to a millionth of the distance farther away. The side is the
    /// field's wherever that is certain, which is what inside() and the sign of sample() have there: farther than a
    /// voxel's diagonal from the surface, and mostly nearer. Else it is that of the normal at the closest feature, or
    /// of the sample where normals cancel out, or where the field is not signed by normals and does not confirm that
    /// the wall divides inside from outside. Of features that are equally near to within that, any one; but at an edge
    /// or a corner itself, to 1e-5 voxels or the rounding of the point, the edge or the corner. Without the mesh it is
    /// the closest zero of the interpolant to 1e-3 voxels, found a hundred times as slowly; in a band narrower than
    /// sqrt(3) voxels some zeros may be unknown. Nothing is found for a point that is not finite, nor for a distance
    /// that is negative or NaN.
    /// @param maxDistance  nothing is found beyond [m]
    ClosestPoint closest(const glm::vec3& point,
                         float maxDistance = std::numeric_limits<float>::infinity()) const noexcept;

    /// The same for many points, in less time. Throws std::invalid_argument if `answers` is not as long as `points`.
    void closest(std::span<const glm::vec3> points, std::span<ClosestPoint> answers,
                 float maxDistance = std::numeric_limits<float>::infinity()) const;

    /// Whether a point is inside. Exact with the mesh (as closest()); without it, the sign of the sample. False for a
    /// point that is not finite.
    bool inside(const glm::vec3& point) const noexcept;

    /// The first point of a ray that lies inside: at distance 0 if its origin does. With the mesh, from outside, the
    /// first triangle that the ray meets from either side, in double precision: nothing slips through between triangles
    /// that share an edge, nor through gaps of 1e-5 voxels. Without it, the first point where the interpolant is
    /// negative, to 1e-9 voxels, however short the chord. No hit for a ray whose origin or direction is not finite,
    /// whose direction is zero, or whose length is negative or NaN.
    std::optional<RayHit> raycast(const Ray& ray) const noexcept;

    /// The same along the straight way from one point to another; where these are the same, a hit if it is inside.
    std::optional<RayHit> segment(const glm::vec3& from, const glm::vec3& to) const noexcept;

    /// The first place along a ray where a sphere touches the surface: RayHit::distance is its centre's way, 0 if the
    /// sphere meets the solid where it starts. Without the mesh to 1e-3 voxels: where a sphere only grazes the surface
    /// by less, either answer may come. No hit where raycast() has none, nor for a radius that is negative or not
    /// finite.
    /// @param radius  [m], from 0 on; as large as may be
    std::optional<RayHit> sphereCast(const Ray& ray, float radius) const noexcept;

    /// Whether a sphere and the solid have a point in common. Without the mesh to 1e-3 voxels. False for what is not
    /// finite or negative.
    bool overlapsSphere(const glm::vec3& centre, float radius) const noexcept;

    /// The same for a box. False as well where the box's rotation is not finite or zero.
    bool overlapsBox(const OrientedBox& box) const noexcept;

    /// The above for many at once. Throw std::invalid_argument unless there are as many answers as questions.
    void inside(std::span<const glm::vec3> points, std::span<bool> answers) const;
    void raycast(std::span<const Ray> rays, std::span<std::optional<RayHit>> hits) const;
    void segment(std::span<const glm::vec3> from, std::span<const glm::vec3> to,
                 std::span<std::optional<RayHit>> hits) const;
    void sphereCast(std::span<const Ray> rays, std::span<const float> radii,
                    std::span<std::optional<RayHit>> hits) const;
    void overlapsSphere(std::span<const glm::vec3> centres, std::span<const float> radii,
                        std::span<bool> answers) const;
    void overlapsBox(std::span<const OrientedBox> boxes, std::span<bool> answers) const;

    glm::dvec3 origin() const noexcept;     ///< of the box around the band [m]
    float voxelSize() const noexcept;       ///< [m]
    float exteriorWidth() const noexcept;   ///< [m]
    float interiorWidth() const noexcept;   ///< [m]
    const Bounds& bounds() const noexcept;  ///< around all points in the band [m]
    /// Null for a field without; valid as long as the field or a copy lives.
    const Mesh* mesh() const noexcept;
    /// What all queries work from, for the library itself; valid as long as the field or a copy of it lives.
    const detail::FieldData& data() const noexcept { return *data_; }
    std::size_t memoryBytes() const noexcept;

  private:
    std::shared_ptr<const detail::FieldData> data_;
    Sample (*sample_)(const detail::FieldData&, const glm::vec3&) noexcept;  // the best for this processor
};

}  // namespace bilayer
