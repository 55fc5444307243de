// SPDX-License-Identifier: Apache-2.0
// Triangulates a polygon in the plane by ear clipping; internal.
// Tested by tests/sdf/triangulate.cpp.
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
/// Outlines may touch themselves and traverse an edge in both directions. If an outline has no such ear, the rules are
/// relaxed one by one. As a fallback, if the outline crosses itself, triangles may be folded over. Memory is reused
/// from one outline to the next.
class EarClipper {
  public:
    /// @param outline    at least three corners, counter-clockwise
    /// @param triangles  appended: indices into the outline
    /// @return whether the triangulation is consistent: no triangle is folded over, and the triangles at each corner
    ///         fill its angle. Parts of a consistent triangulation may still overlap, if the outline crosses itself.
    bool clip(std::span<const glm::dvec2> outline, std::vector<glm::uvec3>& triangles);

    /// Returns whether the last outline was convex.
    bool wasConvex() const { return wasConvex_; }

  private:
    /// Rules for ears, in the order in which they are tried.
    enum class Rule {
        strict,    ///< the cut touches the outline only at its ends
        touching,  ///< the interior of the cut may touch the outline
        flat,      ///< corners without area: on a straight line, or where the outline reverses
        convex,    ///< any convex corner; triangles may overlap
        any,       ///< any corner; triangles may be folded over
    };
    /// Corners where the outline reverses direction. The interior angle is 360 degrees at inward spikes and 0 at
    /// outward ones.
    enum class Spikes { inward, outward, both };
    struct Corner {
        glm::dvec2 at;
        unsigned before, after;
        unsigned round;  ///< the round in which its neighbours last changed
        bool present, convex;
    };

    void link(std::span<const glm::dvec2> outline);
    bool playRound(Rule rule, std::vector<glm::uvec3>& triangles);
    void cut(unsigned v, std::vector<glm::uvec3>& triangles);
    void classify(unsigned v);
    void update(unsigned v);
    void tryAll();
    void tryChanged();

    bool mayCut(unsigned v, Rule rule) const;
    bool isEar(unsigned v, Rule rule) const;
    bool keepsAngles(unsigned v, Rule rule) const;
    bool blocks(unsigned w, unsigned v, Rule rule) const;
    static Spikes spikesOf(std::span<const glm::dvec2> outline);
    bool isOutwardSpike(unsigned v) const;
    int side(unsigned a, unsigned b, unsigned p) const;

    std::vector<Corner> corners_;
    std::vector<unsigned> tried_, next_;  ///< corners to try in this round and in the next one
    PointTree obstacles_;                 ///< corners that are not convex
    unsigned left_ = 0, round_ = 0;
    Spikes spikes_ = Spikes::inward;
    bool wasConvex_ = false;
};

}  // namespace bilayer::detail
