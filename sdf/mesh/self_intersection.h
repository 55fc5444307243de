// SPDX-License-Identifier: Apache-2.0
// Finds where a surface self-intersects.
// Tested by tests/sdf/inspect.cpp.
#pragma once

#include <cstddef>

#include <bilayer/sdf/mesh.h>
#include "sdf/bvh/triangle_tree.h"
#include "sdf/mesh/topology.h"

namespace bilayer::detail {

/// Counts the pairs of intersecting triangles that share no edge. Two triangles intersect if they have a segment in
/// common, and if each surface continues on both sides of the other there, within the triangle or across an edge of it.
/// Contact at points, contact along edges of both, and overlap within a plane do not count. The mesh must be welded, so
/// that triangles share vertices by index. `topology` must be that of the mesh.
std::size_t countIntersectingPairs(const Mesh& welded, const Topology& topology, const TriangleTree& tree);

}  // namespace bilayer::detail
