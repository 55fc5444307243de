// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/time_of_impact.h"
#include <bilayer/collider/contact.h>
#include "collider/contact/collider_data.h"

#include <BulletCollision/CollisionShapes/btStaticPlaneShape.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <optional>
#include <type_traits>
#include <vector>

#include "integration/bullet/detail/convert.h"
#include "integration/bullet/detail/convex.h"
#include "integration/bullet/detail/edge_probes.h"
#include "integration/bullet/detail/open_surface.h"
#include "integration/bullet/detail/surfaces.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

namespace {

// Depth of the test points inside their own body [voxels]. Contacts handle shallower penetration, so that a body that
// slides along another one is not stopped.
constexpr float testDepth = 0.25f;
// Maximum depth of such a point below the plane at its entry, or beyond its initial depth [voxels].
constexpr float allowedDepth = 0.1f;
// Arcs are approximated by chords of this angle [rad]; their error is its square over eight, in fractions of the
// radius.
constexpr float maxChordAngle = 0.1f;
// A path is certainly free while nothing is closer than this [voxels].
constexpr float nearDistance = 0.5f;
constexpr int maxProbes = 1 << 20;     // along an edge; distant ones are skipped
constexpr float arcOverChord = 1.12f;  // length of an arc of a rim over its chord, up to a quarter of the rim

/// Transforms a field's coordinates into those of a surface at some time of the step.
struct StepTransform {
    float time;
    glm::mat3 linear;
    glm::vec3 shift;

    glm::vec3 operator()(const glm::vec3& point) const { return linear * point + shift; }
};

/// The coordinate frame of a field or another shape.
struct Frame {
    Pose pose;
    float scale;
};

Frame frameOf(const LeafShape& shape, const btTransform& object) {
    const btTransform here = object * shape.local;
    if (shape.shape->getShapeType() != FAST_CONCAVE_MESH_PROXYTYPE) return {toPose(here), 1};
    const Placed placed = static_cast<const Shape*>(shape.shape)->placed(here);
    return {placed.pose, placed.scale};
}

/// @param impact  in the coordinates of the surface
Impact inWorld(const Impact& impact, const LeafShape& surface, const BodySweep& its) {
    const Frame frame = frameOf(surface, its.at(impact.time));
    return {impact.time, frame.pose.toWorld(frame.scale * impact.place), frame.pose.rotation * impact.normal};
}

/// Moments from start to end, so close together that the paths between them are straight.
std::vector<StepTransform> stepTransforms(const LeafShape& points, const BodySweep& its, const LeafShape& other,
                                          const BodySweep& others) {
    const int chords = std::max(1, int(std::ceil((its.angle() + others.angle()) / maxChordAngle)));
    std::vector<float> times{its.stopTime(), others.stopTime()};
    for (int i = 0; i <= chords; ++i) times.push_back(float(i) / float(chords));
    std::sort(times.begin(), times.end());
    times.erase(std::unique(times.begin(), times.end()), times.end());
    std::vector<StepTransform> transforms;
    for (const float time : times) {
        const Frame from = frameOf(points, its.at(time)), into = frameOf(other, others.at(time));
        const Pose pose = relative(into.pose, from.pose);
        transforms.push_back(
            {time, from.scale / into.scale * glm::mat3_cast(pose.rotation), pose.position / into.scale});
    }
    return transforms;
}

/// A point of a body, grown by a radius.
struct RoundedPoint {
    glm::vec3 place;
    glm::vec3 outward;  ///< outward normal of the body, of unit length; or zero
    float radius = 0;
};

/// Follows points on their paths through a surface.
template <class Surface>
class PointSweep {
  public:
    /// @param voxel  in the surface's units
    PointSweep(const Surface& surface, const std::vector<StepTransform>& transforms, float voxel)
        : surface_(surface),
          transforms_(transforms),
          voxel_(voxel),
          scale_(glm::length(transforms.front().linear[0])) {}

    /// Follows the surface points of a field.
    void follow(const SurfacePoints& points) {
        const auto reject = [&](const glm::vec3& centre, float radius) { return !comesNear(centre, scale_ * radius); };
        points.visit(reject, [&](std::uint32_t, const SurfacePoint& point) { follow({point.position, point.normal}); });
    }

