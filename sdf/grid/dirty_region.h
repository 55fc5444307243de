// SPDX-License-Identifier: Apache-2.0
// The dirty region of a field when a part of its mesh moves: the cells within reach of the moved triangles, at their
// old or their new position.
// Tested by tests/sdf/rebuild.cpp.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>

#include <bilayer/sdf/mesh.h>
#include "sdf/base/openvdb.h"

namespace bilayer::detail {

/// Throws std::invalid_argument if the counts of triangles differ, if an index is out of range, or if a triangle has
/// changed corners but is not in `moved` (the message names the first one). The meshes must be valid.
void checkMoved(const Mesh& before, const Mesh& after, std::span<const std::uint32_t> moved);

/// A set of cells of a lattice.
class DirtyRegion {
  public:
    /// Collects the cells within reach of the moved triangles.
    /// @param side   side length of a cell [voxels], a power of two
    /// @param reach  max distance of a voxel from a triangle [voxels]
    DirtyRegion(const Mesh& before, const Mesh& after, std::span<const std::uint32_t> moved, double voxelsPerUnit,
                float reach, int side);

    /// Returns whether a cube of voxels overlaps any of the cells. The side of the cube must be a power of two, and its
    /// first voxel a multiple of the side.
    bool any(const glm::ivec3& first, int side) const;

  private:
    void add(const Mesh& mesh, const glm::uvec3& triangle, double voxelsPerUnit, double reach,
             openvdb::tree::ValueAccessor<openvdb::MaskTree>& cells) const;

    int shift_;
    openvdb::MaskTree cells_;  // one voxel per cell
};

}  // namespace bilayer::detail
