// SPDX-License-Identifier: Apache-2.0
// The surface of the union of the solids in a mesh.
#pragma once

#include <cstddef>

#include <bilayer/sdf/mesh.h>
#include "sdf/mesh/surface_pieces.h"

namespace bilayer::detail {

class Progress;

/// The result of unite().
struct UnionSurface {
    Mesh mesh;                        ///< the surface of the union
    std::size_t buriedTriangles = 0;  ///< triangles that were removed entirely
    std::size_t cutTriangles = 0;     ///< triangles that were removed in part and cut into pieces

    bool changed() const { return buriedTriangles + cutTriangles > 0; }
};

/// Removes the surfaces inside of the union of all solids of a mesh, that is, surfaces with a winding number above 1/2
/// on both sides. Triangles that intersect or touch others are first cut along the intersections; then the buried
/// pieces are removed. The result is exact up to the rounding of floats: surfaces closer to each other than 2.5e-7 of
/// the max coordinate count as touching. The winding numbers of the given mesh determine the two sides of the result.
///
/// Open surfaces and the surfaces of inside-out solids stay. Call orient() first if the orientation is not reliable. A
/// mesh without buried surfaces is returned bit-identical. The bytes of the result do not depend on the count of
/// threads.
/// @param progress  polled, unless null
/// Throws as validate() does.
UnionSurface unite(const Mesh& mesh, Progress* progress = nullptr);

/// Returns the boundary of the union of all solids of a closed mesh, that is, of the points whose winding number is
/// above 1/2. Unlike the surface that unite() returns, it omits surfaces with no solid on either side. Copies of a
/// boundary coincide if solids lie flush. The label of a triangle is the count of its copies, those of the opposite
/// orientation subtracted. An integral over the surface of the union is thus the sum over all triangles of their
/// integrals, divided by the labels.
/// @param closed    balanced(), for example after orient()
/// @param progress  polled, unless null
/// Throws as validate() does.
LabelledMesh unionBoundary(const Mesh& closed, Progress* progress = nullptr);

}  // namespace bilayer::detail
