// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/shapes/axial_cores.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <glm/vec2.hpp>
#include <limits>

namespace bilayer::detail {

namespace {

// Chords of a rim. Each lies within 0.5 % of the radius from its arc, before its points are projected onto the arc.
constexpr std::uint32_t rimChords = 32;
// A normal belongs to a flat end if its part across the axis is at most this, and at most this fraction of that of the
// side's normals.
constexpr float maxFlatPart = 0.1f, maxFlatFraction = 0.5f;
// The normal of an end is its axis up to rounding. Next to the rim, normals are oblique (cosine).
constexpr float exactlyFlat = 1 - 1e-6f;
// From this fraction of the half height on, a point on the side is on a rim.
constexpr float beforeRim = 0.999f;

}  // namespace

SegmentCore::SegmentCore(int axis, float halfHeight) : axis_(axis), halfHeight_(halfHeight) {
    vertices_ = {-halfHeight * unitAlong(axis)};
    if (!(halfHeight > 0)) return;
    vertices_.push_back(halfHeight * unitAlong(axis));
    edges_ = {{0, 1, 0}};
}

NearestPoint SegmentCore::nearest(const glm::vec3& point, float) const {
    const glm::vec3 core = std::clamp(point[axis_], -halfHeight_, halfHeight_) * unitAlong(axis_);
    const float length = glm::distance(point, core);
    return {length, length > 0 ? (point - core) / length : unitAcross(axis_), core, 0};
}

BoxCore::BoxCore(const glm::vec3& halfExtents) : halfExtents_(halfExtents) {
    for (std::uint32_t corner = 0; corner < 8; ++corner) {
        const glm::vec3 side(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
        vertices_.push_back(side * halfExtents);
        for (int axis = 0; axis < 3; ++axis) {
            const int next = (axis + 1) % 3, last = (axis + 2) % 3;
            const Conormals conormals{-side[next] * unitAlong(next), -side[last] * unitAlong(last)};
            if (side[axis] < 0) edges_.push_back({corner, corner | 1u << axis, 0, conormals});
        }
    }
}

NearestPoint BoxCore::nearest(const glm::vec3& point, float) const {
    const glm::vec3 clamped = glm::clamp(point, -halfExtents_, halfExtents_);
    const float length = glm::distance(point, clamped);
    if (length > 0) return {length, (point - clamped) / length, clamped, 0};

    int axis = 0;
    const glm::vec3 depth = halfExtents_ - glm::abs(point);
    for (int i = 1; i < 3; ++i)
        if (depth[i] < depth[axis]) axis = i;
    const glm::vec3 normal = (point[axis] < 0 ? -1.f : 1.f) * unitAlong(axis);
    return {-depth[axis], normal, point + depth[axis] * normal, 0};
}

RevolutionCore::RevolutionCore(int axis, float halfHeight, float lowerRadius, float upperRadius, float growth)
    : axis_(axis), halfHeight_(halfHeight), lowerRadius_(lowerRadius), upperRadius_(upperRadius) {
    addRim(-halfHeight, lowerRadius);
    addRim(halfHeight, upperRadius);
    tolerance_ = tolerance(growth);
    const float sidePart = 2 * halfHeight / std::hypot(2 * halfHeight, upperRadius - lowerRadius);
    minSidePart_ = std::min(maxFlatPart, maxFlatFraction * sidePart);
    maxSideCosine_ = std::sqrt(1 - minSidePart_ * minSidePart_);
}

void RevolutionCore::addRim(float height, float rim) {
    const auto first = static_cast<std::uint32_t>(vertices_.size());
    if (!(rim > 0)) {
        vertices_.push_back(height * unitAlong(axis_));
        return;
    }
    for (std::uint32_t i = 0; i < rimChords; ++i) {
        const float angle = 2 * glm::pi<float>() * i / rimChords;
        glm::vec3 point = height * unitAlong(axis_);
        point[(axis_ + 1) % 3] = rim * std::cos(angle);
        point[(axis_ + 2) % 3] = rim * std::sin(angle);
        vertices_.push_back(point);
        edges_.push_back({first + i, first + (i + 1) % rimChords, rim});
    }
}

NearestPoint RevolutionCore::nearest(const glm::vec3& point, float) const {
    // In the half plane through the point: x away from the axis, y along it.
    glm::vec3 out = point;
    out[axis_] = 0;
    const float rho = glm::length(out);
    out = rho > 0 ? out / rho : unitAcross(axis_);
    const glm::vec2 p(rho, point[axis_]);
    const std::array<glm::vec2, 4> profile{
        {{0, -halfHeight_}, {lowerRadius_, -halfHeight_}, {upperRadius_, halfHeight_}, {0, halfHeight_}}};

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
        const bool isOver = position >= -tolerance_ && position <= length + tolerance_;
        if (isOver && above > height) height = above, normal = outward;
    }
    // Points that almost coincide give a normal of rounding only.
    if (!inside && !(height > 0)) normal = (p - core) / nearest;
    const auto inSpace = [&](const glm::vec2& v) { return v.x * out + v.y * unitAlong(axis_); };
    return {inside ? -nearest : nearest, inSpace(normal), inSpace(core), 0};
}

bool RevolutionCore::isFlat(const NearestPoint& nearest) const {
    return std::abs(nearest.normal[axis_]) > exactlyFlat;
}

bool RevolutionCore::isOnSide(const NearestPoint& nearest) const {
    return std::abs(nearest.normal[axis_]) < maxSideCosine_;
}

bool RevolutionCore::isRound(const NearestPoint& nearest) const {
    return isOnSide(nearest) && std::abs(nearest.core[axis_]) < beforeRim * halfHeight_;
}

glm::vec3 RevolutionCore::supportNear(const NearestPoint& nearest, const glm::vec3& direction) const {
    glm::vec3 core = nearest.core, out = direction;
    if (!isOnSide(nearest)) return core;
    const float height = core[axis_];
    core[axis_] = out[axis_] = 0;
    if (const float length = glm::length(out); length > minSidePart_) core = (glm::length(core) / length) * out;
    core[axis_] = height;
    return core;
}

glm::vec3 RevolutionCore::support(const glm::vec3& direction) const {
    glm::vec3 out = direction;
    out[axis_] = 0;
    if (const float across = glm::length(out); across > 0) out /= across;
    const auto [lower, upper] = lineAlong(out);
    return glm::dot(direction, upper - lower) > 0 ? upper : lower;
}

std::optional<std::array<glm::vec3, 2>> RevolutionCore::sideLine(const NearestPoint& nearest,
                                                                 const glm::vec3& place) const {
    glm::vec3 out = place;
    out[axis_] = 0;
    const float length = glm::length(out);
    if (!isOnSide(nearest) || !(length > 0)) return std::nullopt;
    return lineAlong(out / length);
}

std::array<glm::vec3, 2> RevolutionCore::lineAlong(const glm::vec3& out) const {
    const glm::vec3 up = halfHeight_ * unitAlong(axis_);
    return {lowerRadius_ * out - up, upperRadius_ * out + up};
}

glm::vec3 RevolutionCore::place(const ConvexEdge& edge, float fraction) const {
    glm::vec3 place = ConvexCore::place(edge, fraction);
    // From the chord out to the arc.
    place[axis_] = 0;
    place *= edge.rim / glm::length(place);
    place[axis_] = vertices_[edge.from][axis_];
    return place;
}

}  // namespace bilayer::detail
