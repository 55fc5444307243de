// Triangles from an outline in the plane; internal.
#pragma once

#include <cstddef>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "sdf/io/point_tree.h"

namespace bilayer::detail {

/// Cuts ears off an outline until a triangle is left. An ear is a convex corner whose triangle no other corner lies in:
/// G. H. Meisters, "Polygons have ears" (1975). Here the rest of the outline must in addition not touch the cut within,
/// so that corners on straight edges become corners of triangles with area. Only corners that are not convex can be in
/// the way; a tree holds them.
///
/// Outlines may touch themselves and run both ways along an edge. Where one leaves no such ear, the rules are relaxed
/// one by one; triangles may be folded over at last, if it crosses itself. Keeps its memory from one outline to the
/// next.
class EarClipper {
  public:
    /// @param outline    at least three corners, counter-clockwise
    /// @param triangles  appended: indices into the outline
    /// @return whether the outline fits together: no triangle is folded over, and each corner's triangles fill its
    ///         angle. Parts of an outline that fits may still lie on one another, if it crosses itself.
    bool clip(std::span<const glm::dvec2> outline, std::vector<glm::uvec3>& triangles);

    /// Whether the outline that was clipped last has a corner that is not convex.
    bool wasConvex() const { return wasConvex_; }

  private:
    /// What may be cut, in the order in which it is tried.
    enum class Rule {
        strict,    ///< the cut touches the outline at its ends only
        touching,  ///< the cut may touch the outline within
        flat,      ///< corners without area: on a straight line, or where the outline turns back
        convex,    ///< any convex corner; triangles may overlap
        any,       ///< any corner; triangles may be folded over
    };
    /// Corners where the outline turns back on itself: inward ones have the angle of a full turn, outward ones of none.
    enum class Spikes { inward, outward, both };
    struct Corner {
        glm::dvec2 at;
        unsigned before, after;
        unsigned round;  ///< when its neighbours changed last
        bool present, convex;
    };

    void link(std::span<const glm::dvec2> outline);
    bool playRound(Rule rule, std::vector<glm::uvec3>& triangles);
    void cut(unsigned v, std::vector<glm::uvec3>& triangles);
    void classify(unsigned v);
    void touch(unsigned v);
    void tryAll();
    void tryTouched();

    bool mayCut(unsigned v, Rule rule) const;
    bool isEar(unsigned v, Rule rule) const;
    bool keepsAngles(unsigned v, Rule rule) const;
    bool blocks(unsigned w, unsigned v, Rule rule) const;
    static Spikes spikesOf(std::span<const glm::dvec2> outline);
    bool isOutwardSpike(unsigned v) const;
    int side(unsigned a, unsigned b, unsigned p) const;

    std::vector<Corner> corners_;
    std::vector<unsigned> tried_, next_;  ///< corners to be tried in this round and in the next one
    PointTree obstacles_;                 ///< corners that are not convex
    unsigned left_ = 0, round_ = 0;
    Spikes spikes_ = Spikes::inward;
    bool wasConvex_ = false;
};

}  // namespace bilayer::detail
