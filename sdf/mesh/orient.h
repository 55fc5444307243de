// Makes the triangles of a mesh agree on what is outside. Neighbours across an edge of two triangles are made to run it
// both ways; then whole pieces are turned, by their volume and by what they lie within.
//
// Method: propagation over the dual graph, as in P. Borodin, G. Zachmann, R. Klein, "Consistent normal orientation for
// polygonal meshes" (CGI 2004), with the volume of each piece, closed by a cone where it is open, for its outside.
#pragma once

#include <cstddef>

#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

class Progress;

/// What orient() made of a mesh.
struct Orientation {
    Mesh mesh;                          ///< the same triangles in the same order, some turned around
    std::size_t turnedTriangles = 0;    ///< triangles that run the other way now
    std::size_t turnedComponents = 0;   ///< pieces that agreed within themselves and were turned as a whole
    std::size_t mixedComponents = 0;    ///< pieces whose triangles did not agree and now do
    std::size_t oneSidedTriangles = 0;  ///< triangles of pieces with one side only, as a Moebius strip; left alone
    bool orientable() const { return oneSidedTriangles == 0; }
};

/// Orients a mesh. A piece is what hangs together by edges of two triangles, and by edges of more where the triangles
/// still pair off. A piece must have positive volume where the pieces around it leave it outside (their signs add up to
/// zero). Within others it may have either: negative is a cavity, positive is a solid in a solid, whose union winding
/// numbers understand. Only if one of the pieces around it was turned or mixed, so that the file is not to be trusted,
/// it becomes a cavity. Pieces that bound next to no volume keep the orientation of most of their area. A repeated
/// triangle goes with the one that it repeats; where all faces of a closed surface are there twice, back to back, both
/// are made to face outward. A mesh that is fine keeps its bytes.
/// @param progress  polled, unless null
/// Throws as validate() does.
Orientation orient(const Mesh& mesh, Progress* progress = nullptr);

}  // namespace bilayer::detail
