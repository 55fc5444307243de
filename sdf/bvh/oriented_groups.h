// SPDX-License-Identifier: Apache-2.0
// Second boxes for the nodes of a tree over triangles, along axes that suit the triangles. Boxes along the coordinate
// axes overlap where oblique triangles lie in layers, as in shells within shells, or where long thin ones lie next to
// each other. Oriented boxes do not: S. Gottschalk, M. Lin, D. Manocha, "OBBTree", SIGGRAPH 1996.
// Tested by tests/sdf/triangle_tree.cpp through TriangleTree.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/base/large_array.h"
#include "sdf/bvh/box_tree.h"

namespace bilayer::detail {

class Progress;
struct TriangleLeaf;

/// The boxes of eight children of a group along common axes, and bounds of the unit normals below each child.
struct OrientedGroup {
    /// Unit normals are multiplied by this, and rounded outward.
    static constexpr float normalScale = 127;

    alignas(64) float lower[3][treeWidth];  ///< by axis
    float upper[3][treeWidth];
    std::int8_t lowerNormal[3][treeWidth], upperNormal[3][treeWidth];
    float axes[3][3];    ///< of about unit length
    std::uint32_t fans;  ///< index of its FanGroup, or `noFans`

    /// Returns a vector's coordinates along the axes.
    template <class Vector>
    Vector along(const Vector& v) const {
        using Real = typename Vector::value_type;
        const auto dot = [&](int k) {
            return Real(axes[k][0]) * v.x + Real(axes[k][1]) * v.y + Real(axes[k][2]) * v.z;
        };
        return {dot(0), dot(1), dot(2)};
    }
};

inline constexpr std::uint32_t noFans = ~0u, noVertex = ~0u;

/// The children of an oriented group whose triangles all share a vertex. Where two triangles with a common vertex
/// intersect in a segment, so does an edge of one of them that is opposite to the vertex.
struct FanGroup {
    alignas(64) float lower[3][treeWidth];  ///< boxes of the opposite edges, along the axes of the group
    float upper[3][treeWidth];
    std::uint32_t vertex[treeWidth];  ///< the vertex of the mesh, or `noVertex`
};

struct OrientedGroups {
    LargeArray<OrientedGroup> groups;
    std::vector<FanGroup> fans;
};

/// Returns the oriented boxes of all groups over at most 512 leaves, in the order of the tree's groups. Larger groups
/// are few.
/// @param lastLeaf  count of triangles in the last leaf
/// @param progress  polled, unless null
OrientedGroups orientedGroups(const Mesh& mesh, const BoxTree& boxes, const LargeArray<TriangleLeaf>& leaves,
                              std::size_t lastLeaf, Progress* progress);

}  // namespace bilayer::detail
