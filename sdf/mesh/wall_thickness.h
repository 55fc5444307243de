// How thick the solid behind a surface is.
#pragma once

#include <vector>

#include "sdf/bvh/triangle_tree.h"

namespace bilayer::detail {

/// For each triangle of the tree's mesh, the thickness of the solid behind it [m]: how far it is from its centre,
/// against its normal, to where the surface is left through its front; infinite where nothing ends it, or where it is
/// left at a flat angle (of less than 12 degrees), as at an edge.
std::vector<float> wallThickness(const TriangleTree& tree);

}  // namespace bilayer::detail
