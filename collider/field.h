// SPDX-License-Identifier: Apache-2.0
// Sampled distance fields: distance, gradient, closest point, ray and sphere casts. Built from a LevelSet, then
// independent of OpenVDB. A TiledField samples a field that does not fit into memory.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <filesystem>
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

struct Access;
struct FieldData;
class TiledFieldData;

using Floats [[gnu::vector_size(16)]] = float;

/// The block that a FieldSampler sampled last.
struct LastBlock {
    /// The block's coordinates x, y, y, z: the upper words of the fixed-point positions in it. The initial value has
    /// two different y, so that no position is in it.
    alignas(16) std::array<std::uint32_t, 4> place{0, 0, 1, 0};
    const void* first = nullptr;  ///< its first voxel
};

}  // namespace detail

/// How a field stores its distances.
enum class Storage {
    float32,  ///< as the level set holds them: no rounding
    /// Fixed-point steps of (wider half of the band) / 32,766. The error is half a step: 4.6e-5 voxels for a half width
    /// of 3. Takes half the memory.
    fixed16,
};

/// Options for laying out a field.
struct FieldOptions {
    Storage storage = Storage::float32;  ///< how distances are stored
};

/// A level set laid out for queries. Copies share memory. All queries are noexcept, allocate nothing, and may run on
/// any number of threads at once.
class Field {
  public:
    /// Takes about 1.4 times the memory of the level set (half of that with fixed16), plus 12 bytes per block of 8^3
    /// voxels in its bounding box. Throws std::invalid_argument if the box holds more than 2^26 blocks, or more than
    /// 2^19 along an axis.
    explicit Field(const LevelSet& levelSet, const FieldOptions& options = {});

    /// The same with its mesh: queries marked exact below are then exact with respect to the triangles. Takes about 140
    /// bytes per triangle, 6 per vertex and 64 to 384 per stored block in addition; the latter hold the entry points of
    /// searches. Also throws std::invalid_argument if the level set belongs to another mesh, or if the mesh is invalid.
    /// Triangles that build() flipped are flipped in mesh() too.
    Field(const LevelSet& levelSet, Mesh mesh, const FieldOptions& options = {});

    /// Distance and gradient at a point in field coordinates [m].
    Sample sample(const glm::vec3& point) const noexcept { return sample_(*data_, point); }

    /// The same for many points in any order, several times faster. The results equal single samples bit for bit.
    /// Throws std::invalid_argument if the spans differ in length.
    void sample(std::span<const glm::vec3> points, std::span<Sample> samples) const;

    /// The same, but the gradient is computed only where the distance is at most `reach` [m], and is zero elsewhere.
    /// Faster if most points are farther away.
    Sample sampleWithin(const glm::vec3& point, float reach) const noexcept;

    /// The distance only, as Sample::distance.
    float distance(const glm::vec3& point) const noexcept;

    /// The closest point of the surface, from any distance. Fastest in the band.
    ///
    /// With the mesh:
    /// - The result is exact to 1e-5 voxels up to ten voxels away, and to a millionth of the distance beyond.
    /// - The sign is the field's wherever that is certain: farther than a voxel's diagonal from the surface, and mostly
    ///   nearer. inside() and the sign of sample() agree with it there, with one exception: sample() in a hole wider
    ///   than a voxel, where the side changes between two voxels without a surface.
    /// - Where the field is not certain, the kind of mesh decides:
    ///   - closed, signed by winding numbers: the winding number.
    ///   - closed, signed by normals: the normal at the closest feature, where the sample agrees with it or both are
    ///     within a tenth of a voxel of the surface; else the winding number. The normal errs only where the surface
    ///     comes within a voxel of itself.
    ///   - open, signed by winding numbers: the winding number; over a face with no other surface within a voxel the
    ///     normal, which is faster.
    ///   - others: the normal if the field confirms that the wall separates inside from outside, else the sample.
    /// - Any one of the features that are equally close within the tolerance is returned. At an edge or vertex itself,
    ///   to 1e-5 voxels or the rounding of the point, it is that edge or vertex.
    ///
    /// Without the mesh, the result is the closest zero of the interpolant to 1e-3 voxels, a hundred times slower. A
    /// zero nearer than maxDistance by less than 1e-4 voxels may be missed. The time is at most proportional to the
    /// surface, as at the centre of a sphere. In a band narrower than sqrt(3) voxels some zeros may be missed.
    ///
    /// Finds nothing for a non-finite point, nor for a negative or NaN maxDistance.
    /// @param maxDistance  search radius [m]
    ClosestPoint closest(const glm::vec3& point,
                         float maxDistance = std::numeric_limits<float>::infinity()) const noexcept;

