// SPDX-License-Identifier: Apache-2.0
// Oriented boxes of two groups against each other. Highway includes this file once for each instruction set: only
// between HWY_BEFORE_NAMESPACE's headers and its own, after hwy/highway.h.
// Tested by tests/sdf/triangle_tree.cpp through findClosePairs().
#if defined(BILAYER_SDF_ROTATED_BOXES_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BILAYER_SDF_ROTATED_BOXES_H
#undef BILAYER_SDF_ROTATED_BOXES_H
#else
#define BILAYER_SDF_ROTATED_BOXES_H
#endif

#include <hwy/highway.h>

#include <cstddef>

#include "sdf/bvh/oriented_groups.h"
#include "sdf/bvh/tree_lanes.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace {

// The bounds of a child along the axes of its group.
struct ChildBox {
    float lower[3], upper[3];

    ChildBox(const float (&from)[3][treeWidth], const float (&to)[3][treeWidth], std::size_t place) {
        for (int k = 0; k < 3; ++k) lower[k] = from[k][place], upper[k] = to[k][place];
    }
};

// Tests boxes of one group against those of another along the axes of both.
class Rotation {
  public:
    // `room`: margin for rounding
    Rotation(const OrientedGroup& own, const OrientedGroup& other, float room) : room_(room) {
        for (int k = 0; k < 3; ++k)
            for (int j = 0; j < 3; ++j)
                between_[k][j] = other.axes[k][0] * own.axes[j][0] + other.axes[k][1] * own.axes[j][1] +
                                 other.axes[k][2] * own.axes[j][2];
    }

    // Returns a bit for each box of the other group, from a lane on, that meets a box of the own group.
    unsigned met(const ChildBox& own, const float (&lower)[3][treeWidth], const float (&upper)[3][treeWidth],
                 std::size_t lane) const {
        const Tag tag;
        Mask meets = hn::FirstN(tag, treeWidth);
        Vec ownLow[3], ownHigh[3];
        for (int j = 0; j < 3; ++j) ownLow[j] = ownHigh[j] = hn::Zero(tag);
        for (int k = 0; k < 3; ++k) {
            const Vec from = hn::Load(tag, lower[k] + lane), to = hn::Load(tag, upper[k] + lane);
            float low = -room_, high = room_;
            for (int j = 0; j < 3; ++j) {
                const float r = between_[k][j];
                low += r * (r > 0 ? own.lower[j] : own.upper[j]);
                high += r * (r > 0 ? own.upper[j] : own.lower[j]);
                ownLow[j] = hn::Add(ownLow[j], hn::Mul(hn::Set(tag, r), r > 0 ? from : to));
                ownHigh[j] = hn::Add(ownHigh[j], hn::Mul(hn::Set(tag, r), r > 0 ? to : from));
            }
            meets = hn::And(meets, hn::And(hn::Le(from, hn::Set(tag, high)), hn::Ge(to, hn::Set(tag, low))));
        }
        for (int j = 0; j < 3; ++j)
            meets = hn::And(meets, hn::And(hn::Le(ownLow[j], hn::Set(tag, own.upper[j] + room_)),
                                           hn::Ge(ownHigh[j], hn::Set(tag, own.lower[j] - room_))));
        return bitsOf(meets);
    }

  private:
    float between_[3][3];  // the other's axes along the own ones
    float room_;
};

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
