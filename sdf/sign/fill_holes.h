// Closes the holes of a mesh where winding numbers close them: what they take for the surface gets triangles.
//
// Triangulation of least area: G. Barequet, M. Sharir, "Filling gaps in the boundary of a polyhedron", Computer Aided
// Geometric Design 12 (1995) 207-229.
#pragma once

#include <cstddef>

#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

/// What fillHoles() made of a mesh.
struct FilledMesh {
    Mesh mesh;                  ///< the given triangles, and behind them those over the holes
    std::size_t loops = 0;      ///< boundary loops that were filled
    std::size_t openLoops = 0;  ///< boundary loops left as they were
    bool changed = false;       ///< loops were filled, or vertices of rims joined
};

/// Fills boundary loops with triangles between their vertices, facing as the triangles around them do. A loop is filled
/// where its triangles are a border between inside and outside: the winding number of the mesh is near a half there.
/// Loops within the solid or of sheets stay open, and so do loops of more than a thousand edges. Cracks are all closed:
/// edges across them are divided at each other's vertices, so that no triangle without area is left there. Vertices
/// count as one where their coordinates are equal. A mesh in which nothing is filled keeps its bytes. Deterministic;
/// O(n^3) in the edges of a loop.
/// @param mesh   valid, and oriented (see orient())
/// @param crack  loops whose mean width is no more than this are cracks [m]
FilledMesh fillHoles(Mesh mesh, double crack);

}  // namespace bilayer::detail