    void follow(const RoundedPoint& rounded) {
        const auto& [point, outward, radius] = rounded;
        const float inward = testDepth * voxel_, smaller = std::max(scale_ * radius - inward, 0.f);
        const glm::vec3 inner = point - (inward - scale_ * radius + smaller) / scale_ * outward;
        glm::vec3 from = transforms_.front()(inner), offset(0);
        // a point that starts inside may move on at its depth
        if (surface_.entry(from, from, smaller)) {
            const auto out = surface_.depenetration(from, smaller);
            if (!out) return;
            offset = *out;
        }
        from += offset;
        std::optional<SurfaceEntry> entered;
        for (std::size_t i = 0; i + 1 < transforms_.size() && transforms_[i].time < first_.time; ++i) {
            const glm::vec3 to = transforms_[i + 1](inner) + offset;
            if (!entered) entered = surface_.entry(from, to, smaller);
            if (entered) {
                const auto depth = [&](const glm::vec3& at) {
                    return glm::dot(entered->position - at, entered->normal) + smaller;
                };
                const float before = depth(from), after = depth(to), deepest = allowedDepth * voxel_;
                if (after > deepest) {
                    // back to the contact of its own surface
                    const glm::vec3 out = transforms_[i].linear * outward / scale_;
                    const float touching = std::min(inward * glm::dot(out, entered->normal), 0.f);
                    const float part = (touching - before) / (after - before);
                    const float time = transforms_[i].time + part * (transforms_[i + 1].time - transforms_[i].time);
                    first_ = {std::clamp(time, 0.f, first_.time), entered->position - offset, entered->normal};
                    return;
                }
                if (after < 0) entered.reset();
            }
            from = to;
        }
    }

    /// Follows the points of an edge, ends excluded.
    /// @param pointAt   (float fraction) -> RoundedPoint
    /// @param length   between its ends
    /// @param spacing  of the field that is met, in the same units
    template <class PointAt>
    void followEdge(float length, float spacing, const PointAt& pointAt) {
        const int intervals = probeIntervals(length, spacing, maxProbes);
        const float radius = std::max(pointAt(0.f).radius, pointAt(1.f).radius);
        followBetween(0, intervals, arcOverChord * length / float(intervals), radius,
                      [&](int i) { return pointAt(float(i) / float(intervals)); });
    }

    /// The first impact, in the surface's coordinates.
    const Impact& first() const { return first_; }

  private:
    /// Follows the points with numbers in between, if any of them may come near.
    /// @param length, radius  from one point to the next, and of the largest point
    template <class PointAt>
    void followBetween(int from, int to, float length, float radius, const PointAt& pointAt) {
        if (to - from < 2) return;
        const int middle = from + (to - from) / 2;
        const RoundedPoint rounded = pointAt(middle);
        if (!comesNear(rounded.place, scale_ * (float(to - middle) * length + radius))) return;
        follow(rounded);
        followBetween(from, middle, length, radius, pointAt);
        followBetween(middle, to, length, radius, pointAt);
    }

    bool comesNear(const glm::vec3& centre, float radius) const {
        for (std::size_t i = 0; i + 1 < transforms_.size() && transforms_[i].time < first_.time; ++i)
            if (isNear(transforms_[i](centre), transforms_[i + 1](centre), radius)) return true;
        return false;
    }

    bool isNear(const glm::vec3& from, const glm::vec3& to, float radius) const {
        if constexpr (std::is_same_v<Surface, TriangleSurface>) {
            return surface_.isNear(from, to, radius);
        } else {
            return !staysClear(from, to, nearDistance * voxel_,
                               [&](const glm::vec3& at) { return surface_.bound(at) - radius; });
        }
    }

