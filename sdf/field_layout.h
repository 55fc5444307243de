// A level set laid out for queries: each leaf becomes a block of 9^3 floats, so that all eight voxels around a point
// lie in one block, and a dense directory over the blocks' box tells which block a point is in, or on which side.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <vector>

#include "sdf/clearance.h"
#include "sdf/level_set.h"
#include "sdf/mesh.h"

namespace bilayer {

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
    /// Throws std::invalid_argument if the directory has more than 2^26 entries.
    void requireSize() const;

    /// What a clearance starts from where the surface does not pass: its squared way at most [parts^2].
    float farthestClearance() const;

    glm::ivec3 parts() const { return side / Clearance::partSide * blocks; }
};

/// What queries work from, independent of OpenVDB.
struct FieldLayout : FieldFrame {
    std::vector<std::int32_t> directory;      ///< a block's number in `values`, or the side that it lies on
    std::vector<Clearance::Part> clearances;  ///< of parts()
    std::unique_ptr<float[]> values;          ///< blockFloats a block [m]
    std::size_t stored = 0;                   ///< blocks in `values`

    /// Throws std::invalid_argument if no voxel is in the band, or if the box is so large for its voxels that it holds
    /// more than 2^26 blocks of 8^3 voxels.
    explicit FieldLayout(const LevelSet& levelSet);
};

}  // namespace bilayer
