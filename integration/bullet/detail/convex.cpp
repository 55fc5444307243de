#include "integration/bullet/detail/convex.h"

#include <BulletCollision/CollisionShapes/btBox2dShape.h>
#include <BulletCollision/CollisionShapes/btBoxShape.h>
#include <BulletCollision/CollisionShapes/btCapsuleShape.h>
#include <BulletCollision/CollisionShapes/btConeShape.h>
#include <BulletCollision/CollisionShapes/btConvexHullShape.h>
#include <BulletCollision/CollisionShapes/btConvexPointCloudShape.h>
#include <BulletCollision/CollisionShapes/btConvexTriangleMeshShape.h>
#include <BulletCollision/CollisionShapes/btCylinderShape.h>
#include <BulletCollision/CollisionShapes/btPolyhedralConvexShape.h>
#include <BulletCollision/CollisionShapes/btSphereShape.h>
#include <BulletCollision/CollisionShapes/btStridingMeshInterface.h>
#include <LinearMath/btConvexHullComputer.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <glm/vec2.hpp>
#include <map>
#include <numeric>
#include <utility>

#include "integration/bullet/detail/convert.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

namespace {

// Chords of a rim. Each lies within 0.5 % of the radius from its arc, before its points are projected onto the arc.
constexpr std::uint32_t rimChords = 32;
// Support points on a shape without a closed form here: directions on a spiral, about 12 degrees apart.
constexpr int supportDirections = 256;
// Tolerance for rounding [fractions of the size]. A thinner body has no inside, and a point no farther than this beyond
// a face is over it.
constexpr float flatness = 1e-6f;
// A normal within this of the axis belongs to a flat end.
constexpr float flatEnd = 0.1f;
// Limit of steps in the search for the entry of a path; longer searches only graze.
constexpr int maxSteps = 64;
// From this fraction of the half height on, a point on the side is on a rim.
constexpr float beforeRim = 0.999f;

glm::vec3 direction(int axis) {
    glm::vec3 unit(0);
    unit[axis] = 1;
    return unit;
}

/// Any unit vector perpendicular to an axis.
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

/// The vertices of such a shape. Bullet uses its support only: the shape reports that it has no vertices.
std::vector<btVector3> cornersOf(const btConvexTriangleMeshShape& shape) {
    struct Corners : btInternalTriangleIndexCallback {
        std::vector<btVector3> points;
        void internalProcessTriangleIndex(btVector3* triangle, int, int) override {
            points.insert(points.end(), triangle, triangle + 3);
        }
    } corners;
    const btVector3 all(BT_LARGE_FLOAT, BT_LARGE_FLOAT, BT_LARGE_FLOAT);
    shape.getMeshInterface()->InternalProcessAllTriangles(&corners, -all, all);
    return corners.points;
}

std::vector<btVector3> cornersOf(const btPolyhedralConvexShape& shape) {
    if (shape.getShapeType() == CONVEX_TRIANGLEMESH_SHAPE_PROXYTYPE)
        return cornersOf(static_cast<const btConvexTriangleMeshShape&>(shape));
    std::vector<btVector3> points(shape.getNumVertices());
    for (int i = 0; i < shape.getNumVertices(); ++i) shape.getVertex(i, points[i]);
    return points;
}

int verticesOf(const btConvexShape& shape) {
    return shape.isPolyhedral() ? static_cast<const btPolyhedralConvexShape&>(shape).getNumVertices() : 0;
}

std::array<btVector3, 2> boundsOf(const btConvexShape& shape) {
    std::array<btVector3, 2> bounds;
    shape.getAabb(btTransform::getIdentity(), bounds[0], bounds[1]);
    return bounds;
}

}  // namespace

Convex::Convex(const btConvexShape& shape)
    : shape_(&shape),
      scaling_(shape.getLocalScaling()),
      margin_(shape.getMargin()),
      vertices_(verticesOf(shape)),
      bounds_(boundsOf(shape)) {
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
        case BOX_2D_SHAPE_PROXYTYPE:
            makeBox(toGlm(static_cast<const btBox2dShape&>(shape).getHalfExtentsWithMargin()));
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
        case MULTI_SPHERE_SHAPE_PROXYTYPE:
            // With different scale factors it is no hull of spheres, but is defined by its support function.
            if (scaling_.x() == scaling_.y() && scaling_.x() == scaling_.z()) {
                makeBalls(static_cast<const btMultiSphereShape&>(shape));
                break;
            }
            [[fallthrough]];
        default:
            radius_ = margin_;
            makeHull(shape.isPolyhedral() ? cornersOf(static_cast<const btPolyhedralConvexShape&>(shape))
                                          : supportPoints(shape));
    }
}

