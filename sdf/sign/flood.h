// SPDX-License-Identifier: Apache-2.0
// Signs by reachability from outside. Handles inconsistently oriented faces and narrow gaps. Open surfaces without
// thickness get no inside.
#pragma once

#include <bilayer/sdf/mesh.h>
#include "sdf/base/openvdb.h"
#include "sdf/leaf/band.h"

namespace bilayer::detail {

class Progress;

/// Signs a narrow band of unsigned distances. The outside is the region that a ball of diameter `gapVoxels` reaches
/// from infinity without touching the surface. The inside is the remaining region where such a ball fits.
///
/// `grid` is as for signByWinding(), with a reach of at least gapVoxels / 2 + 1 voxels. On return it is a level set of
/// the given widths.
///
/// Guarantees:
/// - The ball takes no path that comes within gapVoxels / 2 of the surface anywhere: a gap that it cannot pass is
///   closed.
/// - The ball takes every path that stays at least gapVoxels / 2 + 1.4 voxels from the surface: openings wider than
///   gapVoxels + 2.8 voxels stay open.
/// - Voxels closer to the surface, where the ball's centre does not fit, then take the sign of their neighbours. This
///   proceeds in steps and never crosses the surface; outside wins a tie. Inside a closed gap the border is therefore
///   about half-way.
/// - Voxels that neither region reaches are enclosed by triangles on all sides and are inside. A closed solid too thin
///   for the ball is kept. An open surface has no inside without a place that is thicker than gapVoxels + 2.
/// - Voxels within 1e-4 voxel of the surface that neither region reaches are outside.
///
/// Face orientation does not matter. The bytes do not depend on the thread count. Throws std::invalid_argument as
/// validate() does, for a negative gap, and for a grid background that is too small. Throws Cancelled. After an
/// exception the grid is incomplete.
/// @param progress  polled for cancellation, unless null
void signByFlood(openvdb::FloatGrid& grid, const Mesh& mesh, float gapVoxels, const BandWidths& widths,
                 Progress* progress = nullptr);

}  // namespace bilayer::detail