    /// The same for many points, faster. Throws std::invalid_argument if the spans differ in length.
    void closest(std::span<const glm::vec3> points, std::span<ClosestPoint> answers,
                 float maxDistance = std::numeric_limits<float>::infinity()) const;

    /// Whether a point is inside. Exact with the mesh, as closest(); otherwise the sign of the sample. False for a
    /// non-finite point.
    bool inside(const glm::vec3& point) const noexcept;

    /// The first point of a ray inside the solid; at distance 0 if the origin is inside. With the mesh and from
    /// outside, it is the first triangle hit from either side, in double precision. The test is watertight: no ray
    /// passes between triangles that share an edge, nor through gaps of 1e-5 voxels. Without the mesh, it is the first
    /// point with a negative interpolant, to 1e-9 voxels, for chords of any length. No hit for a ray with a non-finite
    /// origin or direction, a zero direction, or a negative or NaN length.
    std::optional<RayHit> raycast(const Ray& ray) const noexcept;

    /// The same along a segment. If both ends are equal: a hit if that point is inside.
    std::optional<RayHit> segment(const glm::vec3& from, const glm::vec3& to) const noexcept;

    /// The first contact of a sphere swept along a ray. RayHit::distance is the path length of its centre, or 0 if the
    /// sphere overlaps the solid at the start. Without the mesh it is found to 1e-3 voxels; a sphere that grazes the
    /// surface by less may hit or miss. No hit in the cases of raycast(), nor for a negative or non-finite radius.
    /// @param radius  non-negative, without upper limit [m]
    std::optional<RayHit> sphereCast(const Ray& ray, float radius) const noexcept;

    /// Whether a sphere and the solid overlap. Decided to 1e-3 voxels without the mesh. False for non-finite or
    /// negative arguments.
    bool overlapsSphere(const glm::vec3& centre, float radius) const noexcept;

    /// The same for a box. Also false if the box's rotation is not finite or zero.
    bool overlapsBox(const OrientedBox& box) const noexcept;

    /// Batch versions of the above. They throw std::invalid_argument if the spans differ in length.
    void inside(std::span<const glm::vec3> points, std::span<bool> answers) const;
    /// raycast() of each ray.
    void raycast(std::span<const Ray> rays, std::span<std::optional<RayHit>> hits) const;
    /// segment() of each pair of points.
    void segment(std::span<const glm::vec3> from, std::span<const glm::vec3> to,
                 std::span<std::optional<RayHit>> hits) const;
    /// sphereCast() of each ray with its radius.
    void sphereCast(std::span<const Ray> rays, std::span<const float> radii,
                    std::span<std::optional<RayHit>> hits) const;
    /// overlapsSphere() of each centre with its radius.
    void overlapsSphere(std::span<const glm::vec3> centres, std::span<const float> radii,
                        std::span<bool> answers) const;
    /// overlapsBox() of each box.
    void overlapsBox(std::span<const OrientedBox> boxes, std::span<bool> answers) const;

    /// As LevelSet::origin(): the point of the world that is zero in the field's coordinates [m].
    glm::dvec3 origin() const noexcept;
    float voxelSize() const noexcept;       ///< [m]
    float exteriorWidth() const noexcept;   ///< [m]
    float interiorWidth() const noexcept;   ///< [m]
    const Bounds& bounds() const noexcept;  ///< of all points in the band [m]
    /// Null if the field has no mesh. Valid as long as the field or a copy of it lives.
    const Mesh* mesh() const noexcept;
    std::size_t memoryBytes() const noexcept;  ///< of all that its queries use, the mesh included [bytes]

  private:
    friend struct detail::Access;
    explicit Field(std::shared_ptr<const detail::FieldData> data);

    std::shared_ptr<const detail::FieldData> data_;
    Sample (*sample_)(const detail::FieldData&, const glm::vec3&) noexcept;  // the fastest for this processor
};

