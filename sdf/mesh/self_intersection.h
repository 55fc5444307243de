// Where a surface runs through itself.
#pragma once

#include <cstddef>

#include <bilayer/sdf/mesh.h>
#include "sdf/bvh/triangle_tree.h"
#include "sdf/mesh/topology.h"

namespace bilayer::detail {

/// Counts the pairs of triangles that share no edge and run through each other: they have a segment in common, and the
/// surface of each continues on both sides of the other there, within the triangle or across an edge of it. Contact at
/// points, along edges of both, and overlap within a plane do not count. The mesh must be welded, so that triangles
/// share vertices by number; the topology is that of the mesh.
std::size_t countPiercingPairs(const Mesh& welded, const Topology& topology, const TriangleTree& tree);

}  // namespace bilayer::detail
