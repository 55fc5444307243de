// SPDX-License-Identifier: Apache-2.0
#include "collider/field/zero/zero_bounds.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace bilayer::detail {
namespace {

constexpr double noLimit = std::numeric_limits<double>::infinity();
/// Accuracy of a multiplier, in distance from the plane, and max count of steps. There are at most three kinks.
constexpr double multiplierTolerance = 1e-9;
constexpr int maxMultipliers = 8;
/// Half the diagonal of a cube of side 2.
constexpr double halfDiagonal = 1.7320508075688773;

// The minimum of slope t + curvature t^2 for t in [-1, 1]; the curvature is not negative.
double minParabola(double slope, double curvature) {
    slope = std::abs(slope);
    return slope < 2 * curvature ? -slope * slope / (4 * curvature) : curvature - slope;
}

}  // namespace

// Lagrangian dual of the distance to the box within the slab. The multiplier is found by tangents; the bound holds for
// any multiplier.
Separation separation(const glm::dvec3& point, const CubeExpansion& cube) noexcept {
    const glm::dvec3 gradient = cube.gradient();
    const double height = cube.linearAt(point), steepness = glm::length(gradient);
    const glm::dvec3 low = cube.centre - cube.halfSide - point, high = cube.centre + cube.halfSide - point;
    // points of the slab have normal * offset <= beyond
    const glm::dvec3 normal = (height < 0 ? -1 : 1) / steepness * gradient;
    const double beyond = (cube.linearError() - std::abs(height)) / steepness;
    double multiplier = 0;
    glm::dvec3 offset = glm::clamp(glm::dvec3(0), low, high);
    const bool slices = std::isfinite(beyond) && beyond < 0;
    for (int i = 0; slices && i < maxMultipliers; ++i) {
        const double excess = glm::dot(normal, offset) - beyond;
        if (std::abs(excess) <= multiplierTolerance) break;
        // unclamped coordinates follow the multiplier; if there are none, up to the next one that is released
        double slope = 0, next = noLimit;
        for (int k = 0; k < 3; ++k) {
            const double free = -multiplier * normal[k];
            if (free > low[k] && free < high[k]) slope += normal[k] * normal[k];
            const double leaves = -offset[k] / normal[k];
            if (leaves > multiplier) next = std::min(next, leaves);
        }
        const double step = slope > 0 ? excess / slope : excess > 0 ? (1 + 1e-9) * next - multiplier : 0;
        if (!std::isfinite(step) || step == 0) break;
        multiplier = std::max(0.0, multiplier + step);
        offset = glm::clamp(-multiplier * normal, low, high);
    }
    const double length = glm::length(offset);
    if (!(length > 0)) return {glm::dvec3(1, 0, 0), -noLimit};
    const glm::dvec3 direction = offset / length;
    if (!slices) return {direction, length};
    const double weight = multiplier / length;
    const glm::dvec3 tilted = direction + weight * normal;
    const glm::dvec3 nearest = glm::min(tilted * low, tilted * high);
    return {direction, nearest.x + nearest.y + nearest.z - weight * beyond};
}

// Lagrangian dual: the interpolant is 0 at its zeros. Adding any multiple of it to the distance thus leaves the
// distance there as it is, and a bound of the sum bounds the distance. The bound is that of the sum's expansion about
// the cube's centre, term by term. At the offset t from there, the distance is at least
//   distance + direction . t + rounding (t . t - (direction . t)^2)
// as sqrt(a^2 + b^2) - a is at least b^2 / (sqrt(A^2 + B^2) + A) for all a <= A, b <= B.
double curvedDistance(const glm::dvec3& point, const CubeExpansion& cube) noexcept {
    const glm::dvec3 offset = cube.centre - point;
    const double distance = glm::length(offset), reach = halfDiagonal * cube.halfSide, far = distance + reach;
    const glm::dvec3 direction = offset / distance, ahead = cube.halfSide * direction;
    const double steepness2 = glm::dot(cube.slope, cube.slope);
    const double multiplier = steepness2 > 0 ? -glm::dot(ahead, cube.slope) / steepness2 : 0;
    const double rounding = cube.halfSide * cube.halfSide / (std::sqrt(far * far + reach * reach) + far);
    const glm::dvec3 slope = ahead + multiplier * cube.slope, curvature = rounding * (1.0 - direction * direction);
    const glm::dvec3 mixed(direction.y * direction.z, direction.x * direction.z, direction.x * direction.y);
    const glm::dvec3 twist = glm::abs(multiplier * cube.twist - 2 * rounding * mixed);
    const double bound = distance + multiplier * cube.value + minParabola(slope.x, curvature.x) +
                         minParabola(slope.y, curvature.y) + minParabola(slope.z, curvature.z) - twist.x - twist.y -
                         twist.z - std::abs(multiplier * cube.skew);
    return bound > 0 ? bound : 0;  // also where it is not a number
}

}  // namespace bilayer::detail