/// Samples a field point by point. Faster than Field::sample() where successive points are near each other, since it
/// keeps the block of voxels that it sampled last. A light object for one thread at a time: create one per thread. It
/// refers to the field's memory, so the field or a copy of it must outlive it.
class FieldSampler {
  public:
    explicit FieldSampler(const Field& field) noexcept;  ///< the field or a copy of it must outlive the sampler
    explicit FieldSampler(Field&&) = delete;

    /// Distance and gradient at a point in field coordinates [m]. Equals Field::sample() bit for bit.
    Sample sample(const glm::vec3& point) noexcept {
        const detail::Floats found = sampleInBand_(*data_, last_, point);
        // tests the bits: compilers may remove tests for NaN on request
        if (std::bit_cast<std::uint32_t>(found[0]) << 1 > infinityBits << 1) [[unlikely]]
            return sampleAnywhere(point);
        return {.distance = found[0], .gradient = {found[1], found[2], found[3]}, .inBand = true};
    }

  private:
    static constexpr std::uint32_t infinityBits = 0x7f800000;

    Sample sampleAnywhere(const glm::vec3& point) const noexcept;

    const detail::FieldData* data_;
    /// Distance and gradient in the band, NaN elsewhere. The fastest for this processor.
    detail::Floats (*sampleInBand_)(const detail::FieldData&, detail::LastBlock&, const glm::vec3&) noexcept;
    detail::LastBlock last_;
};

/// A field in tiles, as `bilayer build --tiles` writes it. A tile is read when a query falls into it. The tiles that
/// were used last stay in memory, within a budget. Copies share them. Queries may run on any number of threads at once.
///
/// Queries throw std::runtime_error that names the file of a tile that is missing, damaged, or not the one that the
/// manifest describes. Reading a tile takes about twice its memory for a moment. Reading goes on one tile at a time,
/// and each thread holds the tile that it queries.
class TiledField {
  public:
    /// Opens the folder of a field. Reads manifest.json, the coarse cells of all tiles (16 bytes per block of 8^3
    /// voxels), and the smallest tile.
    /// @param folder  with manifest.json
    /// @param budget  max memory of the tiles that are kept; a single tile is kept even if it is larger [bytes]
    ///
    /// Throws std::runtime_error that names a file that is missing or damaged, or the folder of a field with more than
    /// 2^19 blocks along an axis.
    TiledField(const std::filesystem::path& folder, std::size_t budget, const FieldOptions& options = {});

    /// Distance and gradient at a point in field coordinates [m]. The result is that of Field::sample() of the merged
    /// field, bit for bit, at any point.
    Sample sample(const glm::vec3& point) const;

    /// The same for many points. Each tile is read at most once. Throws std::invalid_argument if the spans differ in
    /// length.
    void sample(std::span<const glm::vec3> points, std::span<Sample> samples) const;

    /// The distance only, as Sample::distance.
    float distance(const glm::vec3& point) const;

    /// Whether a point is inside: the sign of the sample. False for a non-finite point.
    bool inside(const glm::vec3& point) const;

    /// The closest zero of the interpolant, as Field::closest() without the mesh finds it, with the same tolerances.
    /// Reads the tiles that are nearer than it, the nearest first.
    /// @param maxDistance  search radius [m]
    ClosestPoint closest(const glm::vec3& point, float maxDistance = std::numeric_limits<float>::infinity()) const;

    /// The first point of a ray inside the solid, as Field::raycast() without the mesh finds it, to 1e-9 voxels. Reads
    /// the tiles with surface along the ray, up to the hit.
    std::optional<RayHit> raycast(const Ray& ray) const;

    float voxelSize() const noexcept;        ///< [m]
    float exteriorWidth() const noexcept;    ///< [m]
    float interiorWidth() const noexcept;    ///< [m]
    const Bounds& bounds() const noexcept;   ///< of all points in the band [m]
    std::size_t tileCount() const noexcept;  ///< of the folder, those without a file included
    std::size_t tilesRead() const;           ///< count of tiles that were read since the folder was opened
    std::size_t memoryBytes() const;         ///< of the tiles in memory and the coarse cells of all [bytes]

  private:
    std::shared_ptr<const detail::TiledFieldData> data_;
};

}  // namespace bilayer
