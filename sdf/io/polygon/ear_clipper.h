// SPDX-License-Identifier: Apache-2.0
// Triangulates a polygon in the plane by ear clipping; internal.
// Tested by tests/sdf/triangulate.cpp through triangulate().
#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "sdf/io/polygon/outline.h"

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
    bool wasConvex() const { return outline_.wasConvex(); }

  private:
    using Triangles = std::vector<glm::uvec3>;

    void start(std::span<const glm::dvec2> outline);
    bool playRound(EarRule rule, Triangles& triangles);
    void cut(unsigned v, Triangles& triangles);
    bool finish(unsigned v, Triangles& triangles);
    void cutEmpty(Triangles& triangles);
    void separate(Triangles& triangles);
    void split(unsigned v, unsigned w, Triangles& triangles);
    void update(unsigned v);
    void tryAll();
    void tryChanged();

    Outline outline_;
    std::vector<unsigned> rounds_;        ///< for each corner, the round in which its neighbours last changed
    std::vector<unsigned> tried_, next_;  ///< corners to try in this round and in the next one
    std::vector<unsigned> changed_;       ///< corners whose edges have changed
    unsigned round_ = 0;
    bool fits_ = true;
};

}  // namespace bilayer::detail
