// SPDX-License-Identifier: Apache-2.0
// SIMD distances of points to the boxes and leaves of a WideTree. Highway includes this file once for each instruction
// set: only between HWY_BEFORE_NAMESPACE's headers and its own, after hwy/highway.h. No sum crosses lanes, so all
// instruction sets give the same bytes.
// Tested by tests/sdf/pseudonormal.cpp through build().
#if defined(BILAYER_SDF_LEAF_MEASURE_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BILAYER_SDF_LEAF_MEASURE_H
#undef BILAYER_SDF_LEAF_MEASURE_H
#else
#define BILAYER_SDF_LEAF_MEASURE_H
#endif

#include <hwy/highway.h>

#include "sdf/bvh/tree_lanes.h"
#include "sdf/bvh/wide_tree.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// Margin for the rounding of a squared distance.
constexpr float roundUp = 1 + 1e-6f;
/// The max coordinate and the max reach of a search [voxels]. Their squares are finite. Unused boxes are infinitely far
/// away and therefore stay out of reach.
constexpr float maxCoordinate = 1e18f, maxReach = 4e18f;

inline Vec square(Vec x) {
    return hn::Mul(x, x);
}

// Returns the square of the distance by which a point on an edge's line lies beyond the ends of the edge.
inline Vec beyond2(Vec place, Vec length) {
    const Vec zero = hn::Zero(Tag());
    return square(hn::Max(hn::Max(hn::Neg(place), hn::Sub(place, length)), zero));
}

// Squared distances, and signed heights above the triangles. A height is 0 for a point whose projection lies outside of
// the triangle.
struct Measured {
    Vec distance2, height;
};

// Measures points against triangles, one pair per lane. load() returns a lane's triangle data from an array of the
// leaf. The points are relative to corner A of the triangles. The distance within the plane is the min over the three
// edges. Each edge contributes the distance perpendicular to it and the distance beyond its ends. If the projection
// lies in the triangle, only the distance beyond counts; it is zero for at least one edge. Thus rounding cannot mistake
// the line of a sliver for its interior.
template <class Load>
inline Measured measureFromCorner(const WideLeaf& leaf, Load load, Vec qx, Vec qy, Vec qz) {
    const Tag tag;
    const auto dot = [&](Vec ax, Vec ay, Vec az, Vec bx, Vec by, Vec bz) {
        return hn::Add(hn::Add(hn::Mul(ax, bx), hn::Mul(ay, by)), hn::Mul(az, bz));
    };
    const auto det = [&](Vec a, Vec b, Vec c, Vec d) { return hn::Sub(hn::Mul(a, d), hn::Mul(b, c)); };
    const Vec nx = load(leaf.normal[0]), ny = load(leaf.normal[1]), nz = load(leaf.normal[2]);
    const Vec ax = load(leaf.along[0]), ay = load(leaf.along[1]), az = load(leaf.along[2]);
    const Vec x = dot(qx, qy, qz, ax, ay, az), z = dot(qx, qy, qz, nx, ny, nz);
    const Vec y = dot(qx, qy, qz, det(ny, nz, ay, az), det(nz, nx, az, ax), det(nx, ny, ax, ay));

    const Vec ab = load(leaf.lengthAB), fromB = hn::Sub(x, ab);
    const Vec bcx = load(leaf.directionBC[0]), bcy = load(leaf.directionBC[1]);
    const Vec acx = load(leaf.directionAC[0]), acy = load(leaf.directionAC[1]);
    const Vec acrossBC = det(bcx, bcy, fromB, y), acrossAC = det(x, y, acx, acy);
    const Vec alongBC = hn::Add(hn::Mul(fromB, bcx), hn::Mul(y, bcy));
    const Vec alongAC = hn::Add(hn::Mul(x, acx), hn::Mul(y, acy));
    const Mask over = hn::Gt(hn::Min(y, hn::Min(acrossBC, acrossAC)), hn::Zero(tag));
    const auto edge = [&](Vec across, Vec along, Vec length) {
        return hn::Add(beyond2(along, length), hn::IfThenZeroElse(over, square(across)));
    };
    const Vec flat2 = hn::Min(edge(y, x, ab), hn::Min(edge(acrossBC, alongBC, load(leaf.lengthBC)),
                                                      edge(acrossAC, alongAC, load(leaf.lengthAC))));
    return {hn::Add(flat2, square(z)), hn::IfThenElseZero(over, z)};
}

// Does the same for points in the tree's frame.
template <class Load>
inline Measured measure(const WideLeaf& leaf, Load load, Vec px, Vec py, Vec pz) {
    return measureFromCorner(leaf, load, hn::Sub(hn::Sub(px, load(leaf.cell[0])), load(leaf.corner[0])),
                             hn::Sub(hn::Sub(py, load(leaf.cell[1])), load(leaf.corner[1])),
                             hn::Sub(hn::Sub(pz, load(leaf.cell[2])), load(leaf.corner[2])));
}

}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
