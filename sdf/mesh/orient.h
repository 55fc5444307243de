// SPDX-License-Identifier: Apache-2.0
// Orients the triangles of a mesh consistently. First, neighbours across an edge of two triangles are made to traverse
// it in opposite directions. Then whole components are flipped, according to their volume and their nesting.
//
// Method: propagation over the dual graph, as in P. Borodin, G. Zachmann, R. Klein, "Consistent normal orientation for
// polygonal meshes" (CGI 2004). The sign of a component's volume decides its outside; an open component is closed by a
// cone.
#pragma once

#include <cstddef>

#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

class Progress;

/// The result of orient().
struct Orientation {
    Mesh mesh;                          ///< the same triangles in the same order, some of them flipped
    std::size_t flippedTriangles = 0;   ///< flipped triangles
    std::size_t flippedComponents = 0;  ///< consistent components that were flipped as a whole
    std::size_t mixedComponents = 0;    ///< inconsistent components that were made consistent
    std::size_t oneSidedTriangles = 0;  ///< triangles of one-sided components, such as a Moebius strip; left unchanged
    bool orientable() const { return oneSidedTriangles == 0; }
};

/// Orients a mesh. A component consists of triangles connected by edges of two triangles, or by edges of more triangles
/// whose half-edges still pair up.
///
/// - A component must have positive volume if the components around it leave it outside (their signs sum to zero).
/// - Within others, a component may have either sign. Negative is a cavity. Positive is a solid in a solid, whose union
///   is correct under winding numbers. If the component was inconsistent, or one around it was inconsistent or flipped,
///   the file is not reliable, and the component becomes a cavity.
/// - Components that enclose almost no volume keep the orientation of most of their area.
/// - A duplicate triangle follows the triangle that it repeats. If every face of a surface exists twice, back to back,
///   both copies are made to face outward, provided that the surface is closed but for holes of 5 % of its area.
/// - A mesh that is already well oriented is returned bit-identical.
///
/// @param progress  polled, unless null
/// Throws as validate() does.
Orientation orient(const Mesh& mesh, Progress* progress = nullptr);

}  // namespace bilayer::detail
