// SPDX-License-Identifier: Apache-2.0
// Divides the bricks around a mesh into boxes, the tiles of a field.
// Tested by tests/sdf/field_tiles.cpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include <bilayer/sdf/options.h>
#include "sdf/fill/brick_lattice.h"
#include "sdf/fill/triangle_limits.h"
#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// Throws std::invalid_argument that names an option whose field cannot be built from the triangles near each tile.
void requireLocal(const BuildOptions& options);

/// The tiles of a field, numbered with z fastest. Each is a box of whole bricks, so that its blocks are filled from the
/// same bricks as those of the whole field.
class Tiling {
  public:
    /// @param mesh     bounds of the mesh
    /// @param options  valid and local; with Sign::flood if that is what Sign::automatic chose
    /// @param counts   of tiles along each axis
    /// Throws std::invalid_argument that names an axis with fewer bricks than tiles.
    Tiling(const Bounds& mesh, const BuildOptions& options, const glm::ivec3& counts);

    const Bounds& mesh() const { return mesh_; }
    const glm::ivec3& counts() const { return counts_; }
    std::size_t size() const { return std::size_t(counts_.x) * std::size_t(counts_.y) * std::size_t(counts_.z); }
    glm::ivec3 place(std::size_t tile) const;
    std::size_t tileAt(const glm::ivec3& place) const;

    /// Contains all blocks of the field.
    BlockBox lattice() const;
    /// A tile's blocks; unbounded where no tile follows.
    BlockBox own(std::size_t tile) const;

    /// Calls visit(tile) for each tile that needs a triangle, in any order, once each.
    /// @param corners  [voxels]
    template <class Visit>
    void forEachTileOf(const TriangleCorners& corners, Visit visit) {
        found_.clear();
        const BrickLattice::Range around = bricks_.around(corners);
        if (around.isSmall()) {
            for (int x = around.lower.x; x <= around.upper.x; ++x)
                for (int y = around.lower.y; y <= around.upper.y; ++y)
                    for (int z = around.lower.z; z <= around.upper.z; ++z) addTilesOf({x, y, z}, corners);
        } else {
            bricks_.divide(corners, around, nullptr, [&](const glm::ivec3& brick) { addTilesOf(brick, corners); });
        }
        for (const std::size_t tile : found_) visit(tile);
    }

    /// Returns the box that triangles of a tile reach into [voxels].
    TriangleLimits limits(std::size_t tile) const;

    float reach() const { return reach_; }                ///< of triangles [voxels]
    int brickSide() const { return 1 << bricks_.shift; }  ///< [voxels]

  private:
    void addTilesOf(const glm::ivec3& brick, const TriangleCorners& corners);
    void add(std::size_t tile);
    int border(int axis, int tile) const;  // the first brick of a tile

    Bounds mesh_;
    glm::ivec3 counts_;
    float reach_;  // [voxels]
    BrickLattice bricks_;
    std::vector<std::uint32_t> tileOfBrick_[3];
    std::vector<std::size_t> found_;  // scratch
};

}  // namespace bilayer::detail
