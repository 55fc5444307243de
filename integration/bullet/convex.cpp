#include "integration/bullet/convex.h"

#include <BulletCollision/CollisionShapes/btBoxShape.h>
#include <BulletCollision/CollisionShapes/btCapsuleShape.h>
#include <BulletCollision/CollisionShapes/btConeShape.h>
#include <BulletCollision/CollisionShapes/btConvexHullShape.h>
#include <BulletCollision/CollisionShapes/btConvexPointCloudShape.h>
#include <BulletCollision/CollisionShapes/btCylinderShape.h>
#include <BulletCollision/CollisionShapes/btPolyhedralConvexShape.h>
#include <BulletCollision/CollisionShapes/btSphereShape.h>
#include <LinearMath/btConvexHullComputer.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <glm/vec2.hpp>

#include "integration/bullet/convert.h"

namespace bilayer::bullet {

namespace {

// An edge gets no more probes than this; a longer one gets them sparser.
constexpr int mostProbes = 64;
// Chords of a rim: enough that each lies within 0.5 % of the radius from its arc before it is put onto it.
constexpr std::uint32_t rimChords = 32;
// Support points on a shape that has no formula here: directions on a spiral, about 12 degrees apart.
constexpr int supportDirections = 256;
// A normal that is tilted less than this off the axis belongs to a flat end.
constexpr float flatEnd = 0.1f;

glm::vec3 direction(int axis) {
    glm::vec3 unit(0);
    unit[axis] = 1;
    return unit;
}

/// Any unit vector square to an axis.
glm::vec3 squareTo(int axis) {
    return direction((axis + 1) % 3);
}

/// Support points in directions spread evenly over the sphere (R. Swinbank, R. J. Purser, "Fibonacci grids", 2006).
std::vector<btVector3> supportPoints(const btConvexShape& shape) {
    const float golden = glm::pi<float>() * (3 - std::sqrt(5.f));
    std::vector<btVector3> points;
    for (int i = 0; i < supportDirections; ++i) {
        const float z = 1 - (2 * i + 1.f) / supportDirections, rho = std::sqrt(1 - z * z), angle = golden * i;
        const btVector3 towards(rho * std::cos(angle), rho * std::sin(angle), z);
        points.push_back(shape.localGetSupportingVertexWithoutMargin(towards));
    }
    return points;
}

std::vector<btVector3> corners(const btPolyhedralConvexShape& shape) {
    std::vector<btVector3> points(shape.getNumVertices());
    for (int i = 0; i < shape.getNumVertices(); ++i) shape.getVertex(i, points[i]);
    return points;
}

}  // namespace

Convex::Convex(const btConvexShape& shape) : scaling_(shape.getLocalScaling()), margin_(shape.getMargin()) {
    switch (shape.getShapeType()) {
        case SPHERE_SHAPE_PROXYTYPE:
            core_ = Core::segment;
            radius_ = static_cast<const btSphereShape&>(shape).getRadius();
            faces_.points = {glm::vec3(0)};
            break;
        case CAPSULE_SHAPE_PROXYTYPE: {
            const auto& capsule = static_cast<const btCapsuleShape&>(shape);
            core_ = Core::segment;
            radius_ = capsule.getRadius();
            axis_ = capsule.getUpAxis();
            halfHeight_ = capsule.getHalfHeight();
            faces_.points = {-halfHeight_ * direction(axis_), halfHeight_ * direction(axis_)};
            edges_ = {{0, 1, 0}};
            break;
        }
        case BOX_SHAPE_PROXYTYPE:
            makeBox(toGlm(static_cast<const btBoxShape&>(shape).getHalfExtentsWithMargin()));
            break;
        case CYLINDER_SHAPE_PROXYTYPE: {
            const auto& cylinder = static_cast<const btCylinderShape&>(shape);
            const int axis = cylinder.getUpAxis();
            const btVector3 half = cylinder.getHalfExtentsWithMargin();
            const float rim = half[axis == 0 ? 1 : 0];
            makeRevolution(axis, half[axis], rim, rim);
            break;
        }
        case CONE_SHAPE_PROXYTYPE: {
            const auto& cone = static_cast<const btConeShape&>(shape);
            radius_ = margin_;
            makeRevolution(cone.getConeUpIndex(), 0.5f * cone.getHeight(), cone.getRadius(), 0);
            break;
        }
        default:
            radius_ = margin_;
            makeHull(shape.isPolyhedral() ? corners(static_cast<const btPolyhedralConvexShape&>(shape))
                                          : supportPoints(shape));
    }
}

bool Convex::isOf(const btConvexShape& shape) const {
    return scaling_ == shape.getLocalScaling() && margin_ == shape.getMargin();
}

void Convex::makeBox(const glm::vec3& halfExtents) {
    core_ = Core::box;
    halfExtents_ = halfExtents;
    for (std::uint32_t corner = 0; corner < 8; ++corner) {
        const glm::vec3 side(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
        faces_.points.push_back(side * halfExtents);
        for (std::uint32_t axis : {1u, 2u, 4u})
            if (!(corner & axis)) edges_.push_back({corner, corner | axis, 0});
    }
}

void Convex::makeRevolution(int axis, float halfHeight, float lowerRadius, float upperRadius) {
    core_ = Core::revolution;
    axis_ = axis;
    halfHeight_ = halfHeight;
    lowerRadius_ = lowerRadius;
    upperRadius_ = upperRadius;
    addRim(-halfHeight, lowerRadius);
    addRim(halfHeight, upperRadius);
}

void Convex::addRim(float height, float rim) {
    const auto first = static_cast<std::uint32_t>(faces_.points.size());
    if (!(rim > 0)) {
        faces_.points.push_back(height * direction(axis_));
        return;
    }
    for (std::uint32_t i = 0; i < rimChords; ++i) {
        const float angle = 2 * glm::pi<float>() * i / rimChords;
        glm::vec3 point = height * direction(axis_);
        point[(axis_ + 1) % 3] = rim * std::cos(angle);
        point[(axis_ + 2) % 3] = rim * std::sin(angle);
        faces_.points.push_back(point);
        edges_.push_back({first + i, first + (i + 1) % rimChords, rim});
    }
}

void Convex::makeHull(const std::vector<btVector3>& points) {
    core_ = Core::hull;
    btConvexHullComputer hull;
    hull.compute(&points.front().x(), sizeof(btVector3), static_cast<int>(points.size()), 0, 0);
    for (int i = 0; i < hull.vertices.size(); ++i) faces_.points.push_back(toGlm(hull.vertices[i]));
    for (int i = 0; i < hull.edges.size(); ++i) {
        const auto from = static_cast<std::uint32_t>(hull.edges[i].getSourceVertex());
        const auto to = static_cast<std::uint32_t>(hull.edges[i].getTargetVertex());
        if (from < to) edges_.push_back({from, to, 0});
    }
    for (int i = 0; i < hull.faces.size(); ++i) {
        const auto* first = &hull.edges[hull.faces[i]];
        const auto apex = static_cast<std::uint32_t>(first->getSourceVertex());
        glm::vec3 area(0);
        const std::size_t begin = faces_.triangles.size();
        for (const auto* edge = first->getNextEdgeOfFace(); edge != first; edge = edge->getNextEdgeOfFace()) {
            const glm::uvec3 triangle(apex, edge->getSourceVertex(), edge->getTargetVertex());
            if (triangle.z == apex) continue;
            const glm::vec3 a = faces_.points[triangle.x];
            area += glm::cross(faces_.points[triangle.y] - a, faces_.points[triangle.z] - a);
            faces_.triangles.push_back(triangle);
        }
        const float length = glm::length(area);
        if (length > 0)
            planes_.push_back(
                {area / length, glm::dot(area / length, faces_.points[apex]), begin, faces_.triangles.size()});
    }
}

Convex::Near Convex::nearest(const glm::vec3& point, float reach) const {
    switch (core_) {
        case Core::segment:
            return nearestOfSegment(point);
        case Core::box:
            return nearestOfBox(point);
        case Core::revolution:
            return nearestOfRevolution(point);
        default:
            return nearestOfHull(point, reach);
    }
}

Convex::Near Convex::nearestOfSegment(const glm::vec3& point) const {
    const glm::vec3 core = std::clamp(point[axis_], -halfHeight_, halfHeight_) * direction(axis_);
    const float length = glm::distance(point, core);
    const glm::vec3 normal = length > 0 ? (point - core) / length : squareTo(axis_);
    return {length - radius_, normal, core};
}

Convex::Near Convex::nearestOfBox(const glm::vec3& point) const {
    const glm::vec3 clamped = glm::clamp(point, -halfExtents_, halfExtents_);
    const float length = glm::distance(point, clamped);
    if (length > 0) return {length, (point - clamped) / length, clamped};

    int axis = 0;
    const glm::vec3 depth = halfExtents_ - glm::abs(point);
    for (int i = 1; i < 3; ++i)
        if (depth[i] < depth[axis]) axis = i;
    const glm::vec3 normal = (point[axis] < 0 ? -1.f : 1.f) * direction(axis);
    return {-depth[axis], normal, point + depth[axis] * normal};
}

Convex::Near Convex::nearestOfRevolution(const glm::vec3& point) const {
    // In the half plane of the point: x away from the axis, y along it.
    glm::vec3 out = point;
    out[axis_] = 0;
    const float rho = glm::length(out);
    out = rho > 0 ? out / rho : squareTo(axis_);
    const glm::vec2 p(rho, point[axis_]);
    const std::array<glm::vec2, 4> profile{
        {{0, -halfHeight_}, {lowerRadius_, -halfHeight_}, {upperRadius_, halfHeight_}, {0, halfHeight_}}};

    bool inside = true;
    float nearest = std::numeric_limits<float>::max();
    glm::vec2 core(0), normal(0);
    for (int i = 0; i < 3; ++i) {
        const glm::vec2 a = profile[i], along = profile[i + 1] - a;
        const float squaredLength = glm::dot(along, along);
        if (!(squaredLength > 0)) continue;
        const glm::vec2 outward = glm::vec2(along.y, -along.x) / std::sqrt(squaredLength);
        inside &= glm::dot(p - a, outward) <= 0;
        const glm::vec2 q = a + std::clamp(glm::dot(p - a, along) / squaredLength, 0.f, 1.f) * along;
        if (const float d = glm::distance(p, q); d < nearest) nearest = d, core = q, normal = outward;
    }
    if (!inside && nearest > 0) normal = (p - core) / nearest;
    const auto lift = [&](const glm::vec2& v) { return v.x * out + v.y * direction(axis_); };
    return {(inside ? -nearest : nearest) - radius_, lift(normal), lift(core)};
}

Convex::Near Convex::nearestOfHull(const glm::vec3& point, float reach) const {
    const Plane* farthest = nullptr;
    float depth = -std::numeric_limits<float>::max();
    for (const Plane& plane : planes_)
        if (const float d = glm::dot(plane.normal, point) - plane.offset; d > depth) depth = d, farthest = &plane;
    // Inside, the nearest face decides; far outside, a bound does.
    if (farthest && (depth <= 0 || depth > reach + radius_))
        return {depth - radius_, farthest->normal, point - depth * farthest->normal};

    float squared = std::numeric_limits<float>::max();
    glm::vec3 core(0);
    const auto consider = [&](const glm::vec3& q) {
        const glm::vec3 way = point - q;
        if (const float s = glm::dot(way, way); s < squared) squared = s, core = q;
    };
    // Only faces that the point sees can be nearest.
    for (const Plane& plane : planes_)
        if (glm::dot(plane.normal, point) > plane.offset)
            for (std::size_t i = plane.begin; i < plane.end; ++i) {
                const glm::uvec3& t = faces_.triangles[i];
                consider(nearestOnTriangle(point, faces_.points[t.x], faces_.points[t.y], faces_.points[t.z]));
            }
    // A hull without faces is flat, a line or a point.
    if (!farthest) {
        for (const Edge& edge : edges_)
            consider(
                nearestOnTriangle(point, faces_.points[edge.from], faces_.points[edge.to], faces_.points[edge.to]));
        for (const glm::vec3& corner : faces_.points) consider(corner);
    }
    const float distance = std::sqrt(squared);
    const glm::vec3 normal = distance > 0 ? (point - core) / distance : farthest ? farthest->normal : squareTo(1);
    return {distance - radius_, normal, core};
}

glm::vec3 Convex::slide(const Near& near, const glm::vec3& towards) const {
    glm::vec3 core = near.core;
    if (core_ == Core::revolution && std::abs(near.normal[axis_]) < 1 - flatEnd * flatEnd) {
        const float height = core[axis_];
        core[axis_] = 0;
        glm::vec3 out = towards;
        out[axis_] = 0;
        if (const float length = glm::length(out); length > flatEnd) core = (glm::length(core) / length) * out;
        core[axis_] = height;
    }
    return core + radius_ * towards;
}

void Convex::visitProbes(const glm::vec3& centre, float within, float spacing,
                         const std::function<void(const glm::vec3&, std::uint32_t)>& visit) const {
    for (std::uint32_t i = 0; i < faces_.points.size(); ++i)
        if (glm::distance(faces_.points[i], centre) <= within) visit(faces_.points[i], i);
    auto number = static_cast<std::uint32_t>(faces_.points.size());
    for (const Edge& edge : edges_) {
        const auto place = [&](const glm::vec3& onChord, std::uint32_t index) {
            glm::vec3 point = onChord;
            if (edge.rim > 0) {
                point[axis_] = 0;
                point *= edge.rim / glm::length(point);
                point[axis_] = onChord[axis_];
            }
            visit(point, number + index);
        };
        visitAlong(faces_.points[edge.from], faces_.points[edge.to], centre, within, spacing, place);
        number += 1u << 16;
    }
}

void visitAlong(const glm::vec3& from, const glm::vec3& to, const glm::vec3& centre, float within, float spacing,
                const std::function<void(const glm::vec3&, std::uint32_t)>& visit) {
    const glm::vec3 along = to - from, offset = from - centre;
    const float squaredLength = glm::dot(along, along);
    const float length = std::sqrt(squaredLength);
    if (!(length > spacing)) return;

    // The part t of the edge that lies within the sphere: |offset + t along|^2 <= within^2.
    const float middle = -glm::dot(offset, along) / squaredLength;
    const float square = middle * middle - (glm::dot(offset, offset) - within * within) / squaredLength;
    if (square < 0) return;
    const float half = std::sqrt(square);

    const int parts = static_cast<int>(std::min(std::ceil(length / spacing), 1e6f));
    const int first = std::max(1, static_cast<int>(std::ceil(std::max(middle - half, 0.f) * parts)));
    const int last = std::min(parts - 1, static_cast<int>(std::floor(std::min(middle + half, 1.f) * parts)));
    int stride = 1;
    while ((last - first) / stride >= mostProbes) stride *= 2;
    for (int i = (first + stride - 1) / stride * stride; i <= last; i += stride)
        visit(from + (static_cast<float>(i) / parts) * along, static_cast<std::uint32_t>(i));
}

glm::vec3 nearestOnTriangle(const glm::vec3& point, const glm::vec3& a, const glm::vec3& b, const glm::vec3& c) {
    const auto onSegment = [&](const glm::vec3& from, const glm::vec3& to) {
        const glm::vec3 along = to - from;
        const float squared = glm::dot(along, along);
        return squared > 0 ? from + std::clamp(glm::dot(point - from, along) / squared, 0.f, 1.f) * along : from;
    };
    const glm::vec3 normal = glm::cross(b - a, c - a);
    const float squaredArea = glm::dot(normal, normal);
    if (squaredArea > 0) {
        const glm::vec3 foot = point - (glm::dot(point - a, normal) / squaredArea) * normal;
        const auto leftOf = [&](const glm::vec3& from, const glm::vec3& to) {
            return glm::dot(glm::cross(to - from, foot - from), normal) >= 0;
        };
        if (leftOf(a, b) && leftOf(b, c) && leftOf(c, a)) return foot;
    }
    glm::vec3 best = onSegment(a, b);
    for (const glm::vec3& q : {onSegment(b, c), onSegment(c, a)})
        if (glm::distance(q, point) < glm::distance(best, point)) best = q;
    return best;
}

}  // namespace bilayer::bullet
