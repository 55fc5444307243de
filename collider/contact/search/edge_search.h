// SPDX-License-Identifier: Apache-2.0
// Finds the deepest point of an edge in another body, and the contact there.
#pragma once

#include <cmath>
#include <glm/geometric.hpp>
#include <optional>

#include "collider/contact/search/surface_query.h"

namespace bilayer::detail {

/// Of the deepest point on an edge [voxels].
inline constexpr float searchTolerance = 2e-3f;

/// A function of one variable at a place: value and slope.
struct ValueAndSlope {
    float place, value, slope;
};

/// The distance of a surface along an edge.
/// @param along  the edge's direction, of unit length
inline ValueAndSlope slopeAlong(const glm::vec3& along, float place, const SurfaceSample& sample) {
    return {place, sample.distance, glm::dot(sample.normal, along)};
}

/// Whether the function may have a kink between two places or close to one of them. An edge that crosses another one
/// makes such a kink, which the interpolant rounds off. The function is a distance.
inline bool mayKinkBetween(const ValueAndSlope& from, const ValueAndSlope& to) {
    constexpr float minSlopeChange = 0.1f;
    constexpr float rounded = 0.5f;  // max remaining slope at the kink itself
    return to.slope - from.slope > minSlopeChange && from.slope < rounded && to.slope > -rounded;
}

/// Whether the function falls from both ends to a minimum in between. The threshold excludes rounding noise on a plane.
inline bool fallsBetween(const ValueAndSlope& from, const ValueAndSlope& to) {
    constexpr float minSlope = 0.02f;
    return from.slope < -minSlope && to.slope > minSlope;
}

/// Whether an edge may be deeper between two places than at both of them.
inline bool mayBeDeeperBetween(const ValueAndSlope& from, const ValueAndSlope& to) {
    return fallsBetween(from, to) || mayKinkBetween(from, to);
}

/// Finds the minimum between two places where the function falls from the first and rises to the second, as along an
/// edge that crosses another body. Two steps alternate: the intersection of the tangents, which is exact at a kink, and
/// the zero of the linearly interpolated slope, which is exact for a parabola. Either step shortens the interval (the
/// cutting planes of J. E. Kelley, "The cutting-plane method for solving convex programs", J. SIAM 8 (1960) 703-712, in
/// one dimension). The sequence of steps is fixed, so the result varies as smoothly as the function.
/// @param tolerance  of the function's value
/// @param at         (place) -> std::optional<ValueAndSlope>; std::nullopt where the function is unknown, which ends
///                   the search without a result
template <class Function>
std::optional<ValueAndSlope> minimumBetween(ValueAndSlope from, ValueAndSlope to, float tolerance, Function&& at) {
    constexpr int maxQueries = 7;
    constexpr float flat = 0.01f;            // slopes below this count as zero
    constexpr float minEndDistance = 0.02f;  // min distance of queries from the ends, as a fraction of the interval
    ValueAndSlope best = from.value < to.value ? from : to;
    for (int i = 0; i < maxQueries; ++i) {
        const float width = to.place - from.place, slopeChange = to.slope - from.slope;
        if (!(slopeChange > 0)) break;
        const bool tangents = i % 2 == 0;
        const float offset = tangents ? from.value - to.value + to.slope * width : -from.slope * width;
        const float part = std::fmin(std::fmax(offset / (slopeChange * width), minEndDistance), 1 - minEndDistance);
        const std::optional<ValueAndSlope> next = at(from.place + part * width);
        if (!next) return std::nullopt;
        if (next->value <= best.value) best = *next;
        const float below = from.value + from.slope * part * width;
        if (std::abs(next->slope) < flat || (tangents && next->value - below < tolerance)) break;
        (next->slope < 0 ? from : to) = *next;
    }
    return best;
}

/// The deepest place of an edge between two places: the minimum where the distance falls to one, else the lower end.
/// Arguments are those of minimumBetween().
template <class Function>
std::optional<ValueAndSlope> deepestBetween(const ValueAndSlope& from, const ValueAndSlope& to, float tolerance,
                                            Function&& at) {
    if (fallsBetween(from, to)) return minimumBetween(from, to, tolerance, at);
    return from.value < to.value ? from : to;
}

/// The contact of an edge at its deepest point, perpendicular to the edge. If the edge crosses the ridge between two
/// faces, the direction of depenetration leads over the ridge. The depth is limited to 1.5 times the measured one,
/// since through a thin blade there is a shorter exit. Otherwise the normal is that of the face whose normal is the
/// most perpendicular to the edge, projected. Nothing if all normals are nearly parallel to the edge.
/// @param along          the edge's direction, of unit length
/// @param before, after  samples very close to the point on either side, where they are known
inline std::optional<SurfaceSample> acrossEdge(const glm::vec3& along, const SurfaceSample& here,
                                               const std::optional<SurfaceSample>& before,
                                               const std::optional<SurfaceSample>& after) {
    constexpr float minAcross = 0.3f;  // min length of the normal's projection perpendicular to the edge
    constexpr float minRidge = 0.05f;  // sine of the angle between two normals; below, they belong to one face
    constexpr float maxDeeper = 1.5f;
    std::optional<SurfaceSample> best;
    float maxLength = minAcross;
    for (const auto& sample : {std::optional(here), before, after}) {
        if (!sample) continue;
        const glm::vec3 across = sample->normal - glm::dot(sample->normal, along) * along;
        const float length = glm::length(across);
        if (!(length > maxLength)) continue;
        maxLength = length;
        best = SurfaceSample{sample->distance, across / length};
    }
    if (!best || !before || !after) return best;
    const glm::vec3 &a = before->normal, &b = after->normal;
    const float fall = -glm::dot(a, along), rise = glm::dot(b, along);
    if (!(fall > 0 && rise > 0 && glm::length(glm::cross(a, b)) > minRidge)) return best;
    // perpendicular to the edge and to the ridge
    const glm::vec3 over = rise * a + fall * b;
    const float length = glm::length(over);
    const float deeper = std::fmin((fall + rise) / length, maxDeeper);
    return SurfaceSample{here.distance < 0 ? deeper * here.distance : here.distance, over / length};
}

/// The same with samples on either side of a place.
/// @param sampleAt  the surface at a place of the edge, where it is known
template <class SampleAt>
std::optional<SurfaceSample> acrossEdge(const glm::vec3& along, const SurfaceSample& here, float place, float voxelSize,
                                        SampleAt&& sampleAt) {
    const float offset = 2 * searchTolerance * voxelSize;
    return acrossEdge(along, here, sampleAt(place - offset), sampleAt(place + offset));
}

}  // namespace bilayer::detail
