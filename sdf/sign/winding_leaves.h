// SPDX-License-Identifier: Apache-2.0
// Signs of the voxels of leaves by winding numbers.
// Tested by tests/sdf/winding.cpp.
#pragma once

#include "sdf/leaf/band.h"
#include "sdf/sign/winding_brick.h"
#include "sdf/sign/winding_query.h"

namespace bilayer::detail {

/// Signs the leaves of a brick, voxel by voxel.
void signLeaves(const WindingQuery& query, const WindingBrick& brick, const BandWidths& widths);

}  // namespace bilayer::detail
