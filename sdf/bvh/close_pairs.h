// Which triangles of a mesh may run through each other, by a quick look at boxes and planes.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "sdf/bvh/triangle_tree.h"

namespace bilayer::detail {

/// Pairs of the triangles of a leaf with each other and with those of later leaves, so that all leaves together have
/// each pair of the mesh once. Left out are pairs whose boxes do not meet, that share an edge, or of which one triangle
/// surely lies on one side of the other's plane but for vertices that they share.
/// @param welded  the tree's mesh, in which triangles share vertices by number
/// @param pairs   replaced; within each, the triangle of `leaf` comes first
void findClosePairs(const Mesh& welded, const TriangleTree& tree, std::uint32_t leaf,
                    std::vector<std::pair<unsigned, unsigned>>& pairs);

}  // namespace bilayer::detail
