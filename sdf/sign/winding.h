// SPDX-License-Identifier: Apache-2.0
// Signs by the generalized winding number (bvh/winding_number.h). Handles holes, overlaps and triangle soups if most
// faces are oriented correctly.
#pragma once

#include <bilayer/sdf/mesh.h>
#include "sdf/base/openvdb.h"
#include "sdf/leaf/band.h"

namespace bilayer::detail {

/// Signs a narrow band of unsigned distances: a voxel is inside where the winding number of the mesh is above one half.
///
/// `grid` holds a distance >= 0 [m] in every voxel closer to the mesh than some reach. Its background and all other
/// voxels hold the reach, and it has no active tile. On return it is a level set of the given widths. Voxels with
/// -interior < distance < exterior are active; others hold +exterior or -interior, in tiles as large as possible.
///
/// The bytes do not depend on the thread count. Throws std::invalid_argument as validate() does, and Cancelled. After
/// an exception the grid is incomplete.
///
/// Voxels of leaves get the sign at their own centre. The space between leaves gets one sign for each 8x8x8 block, from
/// the block's centre.
/// @param closed  true: every edge is used equally often in both directions, and the number changes only across the
///                surface. false: it also changes across holes, away from any surface.
/// @param progress  polled for cancellation, unless null
void signByWinding(openvdb::FloatGrid& grid, const Mesh& mesh, const BandWidths& widths, bool closed,
                   Progress* progress = nullptr);

}  // namespace bilayer::detail
