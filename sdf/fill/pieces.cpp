// SPDX-License-Identifier: Apache-2.0
// Highway compiles the code between HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE once per instruction set.
#include "sdf/fill/pieces.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "sdf/fill/pieces.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "sdf/base/vector_lanes.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace {

using Tag = hn::CappedTag<float, PieceCutter::batch>;
using Vec = hn::Vec<Tag>;
using Mask = hn::Mask<Tag>;

/// Rounding of a sample's position and its covering radius [voxels].
constexpr float radiusSlack = 1e-5f;
/// Shorter edges count as points, and a piece with a smaller height counts as its longest edge [voxels]. Floats hold
/// the squares of longer lengths.
constexpr float shortest = 1e-9f;

using Vec3 = VectorLanes<Tag>;

inline Vec3 select(Mask mask, Vec3 yes, Vec3 no) {
    return {hn::IfThenElse(mask, yes.x, no.x), hn::IfThenElse(mask, yes.y, no.y), hn::IfThenElse(mask, yes.z, no.z)};
}
// Returns whether a length is large enough to define a direction.
inline Mask isLength(Vec length) {
    return hn::Gt(length, hn::Set(Tag(), shortest));
}

// Returns the reciprocal of a length; zero if it is too small.
inline Vec inverse(Vec length) {
    return hn::IfThenElseZero(isLength(length), hn::Div(hn::Set(Tag(), 1.f), length));
}

// Returns a unit vector perpendicular to a unit vector, for pieces without height.
inline Vec3 across(Vec3 u) {
    const Tag tag;
    const Mask useX = hn::Lt(hn::Abs(u.x), hn::Set(tag, 0.6f));
    const Vec one = hn::Set(tag, 1.f), zero = hn::Zero(tag);
    const Vec3 perpendicular = cross(u, select(useX, {one, zero, zero}, {zero, one, zero}));
    return scaled(perpendicular, inverse(hn::Sqrt(dot(perpendicular, perpendicular))));
}

// The values of a batch of pieces, one column per piece.
struct Columns {
    void put(int row, std::size_t i, Vec value) { hn::Store(value, Tag(), values[row] + i); }
    void put(int row, std::size_t i, Vec3 value) {
        put(row, i, value.x);
        put(row + 1, i, value.y);
        put(row + 2, i, value.z);
    }
    glm::vec3 vec3(int row, std::size_t i) const { return {values[row][i], values[row + 1][i], values[row + 2][i]}; }
    alignas(64) float values[24][PieceCutter::batch];
};
enum PieceRow {
    origin = 0,
    axisU = 3,
    axisW = 6,
    axisN = 9,
    length = 12,
    left = 13,
    right = 16,
    sample = 19,
    radius = 22
};

// Stores the unit vector and the length of an edge in (u, w).
inline void putEdge(Columns& columns, int row, std::size_t i, Vec x, Vec y) {
    const Tag tag;
    const Vec size = hn::Sqrt(hn::Add(hn::Mul(x, x), hn::Mul(y, y))), part = inverse(size);
    columns.put(row, i, hn::IfThenElse(isLength(size), hn::Mul(x, part), hn::Set(tag, 1.f)));
    columns.put(row + 1, i, hn::Mul(y, part));
    columns.put(row + 2, i, size);
}

