// What is wrong with a mesh, counted.
#pragma once

#include <cstddef>
#include <string>

#include <bilayer/sdf/mesh.h>

namespace bilayer {

/// What inspect() found. All zero but the first four means: closed, oriented, clean.
struct MeshReport {
    std::size_t points = 0;
    std::size_t triangles = 0;
    std::size_t components = 0;           ///< sets of triangles that share vertices
    Bounds bounds;                        ///< relative to the origin [m]
    glm::dvec3 origin{0};                 ///< Mesh::origin [m]
    std::size_t boundaryEdges = 0;        ///< edges of one triangle
    std::size_t nonManifoldEdges = 0;     ///< edges of three triangles or more
    std::size_t misorientedEdges = 0;     ///< edges that their triangles do not run both ways equally often
    std::size_t degenerateTriangles = 0;  ///< triangles without area
    std::size_t duplicateTriangles = 0;   ///< triangles whose three vertices another one has already
    std::size_t boundaryLoops = 0;        ///< sets of boundary edges that share vertices: holes
    std::size_t nonManifoldVertices = 0;  ///< vertices whose triangles form more than one fan
    std::size_t selfIntersections = 0;    ///< pairs of triangles that share no edge and run through each other
    std::size_t flippedTriangles = 0;     ///< triangles that orient() would turn around
    std::size_t insideOutComponents =
        0;                   ///< closed components that bound space from the wrong side (nested ones allowed)
    float thinnestWall = 0;  ///< smallest thickness of the solid behind a triangle [m]; 0: none was found
    /// The same without the hundredth of the area that has the least solid behind it: creases and tips [m].
    float commonWall = 0;
    std::size_t thinWalls = 0;  ///< triangles with less than `wall` of solid behind them
    double area = 0;            ///< [m^2]
    double volume = 0;          ///< signed [m^3]; means something only where `closed`

    /// Every edge has exactly two triangles.
    bool closed() const { return boundaryEdges == 0 && nonManifoldEdges == 0 && triangles > 0; }
    /// No edge is run twice in one direction, and no closed component is inside out.
    bool oriented() const { return misorientedEdges == 0 && insideOutComponents == 0; }
};

/// Examines a mesh in O(n log n). Vertices count as one where their coordinates are equal.
/// @param wall  thickness below which a wall counts as thin [m], often one voxel; 0 counts none
/// Throws as validate() does.
MeshReport inspect(const Mesh& mesh, float wall = 0);

/// The report in one sentence without a full stop: "closed and oriented", or what is wrong, the worst first.
std::string verdict(const MeshReport& report);

}  // namespace bilayer
