// A level set laid out for queries: each leaf becomes a block of 9^3 floats, so that all eight voxels around a point
// lie in one block, and a dense directory over the blocks' box tells which block a point is in, or on which side.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/vec3.hpp>
#include <glm/vector_relational.hpp>

#include <bilayer/collider/field.h>

#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>
#include "collider/field/clearance.h"
#include "sdf/base/large_array.h"

namespace bilayer::detail {

/// Where a laid out field is, and how wide its band.
struct FieldFrame {
    static constexpr int side = 8;           ///< voxels along a block: an OpenVDB leaf
    static constexpr int stride = side + 1;  ///< with the apron that completes the last cells
    static constexpr int blockFloats = stride * stride * stride;
    /// Entries of the directory for blocks that lie beside the band altogether.
    static constexpr std::int32_t emptyOutside = -1, emptyInside = -2;

    glm::dvec3 origin{0};  ///< of the directory: its first voxel [m]
    glm::ivec3 blocks{0};  ///< of the directory, along each axis
    double voxel = 0;      ///< its edge [m], unrounded: far from the origin it counts
    double perMetre = 0;   ///< voxels
    float voxelSize = 0, exteriorWidth = 0, interiorWidth = 0;  ///< [m]
    Bounds bounds{};                                            ///< around all points in the band [m]

    std::size_t entries() const { return std::size_t(blocks.x) * blocks.y * blocks.z; }
    std::size_t entryOf(const glm::ivec3& block) const {
        return (std::size_t(block.x) * blocks.y + block.y) * blocks.z + block.z;
    }
    /// Blocks along an axis at most.
    static constexpr int maxBlocksAlong = 1 << 19;
    /// Throws std::invalid_argument if the directory has more than 2^26 entries, or more than 2^19 along an axis.
    void requireSize() const;

    /// Whether the band is wide enough to tell where the surface passes.
    bool findsSurface() const;

    glm::ivec3 parts() const { return Clearance::perBlock * blocks; }
};

/// What queries work from, independent of OpenVDB.
struct FieldLayout : FieldFrame {
    /// Of fixed16: a voxel beyond the band, outside or inside. No voxel of the band has it. Of float32 it is not a
    /// number, positive or negative.
    static constexpr std::int16_t beyondOutside = 32767, beyondInside = -32768;

    LargeArray<std::int32_t> directory;  ///< a block's number in `values`, or the side that it lies on
    LargeArray<std::int8_t> centres;     ///< of Clearance::Data
    LargeArray<std::int8_t> minima;      ///< likewise
    Storage storage = Storage::float32;
    LargeArray<float> values;           ///< blockFloats a block, if they are float32 [m]
    LargeArray<std::int16_t> values16;  ///< likewise, if they are fixed16 [step]
    float step = 0;                     ///< of fixed16 [m]
    std::size_t stored = 0;             ///< blocks in `values`

    /// Throws std::invalid_argument if no voxel is in the band, or if the box is so large for its voxels that it holds
    /// more than 2^26 blocks of 8^3 voxels, or more than 2^19 along an axis.
    explicit FieldLayout(const LevelSet& levelSet, Storage storage = Storage::float32);
    FieldLayout(FieldLayout&&) noexcept = default;
    FieldLayout& operator=(FieldLayout&&) noexcept = default;

    /// The same layout, whose arrays share memory.
    FieldLayout shared() const;
    Clearance clearance() const;
    /// Whether samples of the band are kept in a block, by its place in the directory; false for one beside it.
    bool keeps(const glm::ivec3& block) const {
        return block == glm::clamp(block, glm::ivec3(0), blocks - 1) && directory.data()[entryOf(block)] >= 0;
    }
    std::size_t memoryBytes() const;

  private:
    explicit FieldLayout(const FieldFrame& frame) : FieldFrame(frame) {}
};

}  // namespace bilayer::detail
