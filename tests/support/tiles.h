// SPDX-License-Identifier: Apache-2.0
// Samples of a mesh: triangles are divided into tiles; a tile is n rows of samples by Algorithm 1 of the paper.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <span>

#include <bilayer/sdf/build.h>

namespace bilayer {

/// A triangle or a part of one, in voxels. Row i of `rows` has i + 1 samples at `base + first + i * down + j * across`.
/// The sample of the inner layer is at minus `offset` from it, that of the outer layer at plus `offset` (Eq. 2). Local
/// coordinates are small, so floats represent them accurately at any distance from the origin.
struct Tile {
    glm::ivec3 base;    ///< a voxel near the tile [index coordinates]
    glm::vec3 first;    ///< the first sample, from `base` [voxels]
    glm::vec3 down;     ///< s1 of Algorithm 1: from one row to the next [voxels]
    glm::vec3 across;   ///< s2 of Algorithm 1: along a row [voxels]
    glm::vec3 offset;   ///< delta times the outward normal [voxels]
    std::int32_t rows;  ///< n of Algorithm 1
};
static_assert(sizeof(Tile) == 64, "one cache line, and the layout of the OpenCL struct");

/// The tiles of a mesh, in the order of its triangles.
struct Tiles {
    std::span<const Tile> tiles;
    std::span<const std::int32_t> triangles;  ///< the triangle of each tile
    glm::ivec3 lower{0}, upper{0};            ///< voxels around all samples, both inclusive [index coordinates]

    /// Storage of the spans: arrays that are not cleared before they are written.
    std::unique_ptr<Tile[]> tileMemory;
    std::unique_ptr<std::int32_t[]> triangleMemory;
};

/// Divides all triangles into tiles, in parallel. Triangles without area have none.
Tiles makeTiles(const Mesh& mesh, const BuildOptions& options);

/// Sample count of a tile with n rows.
inline std::int64_t sampleCount(std::int64_t rows) {
    return rows * (rows + 1) / 2;
}

}  // namespace bilayer
