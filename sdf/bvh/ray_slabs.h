// SPDX-License-Identifier: Apache-2.0
// The boxes of a tree's group that a ray meets. Highway includes this file once for each instruction set: only between
// HWY_BEFORE_NAMESPACE's headers and its own, after hwy/highway.h.
// Tested by tests/collider/mesh_rays.cpp through firstHit().
#if defined(BILAYER_SDF_RAY_SLABS_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BILAYER_SDF_RAY_SLABS_H
#undef BILAYER_SDF_RAY_SLABS_H
#else
#define BILAYER_SDF_RAY_SLABS_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/vec3.hpp>

#include "sdf/bvh/node_stack.h"
#include "sdf/bvh/tree_lanes.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace {

/// Minimum component of a direction along an axis. With it, a ray stays between two planes for a billion times their
/// tolerance, which is beyond all boxes.
constexpr float minSpeed = 1e-9f;
/// Tolerance for the rounding of a quotient.
constexpr float quotientRoundUp = 1 + 1e-6f;

// A ray against boxes: T. Kay, J. Kajiya, "Ray tracing complex scenes", SIGGRAPH 1986, 269-278.
class RaySlabs {
  public:
    /// @param slack  margin around boxes for rounding
    RaySlabs(const glm::vec3& origin, const glm::vec3& direction, float slack) {
        for (int k = 0; k < 3; ++k) {
            const bool down = direction[k] < 0;
            perDirection_[k] = (down ? -1 : 1) / std::max(std::abs(direction[k]), minSpeed);
            forward_[k] = !down;
            nearOrigin_[k] = origin[k] + (down ? -slack : slack);
            farOrigin_[k] = origin[k] - (down ? -slack : slack);
        }
    }

    // The children of a group that the ray meets within a limit: a bit for each, and where it enters and leaves it.
    struct Met {
        alignas(64) float enters[treeWidth];
        alignas(64) float leaves[treeWidth];
        unsigned bits = 0;

        // Keeps the children that the ray meets both here and there, where it is in both boxes.
        void intersect(const Met& other) {
            bits &= other.bits;
            for (std::size_t i = 0; i < treeWidth; ++i) {
                enters[i] = std::max(enters[i], other.enters[i]);
                leaves[i] = std::min(leaves[i], other.leaves[i]);
                if (enters[i] > leaves[i] * quotientRoundUp) bits &= ~(1u << i);
            }
        }
    };

    Met met(const float (&lower)[3][treeWidth], const float (&upper)[3][treeWidth], float limit) const {
        const Tag tag;
        Met found;
        for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag)) {
            Vec enter = hn::Zero(tag), leave = hn::Set(tag, limit);
            for (int k = 0; k < 3; ++k) {
                const float* first = forward_[k] ? lower[k] : upper[k];
                const float* second = forward_[k] ? upper[k] : lower[k];
                const Vec per = hn::Set(tag, perDirection_[k]);
                enter = hn::Max(enter, hn::Mul(hn::Sub(hn::Load(tag, first + i), hn::Set(tag, nearOrigin_[k])), per));
                leave = hn::Min(leave, hn::Mul(hn::Sub(hn::Load(tag, second + i), hn::Set(tag, farOrigin_[k])), per));
            }
            hn::Store(enter, tag, found.enters + i);
            hn::Store(leave, tag, found.leaves + i);
            found.bits |= bitsOf(hn::Le(enter, hn::Mul(leave, hn::Set(tag, quotientRoundUp)))) << i;
        }
        return found;
    }

    // Pushes the children of a group that the ray enters within a limit. Their keys are where it does.
    void pushMet(const BoxGroup& group, float limit, NodeStack& stack) const {
        const Met found = met(group.lower, group.upper, limit);
        stack.pushChildren(found.bits, found.enters, group.firstChild);
    }

  private:
    float perDirection_[3], nearOrigin_[3], farOrigin_[3];
    bool forward_[3];
};

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