    const Surface& surface_;
    const std::vector<StepTransform>& transforms_;
    float voxel_, scale_;
    Impact first_;
};

template <class Surface>
Impact firstImpact(const Shape& field, const Surface& surface, const std::vector<StepTransform>& transforms,
                   float voxel) {
    PointSweep sweep(surface, transforms, voxel);
    sweep.follow(field.collider().data().points());
    return sweep.first();
}

/// Follows the vertices and edges of a convex body, grown by its radius.
Impact firstImpact(const Convex& convex, const Shape& field, const std::vector<StepTransform>& transforms) {
    const FieldSurface surface(field.collider().field());
    PointSweep sweep(surface, transforms, field.voxelSize() / field.scale());
    const auto pointAt = [](const glm::vec3& point, float radius) {
        const float length = glm::length(point);
        return RoundedPoint{point, length > 0 ? point / length : glm::vec3(0), radius};
    };
    const auto vertices = convex.vertices();
    for (std::uint32_t i = 0; i < vertices.size(); ++i) sweep.follow(pointAt(vertices[i], convex.radius(i)));
    for (const Convex::Edge& edge : convex.edges())
        sweep.followEdge(glm::distance(vertices[edge.from], vertices[edge.to]), field.voxelSize(), [&](float fraction) {
            return pointAt(convex.place(edge, fraction), convex.radius(edge, fraction));
        });
    return sweep.first();
}

/// Follows the sharp features of the triangles along a field's path.
/// @param intoMesh, transforms  of the field into the mesh, and of the mesh into the field
Impact firstImpact(const btConcaveShape& mesh, const Shape& field, const std::vector<StepTransform>& intoMesh,
                   const std::vector<StepTransform>& transforms) {
    const Bounds& bounds = field.collider().bounds();
    std::vector<glm::vec3> path;
    for (const StepTransform& transform : intoMesh) path.push_back(transform(bounds.centre()));
    const float radius = 0.5f * field.scale() * glm::length(bounds.size());
    const SharpFeatures sharp = sharpFeaturesOf(trianglesAlong(mesh, path, radius));
    const FieldSurface surface(field.collider().field());
    PointSweep sweep(surface, transforms, field.voxelSize() / field.scale());
    for (const SharpFeatures::OutwardVertex& vertex : sharp.vertices) sweep.follow({vertex.place, vertex.outward});
    for (const SharpFeatures::OutwardEdge& edge : sharp.edges)
        sweep.followEdge(glm::distance(edge.from, edge.to), field.voxelSize(), [&](float fraction) {
            return RoundedPoint{glm::mix(edge.from, edge.to, fraction), edge.outward};
        });
    return sweep.first();
}

}  // namespace

Impact timeOfImpact(const LeafShape& fieldShape, const BodySweep& fieldSweep, const LeafShape& other,
                    const BodySweep& otherSweep) {
    const Shape& field = *fieldShape.field();
    const std::vector<StepTransform> transforms = stepTransforms(fieldShape, fieldSweep, other, otherSweep);
    const float voxel = field.voxelSize();
    const int type = other.shape->getShapeType();
    const auto into = [&](const auto& surface, float itsVoxel) {
        return inWorld(firstImpact(field, surface, transforms, itsVoxel), other, otherSweep);
    };
    if (const Shape* second = other.field())
        return into(FieldSurface(second->collider().field()), std::min(voxel, second->voxelSize()) / second->scale());
    if (type == STATIC_PLANE_PROXYTYPE)
        return into(PlaneSurface(static_cast<const btStaticPlaneShape&>(*other.shape)), voxel);
    if (other.shape->isConvex()) {
        const Convex convex(static_cast<const btConvexShape&>(*other.shape));
        const Impact impact = firstImpact(convex, field, stepTransforms(other, otherSweep, fieldShape, fieldSweep));
        return earlier(into(ConvexSurface(convex, 0.1f * allowedDepth * voxel), voxel),
                       inWorld(impact, fieldShape, fieldSweep).reversed());
    }
    if (!other.shape->isConcave() || type == GIMPACT_SHAPE_PROXYTYPE || type == FAST_CONCAVE_MESH_PROXYTYPE) return {};
    const auto& mesh = static_cast<const btConcaveShape&>(*other.shape);
    const Impact impact =
        firstImpact(mesh, field, transforms, stepTransforms(other, otherSweep, fieldShape, fieldSweep));
    return earlier(into(TriangleSurface(mesh), voxel), inWorld(impact, fieldShape, fieldSweep).reversed());
}

}  // namespace bilayer::bullet::detail