inline void makeColumns(const PieceCutter::WaitingPieces& waiting, std::size_t i, Columns& columns) {
    const Tag tag;
    const Vec3 corner = loadLanes(tag, waiting.corner, i), ab = loadLanes(tag, waiting.ab, i),
               ac = loadLanes(tag, waiting.ac, i), bc = ac - ab;
    // Permutes the corners cyclically so that the longest edge comes first.
    const Vec ab2 = dot(ab, ab), bc2 = dot(bc, bc), ca2 = dot(ac, ac);
    const Mask first = hn::And(hn::Ge(ab2, bc2), hn::Ge(ab2, ca2)), second = hn::Ge(bc2, ca2);
    const Vec3 none{hn::Zero(tag), hn::Zero(tag), hn::Zero(tag)};
    const Vec3 begin = select(first, corner, select(second, corner + ab, corner + ac));
    const Vec3 edge = select(first, ab, select(second, bc, none - ac));
    const Vec3 third = select(first, ac, select(second, none - ab, ab - ac));

    const Vec size = hn::Sqrt(dot(edge, edge));
    const Vec3 u =
        select(isLength(size), scaled(edge, inverse(size)), {hn::Set(tag, 1.f), hn::Zero(tag), hn::Zero(tag)});
    const Vec along = hn::Min(hn::Max(dot(third, u), hn::Zero(tag)), size);
    const Vec3 rest = third - scaled(u, along);
    Vec height = hn::Sqrt(dot(rest, rest));
    // Orthogonalized a second time, because the remainder of a flat piece is mostly rounding. If nothing remains then,
    // all of it was rounding.
    const Vec3 rough = scaled(rest, inverse(height)), straight = rough - scaled(u, dot(rough, u));
    const Vec straightLength = hn::Sqrt(dot(straight, straight));
    const Mask flat = hn::Or(hn::Not(isLength(height)), hn::Lt(straightLength, hn::Set(tag, 0.5f)));
    const Vec3 w = select(flat, across(u), scaled(straight, inverse(straightLength)));
    height = hn::IfThenZeroElse(flat, height);
    columns.put(PieceRow::origin, i, begin);
    columns.put(PieceRow::axisU, i, u);
    columns.put(PieceRow::axisW, i, w);
    columns.put(PieceRow::axisN, i, cross(u, w));
    columns.put(PieceRow::length, i, size);
    putEdge(columns, PieceRow::left, i, along, height);
    putEdge(columns, PieceRow::right, i, hn::Sub(along, size), height);
    // Centre of the smallest enclosing circle: the circumcentre, or the middle of the longest edge.
    const Vec half = hn::Mul(hn::Set(tag, 0.5f), size);
    const Vec lift = hn::Div(hn::Sub(hn::Add(hn::Mul(along, along), hn::Mul(height, height)), hn::Mul(along, size)),
                             hn::Add(height, height));
    const Vec up = hn::IfThenZeroElse(flat, hn::Max(lift, hn::Zero(tag)));
    columns.put(PieceRow::sample, i, begin + scaled(u, half) + scaled(w, up));
    columns.put(PieceRow::radius, i,
                hn::Add(hn::Sqrt(hn::Add(hn::Mul(half, half), hn::Mul(up, up))), hn::Set(tag, radiusSlack)));
}

void makePieces(const PieceCutter::WaitingPieces& waiting, std::size_t count, Piece* pieces) {
    Columns columns;
    for (std::size_t i = 0; i < count; i += hn::Lanes(Tag())) makeColumns(waiting, i, columns);
    const auto& v = columns.values;
    for (std::size_t i = 0; i < count; ++i)
        pieces[i] = {waiting.base[i],
                     columns.vec3(PieceRow::origin, i),
                     columns.vec3(PieceRow::axisU, i),
                     columns.vec3(PieceRow::axisW, i),
                     columns.vec3(PieceRow::axisN, i),
                     v[PieceRow::length][i],
                     v[PieceRow::left][i],
                     v[PieceRow::left + 1][i],
                     v[PieceRow::left + 2][i],
                     v[PieceRow::right][i],
                     v[PieceRow::right + 1][i],
                     v[PieceRow::right + 2][i],
                     columns.vec3(PieceRow::sample, i),
                     v[PieceRow::radius][i],
                     waiting.triangle[i]};
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer::detail {
namespace {

HWY_EXPORT(makePieces);

}  // namespace

void PieceCutter::halve(const TriangleCorners& c, std::uint32_t triangle, const TriangleLimits& limits) {
    const glm::dvec3 ab = c[1] - c[0], bc = c[2] - c[1], ca = c[0] - c[2];
    const std::array<double, 3> lengths2{glm::dot(ab, ab), glm::dot(bc, bc), glm::dot(ca, ca)};
    const auto longest = std::max_element(lengths2.begin(), lengths2.end());
    const auto i = std::size_t(longest - lengths2.begin()), j = (i + 1) % 3, k = (i + 2) % 3;
    const glm::dvec3 middle = 0.5 * (c[i] + c[j]);
    for (const TriangleCorners& half : {TriangleCorners{c[i], middle, c[k]}, TriangleCorners{middle, c[j], c[k]}})
        if (!misses(half, limits)) cut(half, triangle, limits);
}

void PieceCutter::finish() {
    const std::size_t before = pieces_.size();
    pieces_.resize(before + std::size_t(count_));
    HWY_DYNAMIC_DISPATCH(makePieces)(waiting_, std::size_t(count_), pieces_.data() + before);
    count_ = 0;
}

}  // namespace bilayer::detail
#endif  // HWY_ONCE
