// SPDX-License-Identifier: Apache-2.0
// The sizes of voxels that fields may have.
// Tested by tests/sdf/build.cpp through build().
#pragma once

namespace bilayer::detail {

/// Min edge of a voxel [m]: OpenVDB treats a transform with a determinant below 3e-15 as singular.
inline constexpr float minVoxelSize = 2e-5f;

/// Max edge of a voxel [m]: squared lengths of thousands of voxels stay within the float range.
inline constexpr double maxVoxelSize = 1e15;

}  // namespace bilayer::detail
