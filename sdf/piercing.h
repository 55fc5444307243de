// Where a surface runs through itself.
#pragma once

#include <cstddef>

#include "sdf/mesh.h"
#include "sdf/triangle_tree.h"

namespace bilayer {

/// Counts the pairs of triangles that share no edge and where an edge of one properly pierces the other. Touching and
/// overlap within a plane do not count. The mesh must be welded, so that triangles share vertices by number.
std::size_t countPiercingPairs(const Mesh& welded, const TriangleTree& tree);

}  // namespace bilayer