bool Convex::isOf(const btConvexShape& shape) const {
    return shape_ == &shape && scaling_ == shape.getLocalScaling() && margin_ == shape.getMargin() &&
           vertices_ == verticesOf(shape) && bounds_ == boundsOf(shape);
}

void Convex::makeBox(const glm::vec3& halfExtents) {
    core_ = Core::box;
    halfExtents_ = halfExtents;
    for (std::uint32_t corner = 0; corner < 8; ++corner) {
        const glm::vec3 side(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
        faces_.points.push_back(side * halfExtents);
        for (int axis = 0; axis < 3; ++axis) {
            const int next = (axis + 1) % 3, last = (axis + 2) % 3;
            const Conormals conormals{-side[next] * direction(next), -side[last] * direction(last)};
            if (side[axis] < 0) edges_.push_back({corner, corner | 1u << axis, 0, conormals});
        }
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
    // conormal of the face on the left of an edge
    std::map<std::pair<std::uint32_t, std::uint32_t>, glm::vec3> conormals;
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
        if (!(length > 0)) continue;
        const glm::vec3 normal = area / length;
        planes_.push_back({normal, glm::dot(normal, faces_.points[apex]), begin, faces_.triangles.size()});
        const auto* edge = first;
        do {
            const auto from = static_cast<std::uint32_t>(edge->getSourceVertex());
            const auto to = static_cast<std::uint32_t>(edge->getTargetVertex());
            conormals[{from, to}] = glm::normalize(glm::cross(normal, faces_.points[to] - faces_.points[from]));
            edge = edge->getNextEdgeOfFace();
        } while (edge != first);
    }
    for (int i = 0; i < hull.edges.size(); ++i) {
        const auto from = static_cast<std::uint32_t>(hull.edges[i].getSourceVertex());
        const auto to = static_cast<std::uint32_t>(hull.edges[i].getTargetVertex());
        if (from > to) continue;
        edges_.push_back({from, to, 0});
        const auto left = conormals.find({from, to}), right = conormals.find({to, from});
        if (left != conormals.end() && right != conormals.end())
            edges_.back().conormals = Conormals{left->second, right->second};
    }
    joinPlanes();
    isFlat_ = !planes_.empty() && std::all_of(faces_.points.begin(), faces_.points.end(), [&](const glm::vec3& point) {
        return std::abs(planes_.front().height(point)) <= flatness * size();
    });
}

void Convex::joinPlanes() {
    std::vector<std::pair<std::uint32_t, std::uint32_t>> around;  // vertex, plane
    for (std::uint32_t p = 0; p < planes_.size(); ++p)
        for (std::size_t i = planes_[p].begin; i < planes_[p].end; ++i)
            for (int k = 0; k < 3; ++k) around.emplace_back(faces_.triangles[i][k], p);
    std::sort(around.begin(), around.end());
    around.erase(std::unique(around.begin(), around.end()), around.end());
    firstAround_.assign(faces_.points.size() + 1, 0);
    for (const auto& [corner, plane] : around) {
        ++firstAround_[corner + 1];
        planesAround_.push_back(plane);
    }
    std::partial_sum(firstAround_.begin(), firstAround_.end(), firstAround_.begin());
}

void Convex::makeBalls(const btMultiSphereShape& shape) {
    core_ = Core::balls;
    std::vector<MultisphereHull::Ball> balls;
    for (int i = 0; i < shape.getSphereCount(); ++i)
        balls.push_back({toGlm(scaling_ * shape.getSpherePosition(i)), scaling_.x() * shape.getSphereRadius(i)});
    balls_ = MultisphereHull(std::move(balls));
    for (const MultisphereHull::Ball& ball : balls_.balls()) {
        faces_.points.push_back(ball.centre);
        radii_.push_back(ball.radius);
        radius_ = std::max(radius_, ball.radius);
    }
    for (const auto& [from, to] : balls_.pairs()) edges_.push_back({from, to, 0});
}

Convex::Near Convex::nearest(const glm::vec3& point, float reach) const {
    switch (core_) {
        case Core::segment:
            return nearestOfSegment(point);
        case Core::box:
            return nearestOfBox(point);
        case Core::revolution:
            return nearestOfRevolution(point);
        case Core::balls: {
            const auto [distance, normal, ball] = balls_.nearest(point);
            return {distance, normal, ball.centre, ball.radius};
        }
        default:
            return nearestOfHull(point, reach);
    }
}

/// By Newton's method, which does not overshoot: distance is convex along a path, and so is the bound of a hull's
/// distance. Once the distance grows, it grows forever.
std::optional<Convex::Entry> Convex::enter(const glm::vec3& start, const glm::vec3& way, float tolerance) const {
    const float length = glm::length(way);
    float part = 0;
    for (int i = 0; i < maxSteps; ++i) {
        const Near near = nearest(start + part * way, length);
        if (near.distance <= tolerance) return Entry{part, near};
        const float approach = -glm::dot(near.normal, way);
        if (!(approach > 0) || part >= 1) break;
        part = std::min(part + near.distance / approach, 1.f);
    }
    return std::nullopt;
}

Convex::Near Convex::nearestOfSegment(const glm::vec3& point) const {
    const glm::vec3 core = std::clamp(point[axis_], -halfHeight_, halfHeight_) * direction(axis_);
    const float length = glm::distance(point, core);
    const glm::vec3 normal = length > 0 ? (point - core) / length : squareTo(axis_);
    return {length - radius_, normal, core, radius_};
}

Convex::Near Convex::nearestOfBox(const glm::vec3& point) const {
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

Convex::Near Convex::nearestOfRevolution(const glm::vec3& point) const {
    // In the half plane through the point: x away from the axis, y along it.
    glm::vec3 out = point;
    out[axis_] = 0;
    const float rho = glm::length(out);
    out = rho > 0 ? out / rho : squareTo(axis_);
    const glm::vec2 p(rho, point[axis_]);
    const std::array<glm::vec2, 4> profile{
        {{0, -halfHeight_}, {lowerRadius_, -halfHeight_}, {upperRadius_, halfHeight_}, {0, halfHeight_}}};

    const float rounding = flatness * size();
    bool inside = true;
    float nearest = std::numeric_limits<float>::max(), height = std::numeric_limits<float>::lowest();
    glm::vec2 core(0), normal(0);
    for (int i = 0; i < 3; ++i) {
        const glm::vec2 a = profile[i], along = profile[i + 1] - a;
        const float length = glm::length(along);
        if (!(length > 0)) continue;
        const glm::vec2 outward = glm::vec2(along.y, -along.x) / length;
        const float above = glm::dot(p - a, outward), way = glm::dot(p - a, along) / length;
        inside &= above <= 0;
        const glm::vec2 q = a + std::clamp(way / length, 0.f, 1.f) * along;
        if (const float d = glm::distance(p, q); d < nearest) nearest = d, core = q;
        const bool isOver = way >= -rounding && way <= length + rounding;
        if (isOver && above > height) height = above, normal = outward;
    }
    // Points that almost coincide give a normal of rounding only.
    if (!inside && !(height > 0)) normal = (p - core) / nearest;
    const auto lift = [&](const glm::vec2& v) { return v.x * out + v.y * direction(axis_); };
    return {(inside ? -nearest : nearest) - radius_, lift(normal), lift(core), radius_};
}

Convex::Near Convex::nearestOfHull(const glm::vec3& point, float reach) const {
    const Plane* farthest = nullptr;
    float depth = -std::numeric_limits<float>::max();
    for (const Plane& plane : planes_)
        if (const float height = plane.height(point); height > depth) depth = height, farthest = &plane;
    // Inside, the nearest face decides; far outside, the bound is enough.
    const bool isInside = depth <= 0 && !isFlat_;
    if (farthest && (isInside || depth > reach + radius_))
        return {depth - radius_, farthest->normal, point - depth * farthest->normal, radius_};

    float squared = std::numeric_limits<float>::max();
    glm::vec3 core(0);
    const auto consider = [&](const glm::vec3& q) {
        const glm::vec3 way = point - q;
        const float s = glm::dot(way, way);
        if (!(s < squared)) return false;
        squared = s, core = q;
        return true;
    };
    // Only faces that the point is above can be nearest. A face nearer than all its neighbours is the nearest one,
    // since the distance to a convex body has no other minimum.
    const Plane* plane = nullptr;
    std::size_t triangle = 0;
    const auto considerFace = [&](const Plane& face) {
        for (std::size_t i = face.begin; i < face.end; ++i) {
            const glm::uvec3& t = faces_.triangles[i];
            if (consider(nearestOnTriangle(point, faces_.points[t.x], faces_.points[t.y], faces_.points[t.z])))
                plane = &face, triangle = i;
        }
    };
    if (isFlat_) {
        for (const Plane& side : planes_) considerFace(side);
    } else if (farthest) {
        considerFace(*farthest);
        for (const Plane* before = nullptr; plane != before && squared > depth * depth;) {
            before = plane;
            const glm::uvec3 corners = faces_.triangles[triangle];
            for (int i = 0; i < 3; ++i)
                for (std::uint32_t k = firstAround_[corners[i]]; k < firstAround_[corners[i] + 1]; ++k)
                    if (const Plane& next = planes_[planesAround_[k]]; &next != before && next.height(point) > 0)
                        considerFace(next);
        }
    }
    // A hull without faces is a line or a point.
    if (!farthest) {
        for (const Edge& edge : edges_)
            consider(
                nearestOnTriangle(point, faces_.points[edge.from], faces_.points[edge.to], faces_.points[edge.to]));
        for (const glm::vec3& corner : faces_.points) consider(corner);
    }
    const float distance = std::sqrt(squared);
    // Points that almost coincide give a normal of rounding only.
    if (farthest && glm::distance(point - core, depth * farthest->normal) <= flatness * size())
        return {distance - radius_, farthest->normal, core, radius_};
    const glm::vec3 normal = distance > 0 ? (point - core) / distance : farthest ? farthest->normal : squareTo(1);
    return {distance - radius_, normal, core, radius_};
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
    return core + near.radius * towards;
}

bool Convex::isFlat(const Near& near) const {
    return core_ == Core::box || core_ == Core::hull ||
           (core_ == Core::revolution && std::abs(near.normal[axis_]) > 1 - flatEnd * flatEnd);
}

bool Convex::isRound(const Near& near) const {
    const bool isOnSide = std::abs(near.core[axis_]) < beforeRim * halfHeight_;
    return core_ == Core::segment || core_ == Core::balls ||
           (core_ == Core::revolution && isOnSide && std::abs(near.normal[axis_]) < 1 - flatEnd * flatEnd);
}

std::optional<std::array<glm::vec3, 2>> Convex::sideLine(const Near& near, const glm::vec3& place) const {
    if (core_ != Core::revolution || std::abs(near.normal[axis_]) > 1 - flatEnd * flatEnd) return std::nullopt;
    glm::vec3 out = place;
    out[axis_] = 0;
    const float length = glm::length(out);
    if (!(length > 0)) return std::nullopt;
    out /= length;
    const glm::vec3 up = halfHeight_ * direction(axis_);
    return std::array{lowerRadius_ * out - up, upperRadius_ * out + up};
}

float Convex::radius(const Edge& edge, float part) const {
    return radii_.empty() ? radius_ : radii_[edge.from] + part * (radii_[edge.to] - radii_[edge.from]);
}

glm::vec3 Convex::place(const Edge& edge, float part) const {
    const glm::vec3 &from = faces_.points[edge.from], &to = faces_.points[edge.to];
    glm::vec3 place = from + part * (to - from);
    if (!(edge.rim > 0)) return place;
    // From the chord out to the arc.
    place[axis_] = 0;
    place *= edge.rim / glm::length(place);
    place[axis_] = from[axis_];
    return place;
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

int probeParts(float length, float voxelSize, int most) {
    return int(std::clamp(std::ceil(length / (probeSpacing * voxelSize)), 1.f, float(most)));
}

}  // namespace bilayer::bullet::detail
