// Signs by the generalized winding number (winding_number.h). It copes with holes, overlaps and soups, as long as most
// faces are turned the right way.
#pragma once

#include <openvdb/openvdb.h>

#include <bilayer/sdf/mesh.h>
#include "sdf/bvh/winding_number.h"
#include "sdf/leaf/band.h"

namespace bilayer::detail {

/// Signs a narrow band of unsigned distances: a voxel is inside where the mesh's winding number is above a half.
///
/// `grid` holds a distance >= 0 [m] in every voxel nearer to the mesh than some reach, the reach as background and in
/// all other voxels, and no active tile; on return it is a level set of the given widths: active exactly where
/// -interior < distance < exterior, elsewhere +exterior or -interior, in tiles as large as they can be.
///
/// @param closed  true: as many triangles run along every edge one way as the other, hence the number is the same
///                wherever no surface lies between, and few voxels need to be asked. false: it changes across a hole,
///                away from any surface. Then voxels of leaves get the sign at their own centre, and the space between
///                leaves gets one sign for each 8x8x8 block, that of the block's centre.
/// @param progress  polled, unless null
/// The bytes do not depend on the number of threads. Throws std::invalid_argument as validate() does, and Cancelled;
/// the grid is then in between.
void signByWinding(openvdb::FloatGrid& grid, const Mesh& mesh, const BandWidths& widths, bool closed,
                   Progress* progress = nullptr);

}  // namespace bilayer::detail
