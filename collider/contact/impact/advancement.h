// SPDX-License-Identifier: Apache-2.0
// Conservative advancement: B. Mirtich, "Impulse-based dynamic simulation of rigid body systems", 1996.
// Tested by tests/collider/time_of_impact.cpp through timeOfImpact().
#pragma once

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <optional>

namespace bilayer::detail {

/// The first place on a path that is within a tolerance of a surface. Each step travels the clearance less the part
/// `left`. Nothing if the whole path stays farther away.
/// @param length       of the path
/// @param left         part of the clearance that a step leaves, at most the tolerance
/// @param maxSteps     a path that takes more of them counts as near where they end
/// @param clearanceAt  (travelled length): a lower bound of the distance from the surface there
template <class Real, class ClearanceAt>
std::optional<Real> firstNear(Real length, Real tolerance, Real left, int maxSteps, ClearanceAt&& clearanceAt) {
    Real travelled = 0;
    for (int steps = 0; travelled <= length; ++steps) {
        if (steps == maxSteps) return travelled;
        const Real clearance = clearanceAt(travelled);
        if (!(clearance > tolerance)) return travelled;
        travelled += clearance - left;
    }
    return std::nullopt;
}

/// Whether a straight path stays clear of a surface. A path that takes many steps counts as not clear.
/// @param minClearance  positive
/// @param clearanceAt   float (const glm::vec3&): a lower bound of the distance from the surface
template <class ClearanceAt>
bool staysClear(const glm::vec3& from, const glm::vec3& to, float minClearance, ClearanceAt&& clearanceAt) {
    constexpr int maxSteps = 64;
    // in double precision: the square of a length above 1e19 is no float
    const auto length = float(glm::distance(glm::dvec3(from), glm::dvec3(to)));
    const auto along = [&](float travelled) {
        return clearanceAt(length > 0 ? from + travelled / length * (to - from) : from);
    };
    return !firstNear(length, minClearance, 0.f, maxSteps, along);
}

}  // namespace bilayer::detail
