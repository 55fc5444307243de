// The surface of the union of the solids in a mesh.
#pragma once

#include <cstddef>

#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

class Progress;

/// What unite() made of a mesh.
struct UnionSurface {
    Mesh mesh;                        ///< the surface of the union
    std::size_t buriedTriangles = 0;  ///< triangles of which nothing is left
    std::size_t cutTriangles = 0;     ///< triangles of which a part is left, in pieces

    bool changed() const { return buriedTriangles + cutTriangles > 0; }
};

/// Takes away what lies inside of the union of all solids of a mesh: walls with a winding number above a half on both
/// sides. Triangles that other triangles cross or touch are divided along these lines first, and the buried pieces
/// dropped. The surface is exact but for the rounding of floats: walls nearer to each other than 2e-7 of the largest
/// coordinate touch. Winding numbers of the given mesh tell the two sides of the result apart.
///
/// Sheets, and walls of solids that are inside out, stay: orient() the mesh first if it is not to be trusted. A mesh
/// without buried walls keeps its bytes. The bytes of the result do not depend on the number of threads.
/// @param progress  polled, unless null
/// Throws as validate() does.
UnionSurface unite(const Mesh& mesh, Progress* progress = nullptr);

}  // namespace bilayer::detail
