// SPDX-License-Identifier: Apache-2.0
// The outline of a polygon while corners are cut off.
// Tested by tests/sdf/triangulate.cpp through triangulate().
#pragma once

#include <cstddef>
#include <glm/vec2.hpp>
#include <span>
#include <utility>
#include <vector>

#include "sdf/io/polygon/point_tree.h"

namespace bilayer::detail {

/// Rules for ears, from the strictest to the loosest.
enum class EarRule {
    strict,    ///< the cut touches the outline only at its ends
    touching,  ///< the interior of the cut may touch the outline
    flat,      ///< corners on a straight line
    convex,    ///< any convex corner; triangles may overlap
    any,       ///< any corner; triangles may be folded over
};

/// Closed outlines in the plane, counter-clockwise: rings of corners. At first there is one; corners can be removed,
/// and a ring can be split into two. Memory is reused from one outline to the next.
class Outline {
  public:
    struct Corner {
        glm::dvec2 at;
        unsigned before, after;
        bool present, convex;
        bool full;  ///< its interior angle is 360 degrees
        /// The last corner that leavesInside() paired with it; at first itself.
        unsigned partner;
        bool partnerIsInside;  ///< the answer of leavesInside()
    };

    /// Starts with the corners of one ring.
    void reset(std::span<const glm::dvec2> points);

    const Corner& operator[](unsigned v) const { return corners_[v]; }
    unsigned size() const { return unsigned(corners_.size()); }  ///< count of corners, removed ones included
    unsigned left() const { return left_; }                      ///< count of corners that are not removed
    bool wasConvex() const { return wasConvex_; }                ///< whether it was strictly convex at first
    /// 1 if corner p is to the left of the line from a to b, -1 to its right, 0 on it.
    int side(unsigned a, unsigned b, unsigned p) const;

    /// Returns whether a rule allows to cut a corner off.
    bool mayCut(unsigned v, EarRule rule) const;
    /// Returns whether the outline reverses at a corner that is not full: an outward spike without area.
    bool isEmpty(unsigned v) const;
    /// Returns whether two corners at the same point can be joined within the outline: the corner w arrives and leaves,
    /// in this order, between the edges of v, on the inner side.
    bool isPinched(unsigned v, unsigned w);

    /// Joins the neighbours of a corner, and removes it. The neighbours must be classified again.
    void cut(unsigned v);
    void remove(unsigned v);
    /// Joins two pinched corners, so that each gets a ring of its own. Both must be classified again.
    void split(unsigned v, unsigned w);
    /// Finds out again whether a corner is convex.
    void classify(unsigned v);

  private:
    bool isEar(unsigned v, EarRule rule) const;
    bool keepsAngles(unsigned v, EarRule rule) const;
    bool blocks(unsigned w, unsigned v, EarRule rule) const;
    void findFullAngles(std::span<const glm::dvec2> points);
    void narrowAngle(unsigned at, unsigned v, unsigned to);
    bool isOutward(unsigned v) const;
    bool leavesInside(unsigned v, unsigned w);
    int leavingSide(unsigned v, unsigned w, const glm::dvec2& at, const glm::dvec2& from) const;

    std::vector<Corner> corners_;
    PointTree obstacles_;                              ///< corners that are not convex
    std::vector<std::pair<unsigned, unsigned>> path_;  ///< pairs of corners that leavesInside() passed
    unsigned left_ = 0;
    bool wasConvex_ = false;
};

}  // namespace bilayer::detail
