// SPDX-License-Identifier: Apache-2.0
// Queries of the zero set by branch and bound.
#include "collider/field/zero_set.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>

#include "collider/field/zero_cells.h"
#include "collider/field/zero_search.h"

namespace bilayer::detail {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
/// Tangent steps end at this distance.
constexpr double tangentTolerance = 1e-9;
/// Accuracy of a multiplier, in distance from the plane, and max count of steps. There are at most three kinks.
constexpr double multiplierTolerance = 1e-9;
constexpr int maxMultipliers = 8;

double boxDistance(const glm::dvec3& point, const glm::dvec3& lower, const glm::dvec3& upper) {
    return glm::distance(point, glm::clamp(point, lower, upper));
}

// A separating direction. The zeros of a cube are in its box, and no farther from the plane of its linear bound than
// the error. From a point outside that slab of the box, all of them have at least the distance `least` along a unit
// direction.
struct Separation {
    glm::dvec3 direction;
    double smallest;
};

// Lagrangian dual of the distance to the box within the slab. The multiplier is found by tangents; the bound holds for
// any multiplier.
Separation separation(const glm::dvec3& point, const glm::dvec3& lower, const glm::dvec3& upper,
                      const LinearBound& linear) {
    const double height = linear.at(point), steepness = glm::length(linear.gradient);
    const glm::dvec3 low = lower - point, high = upper - point;
    // points of the slab have normal * offset <= beyond
    const glm::dvec3 normal = (height < 0 ? -1 : 1) / steepness * linear.gradient;
    const double beyond = (linear.error - std::abs(height)) / steepness;
    double multiplier = 0;
    glm::dvec3 offset = glm::clamp(glm::dvec3(0), low, high);
    const bool slices = std::isfinite(beyond) && beyond < 0;
    for (int i = 0; slices && i < maxMultipliers; ++i) {
        const double excess = glm::dot(normal, offset) - beyond;
        if (std::abs(excess) <= multiplierTolerance) break;
        // unclamped coordinates follow the multiplier; if there are none, up to the next one that is released
        double slope = 0, next = infinity;
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
    if (!(length > 0)) return {glm::dvec3(1, 0, 0), -infinity};
    const glm::dvec3 direction = offset / length;
    if (!slices) return {direction, length};
    const double weight = multiplier / length;
    const glm::dvec3 tilted = direction + weight * normal;
    const glm::dvec3 nearest = glm::min(tilted * low, tilted * high);
    return {direction, nearest.x + nearest.y + nearest.z - weight * beyond};
}

// Keys are distances from a point.
struct NearestQuery {
    glm::dvec3 point;
    double best;              // or the search radius, while nothing is found
    bool acceptsAny = false;  // the search ends with the first point
    std::optional<glm::dvec3> found{};

    double limit(const SearchTolerance& tolerance) const {
        if (acceptsAny) return found ? 0 : std::nextafter(best, infinity);
        return found ? best - tolerance.value() : std::nextafter(best, infinity) - tolerance.excess();
    }
    double bound(const glm::dvec3& lower, const glm::dvec3& upper) const { return boxDistance(point, lower, upper); }
    double bound(const glm::dvec3& lower, const glm::dvec3& upper, const LinearBound& linear) const {
        return std::max(bound(lower, upper), separation(point, lower, upper, linear).smallest);
    }
    void offer(const glm::dvec3& zero) { settle(glm::distance(point, zero), zero); }
    void settle(double key, const glm::dvec3& zero) {
        if (!(key < best) && !(key == best && !found)) return;
        best = key;
        found = zero;
    }
};

// Keys are path lengths of a sphere's centre.
struct SphereCastQuery {
    Path path;
    double radius, best;
    std::optional<glm::dvec3> found{};

    // Distances along the path are no lengths to trade for time: next to a grazing surface they change by many voxels.
    double limit(const SearchTolerance&) const { return found ? best - zeroTolerance : std::nextafter(best, infinity); }

    double bound(const glm::dvec3& lower, const glm::dvec3& upper) const {
        return byTangents([&](const glm::dvec3& centre) -> Separation {
            const glm::dvec3 offset = glm::clamp(centre, lower, upper) - centre;
            const double distance = glm::length(offset);
            return {offset / distance, distance};
        });
    }
    double bound(const glm::dvec3& lower, const glm::dvec3& upper, const LinearBound& linear) const {
        return std::max(bound(lower, upper),
                        byTangents([&](const glm::dvec3& centre) { return separation(centre, lower, upper, linear); }));
    }

    // A convex shape is reached no sooner than a plane that separates it.
    template <class Separate>
    double byTangents(Separate separate) const {
        double along = 0;
        for (int i = 0; i < maxTangents; ++i) {
            const Separation found = separate(path.at(along));
            const double left = found.smallest - radius;
            if (!(left > 0)) break;
            const double approach = glm::dot(found.direction, path.direction);
            if (!(approach > 0)) return infinity;
            along += left / approach;
            if (along > best) return infinity;
            if (left < tangentTolerance) break;
        }
        return along;
    }

    void offer(const glm::dvec3& zero) {
        const glm::dvec3 offset = zero - path.origin;
        const double along = glm::dot(offset, path.direction), across = glm::length(offset - along * path.direction);
        if (glm::length(offset) <= radius) return settle(0, zero);
        const double half2 = (radius - across) * (radius + across);
        if (half2 >= 0 && along >= 0) settle(std::max(0.0, along - std::sqrt(half2)), zero);
    }
    void settle(double key, const glm::dvec3& zero) {
        if (!(key < best) && !(key == best && !found)) return;
        best = key;
        found = zero;
    }
};

// Keys are 0 in the box and infinite outside.
struct BoxQuery {
    const RotatedBox& box;
    bool found = false;

    double limit(const SearchTolerance&) const { return found ? 0 : infinity; }
    double bound(const glm::dvec3& lower, const glm::dvec3& upper) const {
        const glm::dvec3 half = 0.5 * (upper - lower), offset = 0.5 * (upper + lower) - box.centre;
        for (int k = 0; k < 3; ++k) {
            const double along = glm::dot(box.axes[k], offset), reach = glm::dot(glm::abs(box.axes[k]), half);
            if (std::abs(along) > reach + box.halfSize[k]) return infinity;
            const glm::dvec3 row(box.axes[0][k], box.axes[1][k], box.axes[2][k]);
            if (std::abs(offset[k]) > half[k] + glm::dot(glm::abs(row), box.halfSize)) return infinity;
        }
        return 0;
    }
    double bound(const glm::dvec3& lower, const glm::dvec3& upper, const LinearBound& linear) const {
        const glm::dvec3 along(glm::dot(linear.gradient, box.axes[0]), glm::dot(linear.gradient, box.axes[1]),
                               glm::dot(linear.gradient, box.axes[2]));
        const double reach = glm::dot(glm::abs(along), box.halfSize) + linear.error;
        return std::abs(linear.at(box.centre)) > reach ? infinity : bound(lower, upper);
    }
    void offer(const glm::dvec3& zero) {
        const glm::dvec3 offset = zero - box.centre;
        for (int k = 0; k < 3; ++k)
            if (std::abs(glm::dot(box.axes[k], offset)) > box.halfSize[k]) return;
        found = true;
    }
    void settle(double, const glm::dvec3&) { found = true; }
};

}  // namespace

glm::dvec3 zeroNormal(const FieldData& field, const glm::dvec3& point) noexcept {
    const glm::ivec3 voxel = glm::clamp(glm::ivec3(glm::floor(point)), glm::ivec3(0), extentOf(field) - 1);
    const std::int32_t entry = entryAt(field, voxel);
    if (entry < 0) return glm::dvec3(0);
    const CornerValues v = cellValues(field, entry, voxel & 7);
    const glm::dvec3 f = point - glm::dvec3(voxel), g = 1.0 - f;
    glm::dvec3 gradient(0);
    for (std::size_t i = 0; i < 8; ++i) {
        const glm::dvec3 at = cubeCorner(i), weight = glm::mix(g, f, at), sign = 2.0 * at - 1.0;
        gradient += v[i] * sign * glm::dvec3(weight.y * weight.z, weight.x * weight.z, weight.x * weight.y);
    }
    const double steepness = glm::length(gradient);
    return steepness > 0 ? gradient / steepness : glm::dvec3(0);
}

std::optional<glm::dvec3> nearestZero(const FieldData& field, const glm::dvec3& point, double reach) noexcept {
    NearestQuery nearest{.point = point, .best = reach};
    ZeroSearch(field, nearest).run();
    return nearest.found;
}

bool isNearZero(const FieldData& field, const glm::dvec3& point, double reach) noexcept {
    NearestQuery nearest{.point = point, .best = reach, .acceptsAny = true};
    ZeroSearch(field, nearest).run();
    return nearest.found.has_value();
}

std::optional<ZeroTouch> firstZeroTouch(const FieldData& field, const Path& path, double radius) noexcept {
    SphereCastQuery touch{.path = path, .radius = radius, .best = path.length};
    ZeroSearch(field, touch).run();
    if (!touch.found) return std::nullopt;
    return ZeroTouch{touch.best, *touch.found};
}

bool meetsZero(const FieldData& field, const RotatedBox& box) noexcept {
    BoxQuery inBox{box};
    ZeroSearch(field, inBox).run();
    return inBox.found;
}

}  // namespace bilayer::detail
