// SPDX-License-Identifier: Apache-2.0
// Which blocks of a level set a field stores, and where the surface may meet them.
// Tested by tests/collider/field.cpp through Field::sample().
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "collider/field/layout/coarse_distance.h"
#include "collider/field/layout/interpolant.h"
#include "sdf/base/openvdb.h"

namespace bilayer::detail {

/// Max distance from the surface in a cell to its nearest voxel [voxels].
inline constexpr float nearSurface = 0.5f * cellDiagonal;

/// Summary of a block's coarse cells.
struct BlockSummary {
    std::array<float, Clearance::blockCells> lowest{};  ///< min value of the voxels around each coarse cell [m]
    /// Bit k: a voxel of coarse cell k is close enough to the surface, or both signs occur.
    std::uint32_t meetsSurface = 0;
};

/// Whether a field stores a block for a leaf: it has voxels of the band, or voxels of both signs (for bands below one
/// voxel).
bool needsBlock(const openvdb::FloatTree::LeafNodeType& leaf);

/// @param block  FieldFrame::blockFloats values, as copyBlock() gives them [m]
BlockSummary summaryOf(const float* block, float voxelSize);

/// Returns the blocks in a box that a field stores, in the order of the tree.
std::vector<SurfaceBlock> surfaceBlocks(const openvdb::FloatTree& tree, const openvdb::CoordBBox& box, float voxelSize);

}  // namespace bilayer::detail
