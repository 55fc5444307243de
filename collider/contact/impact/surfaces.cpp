// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/impact/surfaces.h"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>

#include "collider/contact/impact/advancement.h"
#include "collider/contact/search/surface_query.h"
#include "collider/field/layout/interpolant.h"

namespace bilayer::detail {

namespace {

constexpr float minStride = 0.05f;       // minimum stride through samples [voxels]
constexpr float nearDistance = 0.5f;     // a path is certainly free while nothing is closer than this [voxels]
constexpr float entryTolerance = 0.01f;  // a point this close to a convex body has entered it [voxels]
constexpr float everywhere = std::numeric_limits<float>::max();

}  // namespace

std::optional<SurfaceEntry> FieldSurface::entry(const glm::vec3& from, const glm::vec3& to, float radius) const {
    if (from == to) return overlaps(from, radius) ? std::optional(SurfaceEntry{from, glm::vec3(0)}) : std::nullopt;
    if (staysOut(from, to, radius)) return std::nullopt;
    const glm::vec3 displacement = to - from;
    const auto hit = radius > 0 ? field_.sphereCast({from, displacement, glm::length(displacement)}, radius)
                                : field_.segment(from, to);
    if (!hit) return std::nullopt;
    return SurfaceEntry{hit->position, hit->normal};
}

std::optional<glm::vec3> FieldSurface::depenetration(const glm::vec3& point, float radius) const {
    if (radius > 0) {
        const ClosestPoint closest = field_.closest(point, radius);
        const glm::vec3 outward = closest.distance < 0 ? closest.position - point : point - closest.position;
        const float length = glm::length(outward);
        if (!closest.found || !(length > 0)) return std::nullopt;
        return (radius - closest.distance) / length * outward;
    }
    const Sample sample = field_.sample(point);
    const glm::vec3 normal = directionOf(sample, field_.voxelSize());
    if (!sample.inBand || normal == glm::vec3(0)) return std::nullopt;
    return -sample.distance * normal;
}

bool FieldSurface::isNear(const glm::vec3& from, const glm::vec3& to, float radius) const {
    const float reach = radius + maxInterpolationError * field_.voxelSize();
    return !staysClear(from, to, nearDistance * voxel_,
                       [&](const glm::vec3& at) { return field_.distance(at) - reach; });
}

// Whether a path stays outside, by strides through the samples. Many times as fast as the search for the entry.
bool FieldSurface::staysOut(const glm::vec3& from, const glm::vec3& to, float radius) const {
    const float voxel = field_.voxelSize(), error = field_.mesh() ? maxInterpolationError * voxel : 0;
    return staysClear(from, to, minStride * voxel, [&](const glm::vec3& at) {
        const Sample sample = field_.sampleWithin(at, 0);
        return sample.inBand && radius == 0 ? (sample.distance - error) / maxInterpolantSlope
                                            : sample.distance - radius - maxInterpolationError * voxel;
    });
}

bool FieldSurface::overlaps(const glm::vec3& point, float radius) const {
    return radius > 0 ? field_.overlapsSphere(point, radius) : field_.distance(point) <= 0;
}

std::optional<SurfaceEntry> ConvexSurface::entry(const glm::vec3& from, const glm::vec3& to, float) const {
    const auto entry = convex_.castPoint(from, to - from, entryTolerance * voxel_);
    if (!entry) return std::nullopt;
    const glm::vec3 at = from + entry->fraction * (to - from);
    return SurfaceEntry{at - entry->nearest.distance * entry->nearest.normal, entry->nearest.normal};
}

std::optional<glm::vec3> ConvexSurface::depenetration(const glm::vec3& point, float) const {
    const NearestPoint nearest = convex_.nearest(point, everywhere);
    return -nearest.distance * nearest.normal;
}

bool ConvexSurface::isNear(const glm::vec3& from, const glm::vec3& to, float radius) const {
    return !staysClear(from, to, nearDistance * voxel_,
                       [&](const glm::vec3& at) { return convex_.nearest(at, everywhere).distance - radius; });
}

float PlaneSurface::heightOf(const glm::vec3& point) const {
    return glm::dot(solid_.normal, point) - solid_.offset;
}

std::optional<SurfaceEntry> PlaneSurface::entry(const glm::vec3& from, const glm::vec3& to, float) const {
    const float before = heightOf(from), after = heightOf(to);
    if (before > 0 && after > 0) return std::nullopt;
    const float part = before > 0 ? before / (before - after) : 0;
    return SurfaceEntry{from + part * (to - from), solid_.normal};
}

std::optional<glm::vec3> PlaneSurface::depenetration(const glm::vec3& point, float) const {
    return -heightOf(point) * solid_.normal;
}

bool PlaneSurface::isNear(const glm::vec3& from, const glm::vec3& to, float radius) const {
    return std::min(heightOf(from), heightOf(to)) - radius < nearDistance * voxel_;
}

std::optional<SurfaceEntry> TriangleSurface::entry(const glm::vec3& from, const glm::vec3& to, float) const {
    const glm::vec3 displacement = to - from;
    float part = 1;
    std::optional<SurfaceEntry> first;
    openSurface_.visit({glm::min(from, to), glm::max(from, to)}, [&](const Triangle& triangle, std::uint64_t) {
        const glm::vec3 &a = triangle[0], one = triangle[1] - a, two = triangle[2] - a;
        const glm::vec3 normal = glm::cross(one, two), start = from - a, moment = glm::cross(start, displacement);
        const float along = -glm::dot(displacement, normal);
        if (along == 0) return;
        const float s = glm::dot(start, normal) / along, u = glm::dot(two, moment) / along,
                    v = -glm::dot(one, moment) / along;
        if (!(s >= 0 && s < part && u >= 0 && v >= 0 && u + v <= 1)) return;
        part = s;
        first = SurfaceEntry{from + s * displacement, (along > 0 ? 1.f : -1.f) * glm::normalize(normal)};
    });
    return first;
}

bool TriangleSurface::isNear(const glm::vec3& from, const glm::vec3& to, float radius) const {
    bool found = false;
    openSurface_.visit({glm::min(from, to) - radius, glm::max(from, to) + radius},
                       [&](const Triangle&, std::uint64_t) { found = true; });
    return found;
}

}  // namespace bilayer::detail
