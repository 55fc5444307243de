// SPDX-License-Identifier: Apache-2.0
// How far the triangles below a node of a hierarchy reach along a direction: the support function of a part of a mesh.
// Highway includes this file once for each instruction set: only between HWY_BEFORE_NAMESPACE's headers and its own,
// after hwy/highway.h.
// Tested by tests/collider/distance.cpp through distance().
#if defined(BILAYER_COLLIDER_NODE_HEIGHTS_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BILAYER_COLLIDER_NODE_HEIGHTS_H
#undef BILAYER_COLLIDER_NODE_HEIGHTS_H
#else
#define BILAYER_COLLIDER_NODE_HEIGHTS_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>

#include "collider/contact/distance/posed_tree.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// Lower bounds of the heights of the boxes of a group along a direction. Returns the slots whose bound is below a
/// limit, as bits.
inline unsigned boundHeights(const OrientedBoxes& group, const GroupFrame& frame, const glm::dvec3& direction,
                             double limit, double (&heights)[treeWidth]) {
    const hn::CappedTag<double, treeWidth> tag;
    const hn::Rebind<float, decltype(tag)> floats;
    const glm::dvec3 cosines = direction * frame.axes, sizes = glm::abs(cosines);
    const double origin = glm::dot(direction, frame.origin);
    const double growth = frame.unit * frame.skew * (sizes.x + sizes.y + sizes.z);
    unsigned below = 0;
    for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag)) {
        auto height = hn::Set(tag, origin), farthest = hn::Zero(tag);
        auto used = hn::FirstN(tag, hn::Lanes(tag));
        for (std::size_t k = 0; k < 3; ++k) {
            const auto lower = hn::PromoteTo(tag, hn::Load(floats, group.lower[k] + i));
            const auto upper = hn::PromoteTo(tag, hn::Load(floats, group.upper[k] + i));
            used = hn::And(used, hn::Le(lower, upper));
            const double cosine = cosines[int(k)];
            height = hn::MulAdd(hn::Set(tag, frame.unit * cosine), cosine < 0 ? upper : lower, height);
            farthest = hn::Add(farthest, hn::Max(hn::Abs(lower), hn::Abs(upper)));
        }
        height = hn::NegMulAdd(hn::Set(tag, growth), farthest, height);
        hn::Store(height, tag, heights + i);
        std::uint8_t bits[8] = {};
        hn::StoreMaskBits(tag, hn::And(used, hn::Lt(height, hn::Set(tag, limit))), bits);
        below |= unsigned(bits[0]) << i;
    }
    return below;
}

/// The minimum height of the triangles below a node along a direction. By branch and bound, lowest box first.
inline double minHeight(PosedTree& mesh, std::uint32_t top, const glm::dvec3& direction) {
    struct Pending {
        double bound;
        std::uint32_t node;
    };
    NearestStack<Pending> stack;
    double lowest = std::numeric_limits<double>::infinity();
    stack.push({-lowest, top});
    while (!stack.isEmpty()) {
        const auto [bound, node] = stack.pop();
        if (!(bound < lowest)) continue;
        if (mesh.tree().isLeaf(node)) {
            lowest = std::min(lowest, mesh.minHeight(node, direction));
            continue;
        }
        const OrientedBoxes& group = mesh.group(node);
        alignas(64) double bounds[treeWidth];
        unsigned below = boundHeights(group, mesh.frameOf(group), direction, lowest, bounds);
        stack.pushSorted([&] {
            for (; below != 0; below &= below - 1) {
                const auto slot = std::uint32_t(std::countr_zero(below));
                stack.push({bounds[slot], group.firstChild + slot});
            }
        });
    }
    return lowest;
}

/// The minimum heights of nodes of a mesh along a direction, kept for nodes that are asked for again.
class NodeHeights {
  public:
    void setDirection(const glm::dvec3& direction) {
        direction_ = direction;
        ++directions_;
    }

    double of(PosedTree& mesh, std::uint32_t node) {
        Kept& kept = kept_[node % kept_.size()];
        if (kept.node != node || kept.direction != directions_)
            kept = {node, directions_, minHeight(mesh, node, direction_)};
        return kept.height;
    }

  private:
    struct Kept {
        std::uint32_t node = 0;
        int direction = 0;  // number of the direction, from 1; 0: none yet
        double height = 0;
    };
    glm::dvec3 direction_{0};
    int directions_ = 0;
    std::array<Kept, 128> kept_;
};

}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
