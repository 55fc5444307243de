#include <bilayer/collider/distance.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <utility>

#include "collider/contact/collider_data.h"
#include "collider/contact/mesh_distance.h"
#include "collider/field/field_data.h"

namespace bilayer {

using namespace detail;

namespace {

/// A separation below this defines no direction [sizes of the larger body].
constexpr double minDirection = 1e-7;
/// The refinement of the deepest point: max count of steps, and the first and last distance to the point ahead
/// [voxels].
constexpr int refinements = 40;
constexpr float maxLead = 1024, minLead = 0.01f;

Similarity mapInto(const Placed& into, const Placed& from) {
    const glm::dquat toInto = glm::conjugate(glm::normalize(glm::dquat(into.pose.rotation)));
    const glm::dquat rotation = toInto * glm::normalize(glm::dquat(from.pose.rotation));
    const double scale = 1 / double(into.scale);
    return {glm::mat3_cast(rotation), double(from.scale) * scale,
            scale * (toInto * (glm::dvec3(from.pose.position) - glm::dvec3(into.pose.position)))};
}

glm::dvec3 toWorld(const Placed& body, const glm::dvec3& point) {
    return glm::normalize(glm::dquat(body.pose.rotation)) * (double(body.scale) * point) +
           glm::dvec3(body.pose.position);
}

double sizeOf(const Placed& body) {
    return double(body.scale) * double(body.collider.bounds().longestSide());
}

WitnessPoint witness(const Placed& frame, const TrianglePoint& point, std::uint32_t triangle) {
    return {toWorld(frame, point.position), triangle, point.feature, point.index};
}

BodyDistance separated(const Placed& a, const Placed& b, const MeshDistance& found) {
    BodyDistance answer{.found = true,
                        .distance = float(found.distance * double(b.scale)),
                        .a = witness(b, found.a, found.triangleA),
                        .b = witness(b, found.b, found.triangleB)};
    if (found.distance * double(b.scale) > minDirection * std::max(sizeOf(a), sizeOf(b)))
        answer.normal =
            glm::normalize(glm::dquat(b.pose.rotation)) * glm::normalize(found.a.position - found.b.position);
    return answer;
}

// Whether a component of a body lies inside another, if their surfaces do not meet.
bool isInside(const Placed& inner, const Placed& outer) {
    const Similarity map = mapInto(outer, inner);
    const Bounds& bounds = outer.collider.bounds();
    const auto components = inner.collider.data().componentPoints();
    return std::any_of(components.begin(), components.end(), [&](const glm::vec3& point) {
        const glm::vec3 at(map(glm::dvec3(point)));
        return at == glm::clamp(at, bounds.lower, bounds.upper) && outer.collider.exactField().inside(at);
    });
}

// A point of one body's surface inside another body, and the closest point of that body's surface; both in coordinates
// of the other body.
struct Depth {
    glm::vec3 point{0};
    ClosestPoint closest{.distance = 0};
};

// The deepest of the surface points.
Depth deepestSample(const Placed& inner, const Field& field, const Similarity& map) {
    Depth deepest;
    for (const SurfacePoint& point : inner.collider.data().points().points()) {
        const glm::vec3 at(map(glm::dvec3(point.position)));
        const Sample sample = field.sample(at);
        const bool shallow = sample.inBand && sample.distance > deepest.closest.distance + field.voxelSize();
        if (!(sample.distance < 0) || shallow) continue;
        const ClosestPoint closest = field.closest(at);
        if (closest.found && closest.distance < deepest.closest.distance) deepest = {at, closest};
    }
    return deepest;
}

// Moves the point along the inner surface as far as it gets deeper: to where the surface is closest to a point that
// lies ahead in the direction of penetration. The lead is halved when that leads elsewhere.
Depth refined(Depth depth, const Placed& inner, const Field& field, const Similarity& map) {
    const Field& own = inner.collider.exactField();
    const float voxel = field.voxelSize();
    float lead = field.voxelSize() * maxLead;
    for (int i = 0; i < refinements && lead > minLead * voxel; ++i) {
        const glm::vec3 ahead = depth.point - lead * depth.closest.normal;
        const ClosestPoint onSurface = own.closest(glm::vec3(map.inverse(glm::dvec3(ahead))));
        if (!onSurface.found) return depth;
        const glm::vec3 at(map(glm::dvec3(onSurface.position)));
        const ClosestPoint closest = field.closest(at);
        if (closest.found && closest.distance < depth.closest.distance)
            depth = {at, closest};
        else
            lead /= 4;
    }
    return depth;
}

// The deepest surface point of one body inside another; at depth 0 if there is none.
BodyDistance deepestOf(const Placed& inner, const Placed& outer) {
    const Similarity map = mapInto(outer, inner);
    const Field& field = outer.collider.exactField();
    Depth depth = deepestSample(inner, field, map);
    if (depth.closest.distance < 0) depth = refined(depth, inner, field, map);
    const ClosestPoint& closest = depth.closest;
    return {.found = true,
            .overlap = Overlap::surfaces,
            .distance = closest.distance * outer.scale,
            .a = {toWorld(outer, glm::dvec3(depth.point))},
            .b = {toWorld(outer, glm::dvec3(closest.position)), closest.triangle, closest.feature, closest.index},
            .normal = outer.pose.rotation * closest.normal};
}

BodyDistance swapped(BodyDistance answer) {
    std::swap(answer.a, answer.b);
    answer.normal = -answer.normal;
    return answer;
}

BodyDistance intersecting(const Placed& a, const Placed& b, const MeshDistance& touch) {
    const BodyDistance ofA = deepestOf(a, b), ofB = deepestOf(b, a);
    if (ofA.distance < 0 || ofB.distance < 0) return ofA.distance <= ofB.distance ? ofA : swapped(ofB);
    return {.found = true,
            .overlap = Overlap::surfaces,
            .distance = 0,
            .a = witness(b, touch.a, touch.triangleA),
            .b = witness(b, touch.b, touch.triangleB)};
}

BodyDistance contained(BodyDistance deepest, Overlap overlap) {
    deepest.overlap = overlap;
    return deepest;
}

}  // namespace

BodyDistance distance(const Placed& a, const Placed& b, const DistanceOptions& options, DistanceStart* start) {
    const Similarity aToB = mapInto(b, a);
    const double limit = std::max(double(options.maxDistance), 0.0) / double(b.scale);
    const MeshDistance found =
        distanceBetween(a.collider.data().meshTree(), b.collider.data().meshTree(), aToB, limit,
                        start ? TriangleIndices{start->triangleA, start->triangleB} : TriangleIndices{});
    if (start) *start = {found.triangleA, found.triangleB};
    if (found.found() && found.distance == 0) return intersecting(a, b, found);
    if (isInside(a, b)) return contained(deepestOf(a, b), Overlap::aInsideB);
    if (isInside(b, a)) return contained(swapped(deepestOf(b, a)), Overlap::bInsideA);
    return found.found() ? separated(a, b, found) : BodyDistance{};
}

}  // namespace bilayer
