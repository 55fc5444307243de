// SPDX-License-Identifier: Apache-2.0
// Theorems 1 and 2 of the paper at random triangles and wedges. Each function runs `trials` trials and returns the
// worst result.
#pragma once

#include <cstdint>
#include <glm/gtc/constants.hpp>

namespace bilayer::paper {

inline constexpr double pi = glm::pi<double>();

/// Theorem 1: `|d_e - d| < 2/3 L_max`, where d_e comes from one sample per triangle and L_max is the longest edge. The
/// members are d_e - d above and below the true distance, divided by L_max.
struct DistanceError {
    double over = 0, under = 0;
    double underDelta = 0;  ///< the latter divided by delta
};

/// A triangle sampled at its barycentre, and a point above it whose projection lies within the triangle. Shape, height
/// and delta are random.
DistanceError overTriangles(unsigned seed, int trials);

/// The same in 2D: an edge sampled at its midpoint; the bound is L_max / 2.
DistanceError overEdges(unsigned seed, int trials);

/// A wedge: two rows of triangles that share an edge, at a random interior angle of the solid within the two limits
/// [rad]. The point is anywhere outside within 2 of the edge, nearer to it than to the wedge's border. Delta is 0.5;
/// L_max is from 0.1 to 2.
DistanceError aroundWedges(unsigned seed, int trials, double minAngle, double maxAngle);

/// Theorem 2, in 2D: an edge of length 2 L1 and a longer one of 2 L2, bent outward by 2 theta, both sampled at their
/// midpoints. The claim is `OF <= (L2 - L1) / 2` where `L2 tan(theta) <= delta`. F is the farthest point of wrong sign
/// only under one more condition: the region OGF of Fig. 6 must be a triangle. It is one only where the bisector of P
/// and Q meets the longer edge, that is where `delta sin(2 theta) < L2 + L1 cos(2 theta)`.
struct SignError {
    double bound = 0;         ///< maximum of OF over (L2 - L1) / 2, OF by the paper's formula
    double formula = 0;       ///< maximum difference of |FP| and |FQ| at the formula's F
    double farthest = 0;      ///< maximum distance of a point of wrong sign, over OF
    std::uint64_t wrong = 0;  ///< count of points of wrong sign
};
/// @param closed  true: only bends whose OGF is a triangle; false: only the others
SignError aroundBends(unsigned seed, int trials, bool closed);

}  // namespace bilayer::paper
