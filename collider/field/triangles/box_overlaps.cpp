// SPDX-License-Identifier: Apache-2.0
// Separating axes reject most boxes of the tree. Highway compiles the search once for each instruction set.
#include "collider/field/triangles/box_overlaps.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "collider/field/triangles/box_overlaps.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "collider/field/triangles/tree_place.h"
#include "sdf/bvh/node_stack.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {

namespace {
// The search for a triangle that overlaps a box.
class BoxSearch {
  public:
    BoxSearch(const MeshTree& mesh, const RotatedBox& box)
        : mesh_(mesh.mesh()), tree_(mesh.tree()), place_(mesh, box.centre), box_(box) {
        const double perMetre = 1 / double(mesh.voxelSize());
        const glm::dvec3 half = box.halfSize * perMetre;
        const float margin = passTolerance + place_.slack;
        const float radius = std::min(float(glm::length(half)) * (1 + passRounding) + margin, maxReach);
        limit2_ = radius * radius * roundUp;
        for (int k = 0; k < 3; ++k) {
            axes_[k] = glm::vec3(box.axes[k]);
            half_[k] = float(half[k]) * (1 + passRounding) + 2 * margin;
            around_[k] = float(glm::dot(glm::abs(glm::transpose(box.axes)[k]), half)) * (1 + passRounding) + 2 * margin;
        }
    }

    bool run() {
        return descend(
            tree_, tree_.root(), [](float) { return false; },
            [&](std::uint32_t group, NodeStack& stack) { open(tree_.groups[group], stack); },
            [&](std::uint32_t leaf) { return visit(tree_.leaves[leaf]); });
    }

  private:
    // Separating axes: the tree's and the box's own axes separate nearly all disjoint boxes.
    void open(const BoxGroup& group, NodeStack& stack) const {
        const Tag tag;
        const Vec halve = hn::Set(tag, 0.5f);
        alignas(64) float distance2[treeWidth];
        unsigned near = 0;
        for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag)) {
            Vec centre[3], half[3], sum = hn::Zero(tag);
            Mask met = hn::FirstN(tag, treeWidth);
            for (int k = 0; k < 3; ++k) {
                const Vec lower = hn::Load(tag, group.lower[k] + i), upper = hn::Load(tag, group.upper[k] + i);
                half[k] = hn::Mul(halve, hn::Sub(upper, lower));
                centre[k] = hn::Sub(hn::Mul(halve, hn::Add(lower, upper)), hn::Set(tag, place_.point[k]));
                const Vec gap = hn::Sub(hn::Abs(centre[k]), half[k]);
                sum = hn::Add(sum, square(hn::Max(gap, hn::Zero(tag))));
                met = hn::And(met, hn::Le(gap, hn::Set(tag, around_[k])));
            }
            for (int axis = 0; axis < 3; ++axis) {
                Vec distance = hn::Zero(tag), reach = hn::Set(tag, half_[axis]);
                for (int k = 0; k < 3; ++k) {
                    distance = hn::Add(distance, hn::Mul(centre[k], hn::Set(tag, axes_[axis][k])));
                    reach = hn::Add(reach, hn::Mul(half[k], hn::Set(tag, std::abs(axes_[axis][k]))));
                }
                met = hn::And(met, hn::Le(hn::Abs(distance), reach));
            }
            hn::Store(sum, tag, distance2 + i);
            near |= bitsOf(met) << i;
        }
        stack.pushChildren(near, distance2, group.firstChild);
    }

    bool visit(const WideLeaf& leaf) const {
        alignas(64) float distance2[treeWidth];
        measureLeaf(leaf, place_, distance2);
        for (std::size_t i = 0; i < treeWidth; ++i)
            if (distance2[i] <= limit2_ && overlaps(box_, cornersOf(mesh_, leaf.triangles[i]))) return true;
        return false;
    }

    const Mesh& mesh_;
    const WideTree& tree_;
    TreePlace place_;
    RotatedBox box_;
    float limit2_ = 0;
    glm::vec3 axes_[3];
    float half_[3], around_[3];  // extents of the box along its own axes, and along the tree's
};

bool searchBox(const MeshTree& mesh, const RotatedBox& box) {
    return BoxSearch(mesh, box).run();
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer::detail {

HWY_EXPORT(searchBox);

bool meetsTriangle(const MeshTree& mesh, const RotatedBox& box) noexcept {
    return HWY_DYNAMIC_DISPATCH(searchBox)(mesh, box);
}

}  // namespace bilayer::detail
#endif  // HWY_ONCE
