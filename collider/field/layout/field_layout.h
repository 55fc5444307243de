// SPDX-License-Identifier: Apache-2.0
// A level set laid out for queries. Each leaf becomes a block of 9^3 floats, so that the eight voxels around any point
// are in one block. A dense directory over the blocks' bounding box holds the block of each place, or the side that it
// is on.
// Tested by tests/collider/field.cpp through Field::sample().
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/vec3.hpp>
#include <glm/vector_relational.hpp>
#include <span>

#include <bilayer/collider/field.h>

#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>
#include "collider/field/layout/clearance.h"
#include "sdf/base/large_array.h"

namespace bilayer::detail {

/// Position and band widths of a field layout.
struct FieldFrame {
    static constexpr int side = 8;           ///< voxels along a block: an OpenVDB leaf
    static constexpr int stride = side + 1;  ///< with the apron that completes the last cells
    static constexpr int blockFloats = stride * stride * stride;
    /// Directory entries for blocks entirely outside the band.
    static constexpr std::int32_t emptyOutside = -1, emptyInside = -2;

    glm::dvec3 origin{0};  ///< position of the directory's first voxel [m]
    glm::ivec3 blocks{0};  ///< size of the directory along each axis
    double voxel = 0;      ///< edge of a voxel [m], unrounded: the error would grow with the distance from the origin
    double perMetre = 0;   ///< voxels per metre
    float voxelSize = 0, exteriorWidth = 0, interiorWidth = 0;  ///< [m]
    Bounds bounds{};                                            ///< of all points in the band [m]

    // Local places are in voxels from the directory's first voxel. In double they are exact enough at any distance from
    // the origin.
    glm::dvec3 toLocal(const glm::vec3& point) const { return (glm::dvec3(point) - origin) * perMetre; }
    glm::vec3 toWorld(const glm::dvec3& local) const { return glm::vec3(local * voxel + origin); }

    glm::dvec3 extent() const { return double(side) * glm::dvec3(blocks); }
    std::size_t entries() const { return std::size_t(blocks.x) * blocks.y * blocks.z; }
    std::size_t entryOf(const glm::ivec3& block) const {
        return (std::size_t(block.x) * blocks.y + block.y) * blocks.z + block.z;
    }
    /// Max count of blocks along an axis.
    static constexpr int maxBlocksAlong = 1 << 19;
    /// Throws std::invalid_argument if the directory has more than 2^26 entries, or more than 2^19 along an axis.
    void requireSize() const;
    /// The same for a tile of a field, and if it has more than 2^27 blocks with those within clearanceReach around it.
    void requireSizeOfTile() const;
    /// Throws std::invalid_argument if the directory has more than 2^19 entries along an axis.
    void requireLength() const;

    /// Whether the band is wide enough to locate the surface.
    bool findsSurface() const;

    glm::ivec3 coarseCells() const { return Clearance::perBlock * blocks; }
};

/// A block that stores samples of the band.
struct SurfaceBlock {
    glm::ivec3 first;     ///< its first voxel
    std::uint32_t meets;  ///< bit k: the surface may meet coarse cell k
};

/// A box of blocks of a larger field.
struct LayoutTile {
    glm::ivec3 first, blocks;  ///< the first voxel, and the count of blocks along each axis
    /// Blocks of the whole field: all of the tile's own, and all others within clearanceReach of the box.
    std::span<const SurfaceBlock> surface;
};

/// Blocks beyond do not change the distance bounds of a block [blocks].
inline constexpr int clearanceReach = 8;

/// The query data, independent of OpenVDB.
struct FieldLayout : FieldFrame {
    /// For fixed16: a voxel outside the band, on either side. No voxel of the band has these values. For float32 such a
    /// voxel is NaN, with the sign of the side.
    static constexpr std::int16_t beyondOutside = 32767, beyondInside = -32768;

    LargeArray<std::int32_t> directory;  ///< the index of a block in `values`, or the side that it lies on
    LargeArray<std::int8_t> centres;     ///< of Clearance::Data
    LargeArray<std::int8_t> minima;      ///< of Clearance::Data
    Storage storage = Storage::float32;
    LargeArray<float> values;           ///< for float32: blockFloats per block [m]
    LargeArray<std::int16_t> values16;  ///< for fixed16: the same [step]
    float step = 0;                     ///< for fixed16 [m]
    std::size_t stored = 0;             ///< count of blocks in `values`

    /// Throws std::invalid_argument if no voxel is in the band, if the box holds more than 2^26 blocks of 8^3 voxels,
    /// or if it holds more than 2^19 along an axis.
    explicit FieldLayout(const LevelSet& levelSet, Storage storage = Storage::float32);
    /// Lays out a tile of a field. Its samples and bounds are those of the whole field.
    /// @param frame  of the whole field
    /// @param grids  with all voxels of the tile, and the next ones above it
    FieldLayout(const FieldFrame& frame, const Grids& grids, const LayoutTile& tile, Storage storage);
    FieldLayout(FieldLayout&&) noexcept = default;
    FieldLayout& operator=(FieldLayout&&) noexcept = default;

    /// The same layout, with shared arrays.
    FieldLayout shared() const;
    Clearance clearance() const;
    /// Whether the block at a place of the directory stores samples of the band. False for places outside the
    /// directory.
    bool keeps(const glm::ivec3& block) const {
        return block == glm::clamp(block, glm::ivec3(0), blocks - 1) && directory.data()[entryOf(block)] >= 0;
    }
    std::size_t memoryBytes() const;

  private:
    explicit FieldLayout(const FieldFrame& frame) : FieldFrame(frame) {}
    FieldLayout(const FieldFrame& frame, Storage storage);
};

}  // namespace bilayer::detail
