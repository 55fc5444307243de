// SPDX-License-Identifier: Apache-2.0
// Blocks of 9^3 distances: an OpenVDB leaf, and the first layer of voxels of its seven upper neighbours.
// Tested by tests/collider/field.cpp through Field::sample().
#pragma once

#include "sdf/base/openvdb.h"

namespace bilayer::detail {

/// Copies a leaf, or the tile that stands for it, with its upper neighbours. The last axis is the fastest.
/// @param origin  the first voxel of the leaf
/// @param block   FieldFrame::blockFloats values
void copyBlock(const openvdb::FloatGrid::ConstAccessor& tree, const openvdb::Coord& origin, float* block);

}  // namespace bilayer::detail
