// SPDX-License-Identifier: Apache-2.0
// Finds pairs of triangles of a mesh that may intersect, by a fast test of boxes and planes.
// Tested by tests/sdf/triangle_tree.cpp.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "sdf/bvh/triangle_tree.h"

namespace bilayer::detail {

/// Pairs the triangles of a leaf with each other and with those of later leaves. All leaves together yield each pair of
/// the mesh once. A pair is omitted in these cases:
/// - its boxes do not overlap, or those of their leaves along oblique axes,
/// - its boxes lie in one plane across an axis,
/// - its triangles share an edge,
/// - its leaves share one vertex, and the edges opposite to it certainly do not meet the other leaf,
/// - a plane through an edge of one triangle certainly separates them, except for shared vertices,
/// - one triangle certainly lies on one side of the other's plane, except for shared vertices.
/// @param welded  the tree's mesh, in which triangles share vertices by index
/// @param pairs   overwritten; in each pair, the triangle of `leaf` comes first
void findClosePairs(const Mesh& welded, const TriangleTree& tree, std::uint32_t leaf,
                    std::vector<std::pair<unsigned, unsigned>>& pairs);

}  // namespace bilayer::detail
