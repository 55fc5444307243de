// SPDX-License-Identifier: Apache-2.0
// The triangles near a short path are found by branch and bound. Highway compiles the search once for each instruction
// set.
#include "collider/field/queries/sphere_tracing.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "collider/field/queries/sphere_tracing.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>

#include "collider/field/triangles/tree_place.h"
#include "collider/field/triangles/triangle_tests.h"
#include "sdf/bvh/node_stack.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {

namespace {
// The search for the first contact of a swept sphere, among the triangles that it may reach.
class TouchSearch {
  public:
    TouchSearch(const MeshTree& mesh, const Path& path, double radius)
        : mesh_(mesh),
          tree_(mesh.tree()),
          place_(mesh, path.origin),
          path_(path),
          radius_(radius),
          hit_{path.length, glm::dvec3(0), noTriangle} {
        limit();
    }

    std::optional<MeshHit> run() {
        descend(
            tree_, tree_.root(), [&](float key) { return key > limit2_; },
            [&](std::uint32_t group, NodeStack& stack) { open(tree_.groups[group], stack); },
            [&](std::uint32_t leaf) { return visit(tree_.leaves[leaf]), false; });
        if (hit_.triangle == noTriangle) return std::nullopt;
        return hit_;
    }

  private:
    // Only triangles within this distance from the start can be touched before the best one.
    void limit() {
        const double reach = (radius_ + hit_.along) / double(mesh_.voxelSize());
        const float rounded = std::min(float(reach) * (1 + passRounding) + passTolerance + place_.slack, maxReach);
        limit2_ = rounded * rounded * roundUp;
    }

    void open(const BoxGroup& group, NodeStack& stack) const {
        const Tag tag;
        alignas(64) float distance2[treeWidth];
        unsigned near = 0;
        for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag)) {
            Vec sum = hn::Zero(tag);
            for (int k = 0; k < 3; ++k) {
                const Vec at = hn::Set(tag, place_.point[k]);
                const Vec gap = hn::Max(hn::Sub(hn::Load(tag, group.lower[k] + i), at),
                                        hn::Sub(at, hn::Load(tag, group.upper[k] + i)));
                sum = hn::Add(sum, square(hn::Max(gap, hn::Zero(tag))));
            }
            hn::Store(sum, tag, distance2 + i);
            near |= bitsOf(hn::Le(sum, hn::Set(tag, limit2_))) << i;
        }
        stack.pushChildren(near, distance2, group.firstChild);
    }

    void visit(const WideLeaf& leaf) {
        alignas(64) float distance2[treeWidth];
        measureLeaf(leaf, place_, distance2);
        for (std::size_t i = 0; i < treeWidth; ++i) {
            if (distance2[i] > limit2_) continue;
            if (!touches(mesh_, leaf.triangles[i], path_, radius_, hit_.along, hit_.position)) continue;
            hit_.triangle = leaf.triangles[i];
            limit();
        }
    }

    const MeshTree& mesh_;
    const WideTree& tree_;
    TreePlace place_;
    Path path_;
    double radius_;
    MeshHit hit_;
    float limit2_ = 0;
};

std::optional<MeshHit> searchTouch(const MeshTree& mesh, const Path& path, double radius) {
    return TouchSearch(mesh, path, radius).run();
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer::detail {

HWY_EXPORT(searchTouch);

std::optional<MeshHit> castSphere(const MeshTree& mesh, const Path& path, double radius) noexcept {
    return HWY_DYNAMIC_DISPATCH(searchTouch)(mesh, path, radius);
}

}  // namespace bilayer::detail
#endif  // HWY_ONCE
