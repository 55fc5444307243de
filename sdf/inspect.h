// SPDX-License-Identifier: Apache-2.0
// Mesh diagnostics.
#pragma once

#include <cstddef>
#include <functional>
#include <string>

#include <bilayer/sdf/mesh.h>

namespace bilayer {

/// The result of inspect(). A mesh is closed, oriented and clean if every defect count is zero.
struct MeshReport {
    std::size_t points = 0;               ///< count
    std::size_t triangles = 0;            ///< count
    std::size_t components = 0;           ///< sets of triangles connected by shared vertices
    Bounds bounds;                        ///< relative to the origin [m]
    glm::dvec3 origin{0};                 ///< Mesh::origin [m]
    std::size_t boundaryEdges = 0;        ///< edges with one triangle
    std::size_t nonManifoldEdges = 0;     ///< edges with three or more triangles
    std::size_t misorientedEdges = 0;     ///< edges that are not used equally often in both directions
    std::size_t degenerateTriangles = 0;  ///< triangles with zero area
    std::size_t duplicateTriangles = 0;   ///< triangles with the same three vertices as an earlier one
    std::size_t boundaryLoops = 0;        ///< holes: sets of boundary edges connected by shared vertices
    std::size_t nonManifoldVertices = 0;  ///< vertices whose triangles form several fans
    std::size_t selfIntersections = 0;    ///< pairs of triangles that intersect and share no edge
    std::size_t flippedTriangles = 0;     ///< triangles that orient() would flip
    std::size_t insideOutComponents = 0;  ///< closed components with reversed orientation (cavities are right)
    float thinnestWall = 0;               ///< minimum thickness of the solid behind a triangle [m]; 0: none found
    /// The minimum thickness without the thinnest hundredth of the area, that is without creases and convex vertices
    /// [m].
    float commonWall = 0;
    std::size_t thinWalls = 0;  ///< triangles with less than `wall` of solid behind them
    double area = 0;            ///< [m^2]
    double volume = 0;          ///< signed [m^3]; meaningful only if closed()

    /// Every edge has exactly two triangles.
    bool closed() const { return boundaryEdges == 0 && nonManifoldEdges == 0 && triangles > 0; }
    /// No edge is used twice in one direction, and no closed component is inside out.
    bool oriented() const { return misorientedEdges == 0 && insideOutComponents == 0; }
};

/// Examines a mesh in O(n log n). Vertices with equal coordinates count as one.
/// @param wall      walls thinner than this count as thin [m], often one voxel; 0 counts none
/// @param progress  as BuildOptions::progress; the fraction counts the phases that are done
///
/// Throws as validate() does, and Cancelled.
MeshReport inspect(const Mesh& mesh, float wall = 0, const std::function<bool(float)>& progress = {});

/// Summarizes a report in one sentence without a full stop: "closed and oriented", or the defects, the most severe
/// first.
std::string verdict(const MeshReport& report);

}  // namespace bilayer
