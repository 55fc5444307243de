// SPDX-License-Identifier: Apache-2.0
// Fills the holes of a mesh with triangles where the winding number shows that a border of the solid is missing.
//
// Minimum-area triangulation: G. Barequet, M. Sharir, "Filling gaps in the boundary of a polyhedron", Computer Aided
// Geometric Design 12 (1995) 207-229.
#pragma once

#include <cstddef>

#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

/// The result of fillHoles().
struct FilledMesh {
    Mesh mesh;                  ///< the given triangles, followed by those that fill holes
    std::size_t loops = 0;      ///< boundary loops that were filled
    std::size_t openLoops = 0;  ///< boundary loops that were not filled
    bool changed = false;       ///< loops were filled, or vertices on hole boundaries were merged
};

/// Fills boundary loops with triangles between their vertices, oriented like the surrounding triangles. A loop is
/// filled if its triangles separate inside from outside: the winding number of the mesh is near one half there.
///
/// These loops stay open: loops inside the solid, loops of open surfaces, and loops with more than 1000 edges. All
/// cracks are closed. Edges across a crack are split at each other's vertices, so that no triangle without area
/// remains. Vertices with equal coordinates count as one. A mesh stays as it is if no loop is filled and
/// no vertices of boundaries are joined.
/// Deterministic; O(n^3) in the edge count of a loop.
/// @param mesh   valid and oriented (see orient())
/// @param crack  loops with a mean width up to this are cracks [m]
FilledMesh fillHoles(Mesh mesh, double crack);

}  // namespace bilayer::detail
