// SPDX-License-Identifier: Apache-2.0
// Signs of a part of a closed mesh's field by winding numbers. The number of a voxel is the sum of all crossings of its
// column below, an integer. What lies below the part is given, so that the part needs no other triangles.
// Tested by tests/sdf/tile_signs.cpp through buildTile().
#pragma once

#include <bilayer/sdf/mesh.h>
#include "sdf/base/openvdb.h"
#include "sdf/grid/field_part.h"
#include "sdf/leaf/band.h"

namespace bilayer::detail {

class Progress;

/// Signs a part of a narrow band of unsigned distances, as signByWinding() signs the field of a closed mesh.
/// @param part  with sums of crossings below
/// @param dropPlain  whether leaves without a voxel in the band become space
void signPartByWinding(openvdb::FloatGrid& grid, const Mesh& mesh, const BandWidths& widths, const FieldPart& part,
                       bool dropPlain, Progress& progress);

/// Compares the signs of a part's own leaves with winding numbers, as repairSigns() does. Or corrects the signs of all
/// leaves that the part fills, and counts nothing.
/// @param part   with sums of crossings below, and a check that is not `none`
/// @param limit  maximum distance of a corrected voxel from the surface [m]
ComparedSigns comparePart(openvdb::FloatGrid& grid, const Mesh& mesh, const FieldPart& part, float limit,
                          Progress& progress);

}  // namespace bilayer::detail
