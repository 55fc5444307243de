// SPDX-License-Identifier: Apache-2.0
// Triangulates a polygon in the plane by ear clipping; internal.
// Tested by tests/sdf/triangulate.cpp through triangulate().
#pragma once

#include <cstddef>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "sdf/io/point_tree.h"

namespace bilayer::detail {

/// Clips ears off a polygon until one triangle is left. An ear is a convex corner whose triangle contains no other
/// corner (G. H. Meisters, "Polygons have ears", 1975). Here, in addition, the interior of the cut must not touch the
/// rest of the outline, so that corners on straight edges become corners of triangles with area. Only corners that are
/// not convex can block an ear; a tree holds them.
///
/// Outlines may touch themselves and traverse an edge in both directions. First, an outline is separated at the points
/// where its inside is pinched: two triangles without area join the corners there, and cut it into parts. If a part has
/// no ear of the above kind, the rules are relaxed one by one. As a fallback, if the outline crosses itself, triangles
/// may be folded over. Memory is reused from one outline to the next.
class EarClipper {
  public:
    /// @param outline    at least three corners, counter-clockwise
    /// @param triangles  appended: indices into the outline
    /// @return whether the triangulation is consistent: no triangle is folded over, and the triangles at each corner
    ///         fill its angle. Parts of a consistent triangulation may still overlap, if the outline crosses itself.
    bool clip(std::span<const glm::dvec2> outline, std::vector<glm::uvec3>& triangles);

    /// Returns whether the last outline was strictly convex.
    bool wasConvex() const { return wasConvex_; }

  private:
    /// Rules for ears, in the order in which they are tried.
    enum class Rule {
        strict,    ///< the cut touches the outline only at its ends
        touching,  ///< the interior of the cut may touch the outline
        flat,      ///< corners on a straight line
        convex,    ///< any convex corner; triangles may overlap
        any,       ///< any corner; triangles may be folded over
    };
    struct Corner {
        glm::dvec2 at;
        unsigned before, after;
        unsigned round;  ///< the round in which its neighbours last changed
        bool present, convex;
        bool full;  ///< its interior angle is 360 degrees
    };

    void link(std::span<const glm::dvec2> outline);
    bool playRound(Rule rule, std::vector<glm::uvec3>& triangles);
    void cut(unsigned v, std::vector<glm::uvec3>& triangles);
    void remove(unsigned v);
    bool finish(unsigned v, std::vector<glm::uvec3>& triangles);
    void cutEmpty(std::vector<glm::uvec3>& triangles);
    void separate(std::vector<glm::uvec3>& triangles);
    bool isPinched(unsigned v, unsigned w) const;
    void split(unsigned v, unsigned w, std::vector<glm::uvec3>& triangles);
    void classify(unsigned v);
    void update(unsigned v);
    void tryAll();
    void tryChanged();

    bool mayCut(unsigned v, Rule rule) const;
    bool isEar(unsigned v, Rule rule) const;
    bool isEmpty(unsigned v) const;
    bool keepsAngles(unsigned v, Rule rule) const;
    bool blocks(unsigned w, unsigned v, Rule rule) const;
    void findFullAngles(std::span<const glm::dvec2> outline);
    void narrow(unsigned at, unsigned v, unsigned to);
    bool isOutward(unsigned v) const;
    int side(unsigned a, unsigned b, unsigned p) const;

    std::vector<Corner> corners_;
    std::vector<unsigned> tried_, next_;  ///< corners to try in this round and in the next one
    std::vector<unsigned> changed_;       ///< corners whose edges have changed
    PointTree obstacles_;                 ///< corners that are not convex
    unsigned left_ = 0, round_ = 0;
    bool wasConvex_ = false, fits_ = true;
};

}  // namespace bilayer::detail
