// SPDX-License-Identifier: Apache-2.0
// The nearest point of a convex shape's surface, casts against it, and its curvature there.
// Tested by tests/bullet/convex.cpp through Convex.
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <limits>
#include <optional>

#include "collider/contact/convex.h"
#include "collider/contact/nearest_on_triangle.h"

namespace bilayer::detail {

namespace {

// A normal within this of the axis belongs to a flat end.
constexpr float flatEnd = 0.1f;
// The normal of an end is its axis up to rounding. Next to the rim, normals are oblique (cosine).
constexpr float exactlyFlat = 1 - 1e-6f;
// Limit of steps in the search for the entry of a path; longer searches only graze.
constexpr int maxSteps = 64;
// From this fraction of the half height on, a point on the side is on a rim.
constexpr float beforeRim = 0.999f;

/// Any unit vector perpendicular to an axis.
glm::vec3 perpendicularTo(int axis) {
    glm::vec3 unit(0);
    unit[(axis + 1) % 3] = 1;
    return unit;
}

}  // namespace

NearestPoint Convex::nearest(const glm::vec3& point, float reach) const {
    switch (core_) {
        case Core::segment:
            return nearestOfSegment(point);
        case Core::box:
            return nearestOfBox(point);
        case Core::revolution:
            return nearestOfRevolution(point);
        case Core::spheres:
            return sphereHull_.nearest(point);
        default:
            return nearestOfHull(point, reach);
    }
}

/// By Newton's method, which does not overshoot: distance is convex along a path, and so is the bound of a hull's
/// distance. Once the distance grows, it grows forever.
std::optional<Convex::PathHit> Convex::castPoint(const glm::vec3& start, const glm::vec3& displacement,
                                                 float tolerance) const {
    const float length = glm::length(displacement);
    float fraction = 0;
    for (int i = 0; i < maxSteps; ++i) {
        const NearestPoint here = nearest(start + fraction * displacement, length);
        if (here.distance <= tolerance) return PathHit{fraction, here};
        const float approach = -glm::dot(here.normal, displacement);
        if (!(approach > 0) || fraction >= 1) break;
        fraction = std::min(fraction + here.distance / approach, 1.f);
    }
    return std::nullopt;
}

NearestPoint Convex::nearestOfSegment(const glm::vec3& point) const {
    const glm::vec3 core = std::clamp(point[axis_], -halfHeight_, halfHeight_) * direction(axis_);
    const float length = glm::distance(point, core);
    const glm::vec3 normal = length > 0 ? (point - core) / length : perpendicularTo(axis_);
    return {length - radius_, normal, core, radius_};
}

NearestPoint Convex::nearestOfBox(const glm::vec3& point) const {
    const glm::vec3 clamped = glm::clamp(point, -halfExtents_, halfExtents_);
    const float length = glm::distance(point, clamped);
    if (length > 0) return {length, (point - clamped) / length, clamped, 0};

    int axis = 0;
    const glm::vec3 depth = halfExtents_ - glm::abs(point);
    for (int i = 1; i < 3; ++i)
        if (depth[i] < depth[axis]) axis = i;
    const glm::vec3 normal = (point[axis] < 0 ? -1.f : 1.f) * direction(axis);
    return {-depth[axis], normal, point + depth[axis] * normal, 0};
}

NearestPoint Convex::nearestOfRevolution(const glm::vec3& point) const {
    // In the half plane through the point: x away from the axis, y along it.
    glm::vec3 out = point;
    out[axis_] = 0;
    const float rho = glm::length(out);
    out = rho > 0 ? out / rho : perpendicularTo(axis_);
    const glm::vec2 p(rho, point[axis_]);
    const std::array<glm::vec2, 4> profile{
        {{0, -halfHeight_}, {lowerRadius_, -halfHeight_}, {upperRadius_, halfHeight_}, {0, halfHeight_}}};

    const float rounding = flatness * size_;
    bool inside = true;
    float nearest = std::numeric_limits<float>::max(), height = std::numeric_limits<float>::lowest();
    glm::vec2 core(0), normal(0);
    for (int i = 0; i < 3; ++i) {
        const glm::vec2 a = profile[i], along = profile[i + 1] - a;
        const float length = glm::length(along);
        if (!(length > 0)) continue;
        const glm::vec2 outward = glm::vec2(along.y, -along.x) / length;
        const float above = glm::dot(p - a, outward), position = glm::dot(p - a, along) / length;
        inside &= above <= 0;
        const glm::vec2 q = a + std::clamp(position / length, 0.f, 1.f) * along;
        if (const float d = glm::distance(p, q); d < nearest) nearest = d, core = q;
        const bool isOver = position >= -rounding && position <= length + rounding;
        if (isOver && above > height) height = above, normal = outward;
    }
    // Points that almost coincide give a normal of rounding only.
    if (!inside && !(height > 0)) normal = (p - core) / nearest;
    const auto inSpace = [&](const glm::vec2& v) { return v.x * out + v.y * direction(axis_); };
    return {(inside ? -nearest : nearest) - radius_, inSpace(normal), inSpace(core), radius_};
}

NearestPoint Convex::nearestOfHull(const glm::vec3& point, float reach) const {
    const HullFace* farthest = nullptr;
    float depth = -std::numeric_limits<float>::max();
    for (const HullFace& face : faces_)
        if (const float height = face.height(point); height > depth) depth = height, farthest = &face;
    // Inside, the nearest face decides; far outside, the bound is enough.
    const bool isInside = depth <= 0 && !isFlat_;
    if (farthest && (isInside || depth > reach + radius_))
        return {depth - radius_, farthest->normal, point - depth * farthest->normal, radius_};

    float squared = std::numeric_limits<float>::max();
    glm::vec3 core(0);
    const auto consider = [&](const glm::vec3& q) {
        const glm::vec3 offset = point - q;
        const float s = glm::dot(offset, offset);
        if (!(s < squared)) return false;
        squared = s, core = q;
        return true;
    };
    // Only faces that the point is above can be nearest. A face nearer than all its neighbours is the nearest one,
    // since the distance to a convex body has no other minimum.
    const HullFace* nearestFace = nullptr;
    std::size_t triangle = 0;
    const auto considerFace = [&](const HullFace& face) {
        for (std::size_t i = face.begin; i < face.end; ++i) {
            const glm::uvec3& t = mesh_.triangles[i];
            if (consider(nearestOnTriangle(point, mesh_.points[t.x], mesh_.points[t.y], mesh_.points[t.z])))
                nearestFace = &face, triangle = i;
        }
    };
    if (isFlat_) {
        for (const HullFace& face : faces_) considerFace(face);
    } else if (farthest) {
        considerFace(*farthest);
        for (const HullFace* before = nullptr; nearestFace != before && squared > depth * depth;) {
            before = nearestFace;
            const glm::uvec3 corners = mesh_.triangles[triangle];
            for (int i = 0; i < 3; ++i)
                for (std::uint32_t k = firstAround_[corners[i]]; k < firstAround_[corners[i] + 1]; ++k)
                    if (const HullFace& next = faces_[facesAround_[k]]; &next != before && next.height(point) > 0)
                        considerFace(next);
        }
    }
    // A hull without faces is a line or a point.
    if (!farthest) {
        for (const Edge& edge : edges_)
            consider(nearestOnTriangle(point, mesh_.points[edge.from], mesh_.points[edge.to], mesh_.points[edge.to]));
        for (const glm::vec3& vertex : mesh_.points) consider(vertex);
    }
    const float distance = std::sqrt(squared);
    // Points that almost coincide give a normal of rounding only.
    if (farthest && glm::distance(point - core, depth * farthest->normal) <= flatness * size_)
        return {distance - radius_, farthest->normal, core, radius_};
    const glm::vec3 normal = distance > 0 ? (point - core) / distance
                             : farthest   ? farthest->normal
                                          : perpendicularTo(1);
    return {distance - radius_, normal, core, radius_};
}

glm::vec3 Convex::supportNear(const NearestPoint& nearest, const glm::vec3& towards) const {
    glm::vec3 core = nearest.core;
    if (core_ == Core::revolution && std::abs(nearest.normal[axis_]) < 1 - flatEnd * flatEnd) {
        const float height = core[axis_];
        core[axis_] = 0;
        glm::vec3 out = towards;
        out[axis_] = 0;
        if (const float length = glm::length(out); length > flatEnd) core = (glm::length(core) / length) * out;
        core[axis_] = height;
    }
    return core + nearest.radius * towards;
}

bool Convex::isFlat(const NearestPoint& nearest) const {
    return core_ == Core::box || (core_ == Core::hull && !isRounded(nearest)) ||
           (core_ == Core::revolution && std::abs(nearest.normal[axis_]) > exactlyFlat);
}

// On an edge or a vertex of a hull that is grown by a radius: its normal is no face's.
bool Convex::isRounded(const NearestPoint& nearest) const {
    return core_ == Core::hull && radius_ > 0 && std::none_of(faces_.begin(), faces_.end(), [&](const HullFace& face) {
               return glm::dot(face.normal, nearest.normal) > sameFaceCosine;
           });
}

bool Convex::isRound(const NearestPoint& nearest) const {
    const bool isOnSide = std::abs(nearest.core[axis_]) < beforeRim * halfHeight_;
    return core_ == Core::segment || core_ == Core::spheres || isRounded(nearest) ||
           (core_ == Core::revolution && isOnSide && std::abs(nearest.normal[axis_]) < 1 - flatEnd * flatEnd);
}

std::optional<std::array<glm::vec3, 2>> Convex::sideLine(const NearestPoint& nearest, const glm::vec3& place) const {
    if (core_ != Core::revolution || std::abs(nearest.normal[axis_]) > 1 - flatEnd * flatEnd) return std::nullopt;
    glm::vec3 out = place;
    out[axis_] = 0;
    const float length = glm::length(out);
    if (!(length > 0)) return std::nullopt;
    out /= length;
    const glm::vec3 up = halfHeight_ * direction(axis_);
    return std::array{lowerRadius_ * out - up, upperRadius_ * out + up};
}

float Convex::radius(const Edge& edge, float fraction) const {
    return radii_.empty() ? radius_ : radii_[edge.from] + fraction * (radii_[edge.to] - radii_[edge.from]);
}

glm::vec3 Convex::place(const Edge& edge, float fraction) const {
    const glm::vec3 &from = mesh_.points[edge.from], &to = mesh_.points[edge.to];
    glm::vec3 place = from + fraction * (to - from);
    if (!(edge.rim > 0)) return place;
    // From the chord out to the arc.
    place[axis_] = 0;
    place *= edge.rim / glm::length(place);
    place[axis_] = from[axis_];
    return place;
}

}  // namespace bilayer::detail
