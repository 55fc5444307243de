// SPDX-License-Identifier: Apache-2.0
// Signs of the voxels of leaves by winding numbers.
// Tested by tests/sdf/winding.cpp through signByWinding().
#pragma once

#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/bvh/winding_number.h"
#include "sdf/leaf/band.h"
#include "sdf/sign/octree_cells.h"

namespace bilayer::detail {

/// Signs the voxels of leaves. The winding number of a closed mesh is the sum of the crossings of a column of voxels
/// below. An open mesh is closed by caps, and the winding number of the caps is subtracted.
/// @param winding   of the mesh
/// @param closed    as in signByWinding()
/// @param progress  polled for cancellation, unless null
void signLeaves(const std::vector<BandLeaf*>& leaves, const Mesh& mesh, const WindingNumber& winding,
                const BandWidths& widths, bool closed, Progress* progress);

}  // namespace bilayer::detail
