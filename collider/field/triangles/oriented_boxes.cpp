// SPDX-License-Identifier: Apache-2.0
#include "collider/field/triangles/oriented_boxes.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <limits>

#include "sdf/base/jacobi_rotation.h"

namespace bilayer::detail {
namespace {

/// Count of group levels with oriented boxes; the surface in larger groups is hardly flat.
constexpr int orientedLevels = 3;
/// Margin of boxes for the rounding of vertices to floats [voxels].
constexpr float roundingRoom = 1e-5f;
constexpr std::size_t groupsPerTask = 16;
constexpr float unbounded = std::numeric_limits<float>::infinity();

struct Box {
    glm::vec3 lower{unbounded}, upper{-unbounded};

    void add(const glm::vec3& p) { lower = glm::min(lower, p), upper = glm::max(upper, p); }
    float halfArea() const {
        const glm::vec3 s = upper - lower;
        return s.x * s.y + s.y * s.z + s.z * s.x;
    }
};

glm::vec3 vectorOf(const float (&from)[3][treeWidth], int i) {
    return {from[0][i], from[1][i], from[2][i]};
}

// Calls visit(corner a, b, c, normal) for the triangles of a leaf, relative to an origin.
template <class Visit>
void forTriangles(const WideLeaf& leaf, const glm::vec3& origin, Visit visit) {
    for (int i = 0; i < treeWidth; ++i) {
        const glm::vec3 a = vectorOf(leaf.cell, i) - origin + vectorOf(leaf.corner, i);
        const glm::vec3 x = vectorOf(leaf.along, i), z = vectorOf(leaf.normal, i), y = glm::cross(z, x);
        const float ac = leaf.lengthAC[i];
        visit(a, a + leaf.lengthAB[i] * x, a + ac * (leaf.directionAC[0][i] * x + leaf.directionAC[1][i] * y), z);
    }
}

using Boxes = std::array<Box, treeWidth>;

// The leaves of a group's children, which are consecutive.
struct LeafRange {
    std::uint32_t first, each, end;
};

float halfArea(const Boxes& boxes) {
    float sum = 0;
    for (const Box& box : boxes)
        if (box.lower.x <= box.upper.x) sum += box.halfArea();
    return sum;
}

// The principal axes of the normals.
glm::mat3 frameOf(const WideTree& tree, const LeafRange& leaves, const glm::vec3& origin) {
    glm::mat3 spread(0);
    for (std::uint32_t leaf = leaves.first; leaf < leaves.end; ++leaf)
        forTriangles(tree.leaves[leaf], origin, [&](const auto& a, const auto& b, const auto& c, const auto& n) {
            const float area = glm::length(glm::cross(b - a, c - a));
            for (int k = 0; k < 3; ++k) spread[k] += area * n[k] * n;
        });
    return eigenvectors(spread);
}

Boxes boxesOf(const WideTree& tree, const LeafRange& leaves, const glm::vec3& origin, const glm::mat3& frame) {
    Boxes boxes;
    for (std::uint32_t leaf = leaves.first; leaf < leaves.end; ++leaf) {
        Box& box = boxes[(leaf - leaves.first) / leaves.each];
        forTriangles(tree.leaves[leaf], origin, [&](const auto& a, const auto& b, const auto& c, const auto&) {
            for (const glm::vec3* p : {&a, &b, &c}) box.add(*p * frame);
        });
    }
    return boxes;
}

// Fills a group with the boxes of its children, oriented or along the axes.
void fill(const WideTree& tree, const BoxGroup& aligned, const LeafRange& leaves, bool oriented, OrientedBoxes& group) {
    group.firstChild = aligned.firstChild;
    glm::vec3 origin(0);
    glm::mat3 frame(1);
    Boxes boxes;
    for (int i = 0; i < treeWidth; ++i)
        boxes[std::size_t(i)] = {vectorOf(aligned.lower, i), vectorOf(aligned.upper, i)};
    if (oriented) {
        origin = glm::floor(boxes[0].lower);
        frame = frameOf(tree, leaves, origin);
        boxes = boxesOf(tree, leaves, origin, frame);
        const Boxes others = boxesOf(tree, leaves, origin, glm::mat3(1));
        if (halfArea(others) <= halfArea(boxes)) boxes = others, frame = glm::mat3(1);
    }
    for (int k = 0; k < 3; ++k) {
        group.origin[k] = origin[k];
        for (int j = 0; j < 3; ++j) group.axes[k][j] = frame[k][j];
        for (int i = 0; i < treeWidth; ++i) {
            const Box& box = boxes[std::size_t(i)];
            group.lower[k][i] = box.lower[k] - roundingRoom;
            group.upper[k][i] = box.upper[k] + roundingRoom;
        }
    }
}

}  // namespace

LargeArray<OrientedBoxes> makeOrientedBoxes(const WideTree& tree) {
    LargeArray<OrientedBoxes> groups(tree.groupCount);
    std::uint32_t begin = 0, children = tree.leafCount, leavesInChild = 1;
    for (int level = 0; begin < tree.groupCount; ++level) {
        const std::uint32_t count = (children + treeWidth - 1) / treeWidth;
        tbb::parallel_for(tbb::blocked_range<std::uint32_t>(0, count, groupsPerTask), [&](const auto& range) {
            for (std::uint32_t i = range.begin(); i < range.end(); ++i) {
                const LeafRange leaves{i * treeWidth * leavesInChild, leavesInChild,
                                       std::min(tree.leafCount, (i + 1) * treeWidth * leavesInChild)};
                fill(tree, tree.groups[begin + i], leaves, level < orientedLevels, groups[begin + i]);
            }
        });
        begin += count;
        children = count;
        leavesInChild *= treeWidth;
    }
    return groups;
}

}  // namespace bilayer::detail
