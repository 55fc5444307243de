// SPDX-License-Identifier: Apache-2.0
// Places in the frame of a mesh's tree, and their distances to the triangles of its leaves. Highway includes this file
// once for each instruction set: only between HWY_BEFORE_NAMESPACE's headers and its own, after hwy/highway.h.
// Tested by tests/collider/mesh_rays.cpp through MeshTree.
#if defined(BILAYER_COLLIDER_TREE_PLACE_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BILAYER_COLLIDER_TREE_PLACE_H
#undef BILAYER_COLLIDER_TREE_PLACE_H
#else
#define BILAYER_COLLIDER_TREE_PLACE_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/vec3.hpp>

#include "collider/field/triangles/mesh_tree.h"
#include "sdf/bvh/leaf_measure.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {

/// Max rounding of points and boxes in the tree's frame, relative to their size.
constexpr float placeRounding = 2.4e-7f;
/// Tolerances of the single-precision tests, absolute [voxels] and relative to the distance from the start. Triangles
/// within them are tested in double precision.
constexpr float passTolerance = 1e-4f, passRounding = 1e-6f;

// A point in the tree's frame, as whole voxels and the rest [voxels].
struct SplitPoint {
    glm::vec3 cell{0}, inCell{0};

    SplitPoint() = default;
    explicit SplitPoint(const glm::dvec3& p) : cell(glm::floor(p)), inCell(p - glm::floor(p)) {}

    // The vector from a leaf's corners; whole voxels first, without rounding.
    template <class Load>
    Vec from(const WideLeaf& leaf, Load load, int k) const {
        return hn::Add(hn::Sub(hn::Set(Tag(), cell[k]), load(leaf.cell[k])),
                       hn::Sub(hn::Set(Tag(), inCell[k]), load(leaf.corner[k])));
    }
};

// Moves a point that is too far away towards the corner of the tree. The distances to all triangles then become smaller
// by the same amount, up to the slack of a TreePlace.
inline glm::dvec3 withinReach(const glm::dvec3& p) {
    const double away = std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)});
    return away > double(maxCoordinate) ? p * (double(maxCoordinate) / away) : p;
}

// A point in the tree's frame within reach, with the max rounding of boxes relative to it [voxels].
struct TreePlace : SplitPoint {
    glm::vec3 point;
    float slack;

    // From a point in the mesh's coordinates [m].
    TreePlace(const MeshTree& mesh, const glm::dvec3& at)
        : TreePlace(mesh.tree(), withinReach(at / double(mesh.voxelSize()) - glm::dvec3(mesh.tree().base))) {}

  private:
    TreePlace(const WideTree& tree, const glm::dvec3& p) : SplitPoint(p), point(p) {
        const glm::vec3 size = glm::max(glm::abs(point), glm::vec3(tree.size));
        slack = placeRounding * (size.x + size.y + size.z);
    }
};

// The squared distances to a leaf's triangles.
inline void measureLeaf(const WideLeaf& leaf, const TreePlace& place, float* distance2) {
    const Tag tag;
    for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag)) {
        const auto load = [&](const float* from) { return hn::Load(tag, from + i); };
        const Vec x = place.from(leaf, load, 0), y = place.from(leaf, load, 1), z = place.from(leaf, load, 2);
        hn::Store(measureFromCorner(leaf, load, x, y, z).distance2, tag, distance2 + i);
    }
}

}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
