// SPDX-License-Identifier: Apache-2.0
// What ZeroSearch searches for: the nearest zero, the first contact of a swept sphere, any zero in a box. Lengths in
// voxels, places from the directory's first voxel.
// Tested by tests/collider/zero_set.cpp.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <optional>

#include "collider/field/layout/path.h"
#include "collider/field/triangles/triangle_tests.h"
#include "collider/field/zero/zero_bounds.h"
#include "collider/field/zero/zero_set.h"

namespace bilayer::detail {

/// Tolerance of the test whether a key is within the reach of a query.
inline constexpr double reachTolerance = 0.1 * zeroTolerance;

/// The point with the smallest key so far. Keys count up to a tolerance beyond the reach: otherwise a search that finds
/// nothing would have to compare keys with the reach that differ from it by rounding only.
struct BestZero {
    double reach;
    double best = reach + reachTolerance;
    std::optional<glm::dvec3> point{};

    bool isWithinReach() const { return point && best <= reach; }
    double limit() const { return best - (isWithinReach() ? zeroTolerance : reachTolerance); }
    void settle(double key, const glm::dvec3& zero) {
        if (!(key < best)) return;
        best = key;
        point = zero;
    }
};

/// Keys are distances from a place.
struct NearestQuery : BestZero {
    glm::dvec3 from;

    NearestQuery(const glm::dvec3& place, double maxDistance) : BestZero{maxDistance}, from(place) {}

    double bound(const glm::dvec3& lower, const glm::dvec3& upper) const { return boxDistance(from, lower, upper); }
    double bound(const CubeExpansion& cube, double limit) const {
        const double curved = curvedDistance(from, cube);
        return curved < limit ? std::max(curved, separation(from, cube).smallest) : curved;
    }
    void offer(const glm::dvec3& zero) { settle(glm::distance(from, zero), zero); }
};

/// The same, but the search ends with the first point.
struct AnyNearQuery : NearestQuery {
    using NearestQuery::NearestQuery;

    double limit() const { return point ? 0 : NearestQuery::limit(); }
};

/// Keys are path lengths of a sphere's centre.
class SphereCastQuery : public BestZero {
  public:
    SphereCastQuery(const Path& path, double radius) : BestZero{path.length}, path_(path), radius_(radius) {}

    double bound(const glm::dvec3& lower, const glm::dvec3& upper) const {
        return byTangents(best, [&](const glm::dvec3& centre, double) {
            const glm::dvec3 offset = glm::clamp(centre, lower, upper) - centre;
            const double distance = glm::length(offset);
            return stepToPlane({offset / distance, distance});
        });
    }

    double bound(const CubeExpansion& cube, double limit) const {
        return byTangents(limit, [&](const glm::dvec3& centre, double left) {
            const double step = stepToCube(curvedDistance(centre, cube), centre, cube);
            if (step > left) return step;
            const Separation plane = separation(centre, cube);
            return std::max({step, stepToPlane(plane), stepToCube(plane.smallest, centre, cube)});
        });
    }

    void offer(const glm::dvec3& zero) {
        const glm::dvec3 offset = zero - path_.origin;
        const double along = glm::dot(offset, path_.direction), across = glm::length(offset - along * path_.direction);
        if (glm::length(offset) <= radius_) return settle(0, zero);
        const double half2 = (radius_ - across) * (radius_ + across);
        if (half2 >= 0 && along >= 0) settle(std::max(0.0, along - std::sqrt(half2)), zero);
    }

  private:
    static constexpr double infinity = std::numeric_limits<double>::infinity();
    /// Steps end at this length.
    static constexpr double tangentTolerance = 1e-9;

    // How far a sphere can go along the path without a contact; infinite from `limit` on.
    // @param stepFrom  (centre, left) -> how far it can go from there; only steps up to `left` need to be accurate
    template <class StepFrom>
    double byTangents(double limit, const StepFrom& stepFrom) const {
        double along = 0;
        for (int i = 0; i < maxTangents; ++i) {
            const double step = stepFrom(path_.at(along), limit - along);
            if (!(step > 0)) break;
            along += step;
            if (along > limit) return infinity;
            if (step < tangentTolerance) break;
        }
        return along;
    }

    // The path to a plane that separates a convex shape is a lower bound of the path to the shape.
    double stepToPlane(const Separation& plane) const {
        const double left = plane.smallest - radius_, approach = glm::dot(plane.direction, path_.direction);
        if (!(left > 0)) return 0;
        return approach > 0 ? left / approach : infinity;
    }

    // A lower bound of the path to any point of the cube: the path to the point farthest ahead.
    double stepToCube(double distance, const glm::dvec3& centre, const CubeExpansion& cube) const {
        if (!(distance > radius_)) return 0;
        const glm::dvec3 reach = cube.halfSide * glm::abs(path_.direction);
        const double ahead = glm::dot(path_.direction, cube.centre - centre) + reach.x + reach.y + reach.z;
        const double excess = (distance - radius_) * (distance + radius_), half2 = ahead * ahead - excess;
        return ahead > 0 && half2 >= 0 ? excess / (ahead + std::sqrt(half2)) : infinity;
    }

    Path path_;
    double radius_;
};

/// Keys are 0 in the box and infinite outside.
struct BoxQuery {
    const RotatedBox& box;
    bool found = false;

    double limit() const { return found ? 0 : std::numeric_limits<double>::infinity(); }
    double bound(const glm::dvec3& lower, const glm::dvec3& upper) const {
        const glm::dvec3 half = 0.5 * (upper - lower), offset = 0.5 * (upper + lower) - box.centre;
        for (int k = 0; k < 3; ++k) {
            const double along = glm::dot(box.axes[k], offset), reach = glm::dot(glm::abs(box.axes[k]), half);
            if (std::abs(along) > reach + box.halfSize[k]) return std::numeric_limits<double>::infinity();
            const glm::dvec3 row(box.axes[0][k], box.axes[1][k], box.axes[2][k]);
            if (std::abs(offset[k]) > half[k] + glm::dot(glm::abs(row), box.halfSize))
                return std::numeric_limits<double>::infinity();
        }
        return 0;
    }
    double bound(const CubeExpansion& cube, double) const {
        const glm::dvec3 gradient = cube.gradient();
        const glm::dvec3 along(glm::dot(gradient, box.axes[0]), glm::dot(gradient, box.axes[1]),
                               glm::dot(gradient, box.axes[2]));
        const double reach = glm::dot(glm::abs(along), box.halfSize) + cube.linearError();
        if (std::abs(cube.linearAt(box.centre)) > reach) return std::numeric_limits<double>::infinity();
        return bound(cube.centre - cube.halfSide, cube.centre + cube.halfSide);
    }
    void offer(const glm::dvec3& zero) {
        const glm::dvec3 offset = zero - box.centre;
        for (int k = 0; k < 3; ++k)
            if (std::abs(glm::dot(box.axes[k], offset)) > box.halfSize[k]) return;
        found = true;
    }
    void settle(double, const glm::dvec3&) { found = true; }
};

}  // namespace bilayer::detail
