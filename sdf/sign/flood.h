// Signs by what can be reached from outside. It copes with faces turned any way and with narrow gaps, and gives no sign
// to sheets without thickness.
#pragma once

#include <openvdb/openvdb.h>

#include <bilayer/sdf/mesh.h>
#include "sdf/leaf/band.h"

namespace bilayer::detail {

class Progress;

/// Signs a narrow band of unsigned distances: outside is what a ball `gap` voxels wide reaches from infinity without
/// touching the surface, and inside is the rest of where such a ball fits.
///
/// `grid` is as for signByWinding(), with a reach of at least gap / 2 + 1 voxels; on return it is a level set of the
/// given widths.
///
/// What is promised:
/// - No path along which every point is at most gap / 2 from the surface somewhere is taken: a gap that the ball cannot
///   pass is closed.
/// - A path along which every point is at least gap / 2 + 1.4 voxels from the surface is taken: openings wider than gap
///   + 2.8 voxels stay open.
/// - The voxels nearer to the surface, where the ball's centre cannot be, then take their side from their neighbours,
///   a step at a time, outside first where both arrive at once, and never across the surface. So inside a gap that is
///   closed the border lies about half-way.
/// - What neither reaches is shut in by triangles on all sides and is inside: a closed solid too thin for the ball is
///   kept, and a sheet without thickness has no inside. Voxels within 1e-4 voxel of the surface that neither reaches
///   are outside.
/// The orientation of faces does not matter. The bytes do not depend on the number of threads. Throws
/// std::invalid_argument as validate() does, or if the gap is negative or the grid's background is too small, and
/// Cancelled; the grid is then in between.
/// @param progress  polled, unless null
void signByFlood(openvdb::FloatGrid& grid, const Mesh& mesh, float gap, const BandWidths& widths,
                 Progress* progress = nullptr);

}  // namespace bilayer::detail
