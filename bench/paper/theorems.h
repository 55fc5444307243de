// Theorems 1 and 2 of the paper at random triangles and wedges. Each function tries so many and gives the worst that it
// met.
#pragma once

#include <cstdint>

namespace bilayer::paper {

/// Theorem 1: `|d_e - d| < 2/3 L_max`, d_e from one sample a triangle, L_max the longest edge. d_e - d, over and under
/// the truth, as parts of L_max.
struct DistanceError {
    double over = 0, under = 0;
    double underDelta = 0;  ///< the latter as parts of delta
};

/// A triangle sampled at its barycentre, and a point over it, its foot within: random shapes, heights and delta.
DistanceError overTriangles(unsigned seed, int trials);

/// The same in 2D: an edge sampled in its middle; the bound is L_max / 2.
DistanceError overEdges(unsigned seed, int trials);

/// A wedge: two rows of triangles that meet in an edge, at a random angle of the solid between two [rad]; a point
/// anywhere outside within 2 of the edge, nearer to it than to the wedge's border. Delta is a half; L_max is from 0.1
/// to 2.
DistanceError aroundWedges(unsigned seed, int trials, double minAngle, double maxAngle);

/// Theorem 2, in 2D: an edge of 2 L1 and a longer one of 2 L2, bent outward by 2 theta, sampled in their middles:
/// `OF <= (L2 - L1) / 2` where `L2 tan(theta) <= delta`. That F is the farthest point on the wrong side needs more: the
/// region OGF of Fig. 6 is a triangle only where the bisector of P and Q meets the longer edge, which is where
/// `delta sin(2 theta) < L2 + L1 cos(2 theta)`.
struct SignError {
    double bound = 0;         ///< most of OF over (L2 - L1) / 2, OF by the paper's formula
    double formula = 0;       ///< most that |FP| and |FQ| differ at the formula's F
    double farthest = 0;      ///< most of the distance of a point on the wrong side, over OF
    std::uint64_t wrong = 0;  ///< points met on the wrong side
};
/// @param closed  only bends whose OGF is a triangle; else only the others
SignError aroundBends(unsigned seed, int trials, bool closed);

}  // namespace bilayer::paper
