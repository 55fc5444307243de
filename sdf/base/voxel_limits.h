// SPDX-License-Identifier: Apache-2.0
// The sizes of voxels that fields may have.
// Tested by tests/sdf/build.cpp through build().
#pragma once

namespace bilayer::detail {

/// Range of voxel sizes [m]: squared lengths from 1/1000 voxel to thousands of voxels stay within the float range.
inline constexpr double minStoredVoxel = 1e-15, maxStoredVoxel = 1e15;

}  // namespace bilayer::detail
