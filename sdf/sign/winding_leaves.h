// SPDX-License-Identifier: Apache-2.0
// Signs of the voxels of leaves by winding numbers.
// Tested by tests/sdf/winding.cpp through signByWinding().
#pragma once

#include <cstdint>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/leaf/band.h"
#include "sdf/sign/column_crossings.h"
#include "sdf/sign/octree_cells.h"
#include "sdf/sign/winding_query.h"

namespace bilayer::detail {

/// Signs the voxels of the leaf of a closed mesh: inside where the winding number is positive.
/// @param numbers  has entered the leaf, and returned `crossed`
void signClosed(BandLeaf& leaf, ColumnNumbers& numbers, std::uint64_t crossed, const BandWidths& widths);

/// Signs the voxels of leaves. The winding number of a closed mesh is the sum of the crossings of a column of voxels
/// below. Triangles are added to an open mesh until it is closed, and their winding number is subtracted.
/// @param query  of the mesh, with a slope if the mesh is open
void signLeaves(const std::vector<BandLeaf*>& leaves, const Mesh& mesh, const WindingQuery& query,
                const BandWidths& widths);

}  // namespace bilayer::detail
