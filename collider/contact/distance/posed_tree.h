// SPDX-License-Identifier: Apache-2.0
// The hierarchy of a mesh placed in a frame that it shares with another mesh.
// Tested by tests/collider/distance.cpp through distance().
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <limits>
#include <utility>

#include "collider/contact/distance/mesh_distance.h"
#include "collider/field/triangles/mesh_tree.h"

namespace bilayer::detail {

/// An oriented box in the common frame [m].
struct OrientedBounds {
    glm::dmat3 axes{1};  ///< unit vectors, as columns
    glm::dvec3 centre{0}, half{0};

    double size2() const { return glm::dot(half, half); }
};

/// A node, and the group and slot that hold its box; no group for a root.
struct PosedNode {
    std::uint32_t index;
    const OrientedBoxes* group = nullptr;
    std::uint32_t slot = 0;
};

/// The frame of a group's boxes in the common frame. The stored axes are orthonormal to floats only, which would make
/// bounds of far pairs too large: these are orthonormal to doubles, and boxes grow by the difference.
struct GroupFrame {
    glm::dmat3 axes;
    glm::dvec3 origin;
    double unit;  ///< a voxel of the tree [m]
    double skew;  ///< the largest difference to the stored axes
};

inline glm::dmat3 orthonormal(const glm::dmat3& m) {
    const glm::dvec3 x = glm::normalize(m[0]), y = glm::normalize(m[1] - glm::dot(m[1], x) * x), z = glm::cross(x, y);
    return {x, y, glm::dot(z, m[2]) < 0 ? -z : z};
}

/// What a search through one or two trees has still to visit, the nearest last.
/// @tparam Entry  has a `bound`, the minimum of what is below
/// @tparam trees  that the search descends
template <class Entry, std::size_t trees = 1>
class NearestStack {
  public:
    bool isEmpty() const { return count_ == 0; }
    void push(const Entry& entry) { entries_[count_++] = entry; }
    Entry pop() { return entries_[--count_]; }

    /// Adds the entries that `pushAll` pushes, sorted.
    template <class PushAll>
    void pushSorted(const PushAll& pushAll) {
        const auto first = std::ptrdiff_t(count_);
        pushAll();
        std::sort(entries_.begin() + first, entries_.begin() + std::ptrdiff_t(count_),
                  [](const Entry& one, const Entry& other) { return one.bound > other.bound; });
    }

  private:
    std::size_t count_ = 0;
    std::array<Entry, trees * maxOpenNodes> entries_;
};

/// The triangles of a leaf, each once: a halved triangle may have several parts in it.
struct LeafTriangles {
    std::size_t count = 0;
    std::array<std::uint32_t, treeWidth> indices;

    explicit LeafTriangles(const WideLeaf& leaf) {
        for (const std::uint32_t triangle : leaf.triangles)
            if (const auto last = indices.begin() + std::ptrdiff_t(count);
                std::find(indices.begin(), last, triangle) == last)
                indices[count++] = triangle;
    }
    auto begin() const { return indices.begin(); }
    auto end() const { return indices.begin() + std::ptrdiff_t(count); }
};

/// A mesh with its hierarchy in the common frame. For use by one thread: keeps the frames of groups that are used
/// again.
class PosedTree {
  public:
    PosedTree(const MeshTree& mesh, const Similarity& map) : mesh_(mesh), map_(map) {
        ofFrame_.fill(nullptr);
        unit_ = map.scale * double(mesh.voxelSize());
        origin_ = map(glm::dvec3(mesh.tree().base) * double(mesh.voxelSize()));
        linear_ = map.scale * map.rotation;
    }

    const WideTree& tree() const { return mesh_.tree(); }
    const OrientedBoxes& group(std::uint32_t node) const { return mesh_.group(node); }
    std::size_t triangleCount() const { return mesh_.mesh().triangles.size(); }

    const GroupFrame& frameOf(const OrientedBoxes& group) {
        const std::size_t place = (reinterpret_cast<std::uintptr_t>(&group) / sizeof(OrientedBoxes)) % keptFrames;
        if (ofFrame_[place] != &group) {
            ofFrame_[place] = &group;
            frames_[place] = makeFrame(group);
        }
        return frames_[place];
    }

