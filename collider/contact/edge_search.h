// Where an edge is deepest in another body between two places, and how it touches there; internal.
#pragma once

#include <cmath>
#include <glm/geometric.hpp>
#include <optional>

#include "collider/contact/surface_query.h"

namespace bilayer::detail {

/// Of the deepest place on an edge [voxels].
inline constexpr float searchTolerance = 2e-3f;
/// A point that slides along a face ends in the edges beyond it by rounding. A path that goes less deep than this only
/// grazes a surface, and does not meet it [voxels].
inline constexpr float grazingTolerance = 0.25f;

/// A function of one variable at a place.
struct Slope {
    float place, value, slope;
};

/// Whether a function may have a kink between two places or close to one of them, as where an edge crosses another that
/// the interpolant has rounded off. Slopes are of distances.
inline bool mayKinkBetween(const Slope& from, const Slope& to) {
    constexpr float minRotation = 0.1f;
    constexpr float rounded = 0.5f;  // the slope that may be left at the kink itself
    return to.slope - from.slope > minRotation && from.slope < rounded && to.slope > -rounded;
}

/// Whether it falls from either into a valley, by more than rounding makes of a plane.
inline bool fallsBetween(const Slope& from, const Slope& to) {
    constexpr float minSlope = 0.02f;
    return from.slope < -minSlope && to.slope > minSlope;
}

/// The lowest place between two where the function falls from the first and rises to the second, as where an edge
/// crosses another body. Where the tangents meet, and where the slope would vanish if it went evenly, in turns: the one
/// is exact at a kink, the other on a parabola, and either leaves a shorter piece (the cutting planes of J. E. Kelley,
/// "The cutting-plane method for solving convex programs", J. SIAM 8 (1960) 703-712, in one dimension). The same way
/// for the same function: the answer goes as evenly as the function does.
/// @param tolerance  of values
/// @param at  (place) -> std::optional<Slope>; nothing where the function is not known: the search then gives up
template <class Function>
std::optional<Slope> lowestBetween(Slope from, Slope to, float tolerance, Function&& at) {
    constexpr int maxQueries = 7;
    constexpr float flat = 0.01f;        // slopes below lead nowhere
    constexpr float nearestEnd = 0.02f;  // no place is asked for nearer to the ends of a piece than this part of it
    Slope best = from.value < to.value ? from : to;
    for (int i = 0; i < maxQueries; ++i) {
        const float width = to.place - from.place, turn = to.slope - from.slope;
        if (!(turn > 0)) break;
        const bool tangents = i % 2 == 0;
        const float aside = tangents ? from.value - to.value + to.slope * width : -from.slope * width;
        const float part = std::fmin(std::fmax(aside / (turn * width), nearestEnd), 1 - nearestEnd);
        const std::optional<Slope> next = at(from.place + part * width);
        if (!next) return std::nullopt;
        if (next->value <= best.value) best = *next;
        const float below = from.value + from.slope * part * width;
        if (std::abs(next->slope) < flat || (tangents && next->value - below < tolerance)) break;
        (next->slope < 0 ? from : to) = *next;
    }
    return best;
}

/// How an edge touches at its deepest place, square to itself. Where it crosses the ridge between two faces: the way
/// over the ridge, but no deeper than half as much again as it has sunk in, since through a thin blade there is a
/// shorter way. Else across the face that looks least along the edge. Nothing where all look along it.
/// @param along  the edge's direction, of unit length
/// @param before, after  touches very close to the place on either side, where they are known
inline std::optional<SurfaceSample> acrossEdge(const glm::vec3& along, const SurfaceSample& here,
                                               const std::optional<SurfaceSample>& before,
                                               const std::optional<SurfaceSample>& after) {
    constexpr float minAcross = 0.3f;  // cosine between the normal and its part across
    constexpr float minRidge = 0.05f;  // sine between two faces that are not one
    constexpr float maxDeeper = 1.5f;
    std::optional<SurfaceSample> held;
    float most = minAcross;
    for (const auto& touch : {std::optional(here), before, after}) {
        if (!touch) continue;
        const glm::vec3 across = touch->normal - glm::dot(touch->normal, along) * along;
        const float length = glm::length(across);
        if (!(length > most)) continue;
        most = length;
        held = SurfaceSample{touch->distance, across / length};
    }
    if (!held || !before || !after) return held;
    const glm::vec3 &a = before->normal, &b = after->normal;
    const float fall = -glm::dot(a, along), rise = glm::dot(b, along);
    if (!(fall > 0 && rise > 0 && glm::length(glm::cross(a, b)) > minRidge)) return held;
    // square to the edge and to the ridge
    const glm::vec3 over = rise * a + fall * b;
    const float length = glm::length(over);
    const float deeper = std::fmin((fall + rise) / length, maxDeeper);
    return SurfaceSample{here.distance < 0 ? deeper * here.distance : here.distance, over / length};
}

}  // namespace bilayer::detail
