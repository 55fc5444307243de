// SPDX-License-Identifier: Apache-2.0
// The squared distances from one triangle to several, one in each SIMD lane. Highway includes this file once for each
// instruction set: only between HWY_BEFORE_NAMESPACE's headers and its own, after hwy/highway.h.
// Tested by tests/collider/triangle_distance.cpp.
#if defined(BILAYER_COLLIDER_TRIANGLE_DISTANCE_LANES_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BILAYER_COLLIDER_TRIANGLE_DISTANCE_LANES_H
#undef BILAYER_COLLIDER_TRIANGLE_DISTANCE_LANES_H
#else
#define BILAYER_COLLIDER_TRIANGLE_DISTANCE_LANES_H
#endif

#include <hwy/highway.h>

#include <cstddef>
#include <limits>

#include "sdf/base/triangle_corners.h"
#include "sdf/base/vector_lanes.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// Triangles with their edges and normals; the triangle in each lane is one and the same, or another one.
template <class D>
struct CornerLanes {
    VectorLanes<D> corners[3], edges[3], normal;  // the edges begin at the corners
    hn::Vec<D> lengths2[3];                       // of the edges

    CornerLanes(const VectorLanes<D>& first, const VectorLanes<D>& second, const VectorLanes<D>& third)
        : corners{first, second, third} {
        for (int i = 0; i < 3; ++i) {
            edges[i] = corners[(i + 1) % 3] - corners[i];
            lengths2[i] = dot<D>(edges[i], edges[i]);
        }
        normal = cross<D>(edges[2], edges[0]);  // to the bit as in triangle_distance.cpp
    }
};

template <class D>
HWY_INLINE VectorLanes<D> sameInAll(D tag, const glm::dvec3& v) {
    return {hn::Set(tag, v.x), hn::Set(tag, v.y), hn::Set(tag, v.z)};
}

/// numerator / denominator, limited to [0, 1]; 0 where the denominator is not positive.
template <class D>
HWY_INLINE hn::Vec<D> dividedIn01(D tag, hn::Vec<D> numerator, hn::Vec<D> denominator) {
    const auto zero = hn::Zero(tag);
    const auto quotient = hn::Div(numerator, denominator);
    return hn::IfThenElse(hn::Gt(denominator, zero), hn::Min(hn::Max(quotient, zero), hn::Set(tag, 1.0)), zero);
}

/// The squared distance of two edges, as in triangle_distance.cpp.
template <class D>
HWY_INLINE hn::Vec<D> edgeDistance2(D tag, const VectorLanes<D>& p, const VectorLanes<D>& u, hn::Vec<D> uu,
                                    const VectorLanes<D>& q, const VectorLanes<D>& v, hn::Vec<D> vv) {
    const VectorLanes<D> r = p - q;
    const auto uv = dot<D>(u, v), ur = dot<D>(u, r), vr = dot<D>(v, r);
    const auto determinant = hn::Sub(hn::Mul(uu, vv), hn::Mul(uv, uv));
    auto s = dividedIn01<D>(tag, hn::Sub(hn::Mul(uv, vr), hn::Mul(ur, vv)), determinant);
    const auto t = dividedIn01<D>(tag, hn::Add(hn::Mul(uv, s), vr), vv);
    s = dividedIn01<D>(tag, hn::Sub(hn::Mul(uv, t), ur), uu);
    const VectorLanes<D> between = r + scaled<D>(u, s) - scaled<D>(v, t);
    return dot<D>(between, between);
}

/// Whether a point projects into a triangle.
template <class D>
HWY_INLINE hn::Mask<D> covers(D tag, const CornerLanes<D>& triangle, const VectorLanes<D>& point) {
    const auto zero = hn::Zero(tag);
    auto inside = hn::Gt(dot<D>(triangle.normal, triangle.normal), zero);
    for (int i = 0; i < 3; ++i) {
        const VectorLanes<D> across = cross<D>(triangle.edges[i], point - triangle.corners[i]);
        inside = hn::And(inside, hn::Ge(dot<D>(across, triangle.normal), zero));
    }
    return inside;
}

/// The squared distance from the corners of one triangle to the interior of another. 0 where an edge of the first
/// passes through the second. Infinite where there is neither.
template <class D>
HWY_INLINE hn::Vec<D> cornerDistance2(D tag, const CornerLanes<D>& corners, const CornerLanes<D>& face) {
    const auto zero = hn::Zero(tag);
    auto result = hn::Set(tag, std::numeric_limits<double>::infinity());
    hn::Vec<D> heights[3];
    const auto normal2 = dot<D>(face.normal, face.normal);
    for (int i = 0; i < 3; ++i) {
        heights[i] = dot<D>(corners.corners[i] - face.corners[0], face.normal);
        const auto found = hn::IfThenElse(covers<D>(tag, face, corners.corners[i]),
                                          hn::Div(hn::Mul(heights[i], heights[i]), normal2), result);
        result = hn::Min(result, found);
    }
    for (int i = 0; i < 3; ++i) {
        const auto before = heights[i], after = heights[(i + 1) % 3];
        const auto crosses = hn::Lt(hn::Mul(before, after), zero);
        if (hn::AllFalse(tag, crosses)) continue;
        const VectorLanes<D> at =
            corners.corners[i] + scaled<D>(corners.edges[i], hn::Div(before, hn::Sub(before, after)));
        result = hn::IfThenElse(hn::And(crosses, covers<D>(tag, face, at)), zero, result);
    }
    return result;
}

/// The squared distances of two triangles in each lane, to roundings of those of closestPoints().
template <class D>
HWY_INLINE hn::Vec<D> triangleDistance2(D tag, const CornerLanes<D>& a, const CornerLanes<D>& b) {
    auto result = hn::Min(cornerDistance2<D>(tag, a, b), cornerDistance2<D>(tag, b, a));
    for (int i = 0; i < 3; ++i)
        for (int k = 0; k < 3; ++k)
            result = hn::Min(result, edgeDistance2<D>(tag, a.corners[i], a.edges[i], a.lengths2[i], b.corners[k],
                                                      b.edges[k], b.lengths2[k]));
    return result;
}

}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