    OrientedBounds boundsOf(const PosedNode& node) {
        if (!node.group) {
            const glm::dvec3 half = 0.5 * unit_ * glm::dvec3(tree().size);
            return {map_.rotation, map_.rotation * half + origin_, half};
        }
        const GroupFrame& frame = frameOf(*node.group);
        glm::dvec3 lower, upper;
        for (int k = 0; k < 3; ++k) {
            lower[k] = unit_ * double(node.group->lower[k][node.slot]);
            upper[k] = unit_ * double(node.group->upper[k][node.slot]);
        }
        const double growth = frame.skew * glm::length(glm::max(glm::abs(lower), glm::abs(upper)));
        return {frame.axes, frame.axes * (0.5 * (lower + upper)) + frame.origin, 0.5 * (upper - lower) + growth};
    }

    TriangleCorners corners(std::uint32_t triangle) const {
        const Mesh& mesh = mesh_.mesh();
        const glm::uvec3& t = mesh.triangles[triangle];
        const auto posed = [&](const glm::vec3& p) {
            return linear_[0] * double(p.x) + linear_[1] * double(p.y) + (linear_[2] * double(p.z) + map_.shift);
        };
        return {posed(mesh.points[t.x]), posed(mesh.points[t.y]), posed(mesh.points[t.z])};
    }

    /// The minimum height of the triangles of a leaf along a direction of the common frame.
    double minHeight(std::uint32_t leaf, const glm::dvec3& direction) const {
        const Mesh& mesh = mesh_.mesh();
        const glm::dvec3 inMesh = direction * linear_;
        double lowest = std::numeric_limits<double>::infinity();
        for (const std::uint32_t triangle : tree().leaves[leaf].triangles)
            for (int k = 0; k < 3; ++k)
                lowest = std::min(lowest, glm::dot(inMesh, glm::dvec3(mesh.points[mesh.triangles[triangle][k]])));
        return lowest + glm::dot(direction, map_.shift);
    }

    /// The triangle nearest to a point of the common frame, and its closest point.
    std::pair<std::uint32_t, glm::dvec3> nearest(const glm::dvec3& point) const {
        const glm::dvec3 at = mesh_.approached(map_.inverse(point));
        const std::uint32_t triangle = mesh_.nearest(at, std::numeric_limits<float>::infinity());
        if (triangle == noTriangle) return {noTriangle, point};
        return {triangle, map_(at + mesh_.featureOf(triangle, at).offset)};
    }

    /// The squared size of a node's box, to compare nodes by.
    double size2Of(const PosedNode& node) const {
        glm::dvec3 half(tree().size);
        if (node.group)
            for (int k = 0; k < 3; ++k)
                half[k] = double(node.group->upper[k][node.slot] - node.group->lower[k][node.slot]);
        return unit_ * unit_ * glm::dot(half, half);
    }

  private:
    static constexpr std::size_t keptFrames = 64;

    GroupFrame makeFrame(const OrientedBoxes& group) const {
        glm::dmat3 stored;
        for (int k = 0; k < 3; ++k) stored[k] = glm::dvec3(group.axes[k][0], group.axes[k][1], group.axes[k][2]);
        const glm::dmat3 axes = orthonormal(stored), off = axes - stored;
        const double skew = std::max({glm::length(off[0]), glm::length(off[1]), glm::length(off[2])});
        const glm::dvec3 origin(group.origin[0], group.origin[1], group.origin[2]);
        return {map_.rotation * axes, map_.rotation * (unit_ * origin) + origin_, unit_, skew};
    }

    const MeshTree& mesh_;
    const Similarity& map_;
    double unit_;
    glm::dvec3 origin_;
    glm::dmat3 linear_;
    std::array<const OrientedBoxes*, keptFrames> ofFrame_;
    std::array<GroupFrame, keptFrames> frames_;
};

}  // namespace bilayer::detail
