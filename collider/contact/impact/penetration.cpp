// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/impact/penetration.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <optional>
#include <type_traits>
#include <variant>
#include <vector>

#include "collider/contact/body/body_transform.h"
#include "collider/contact/body/collider_data.h"
#include "collider/contact/impact/surfaces.h"
#include "collider/contact/open_surface/open_surface.h"
#include "collider/contact/search/edge_probes.h"
#include "collider/contact/shapes/shape_data.h"
#include "sdf/base/access.h"

namespace bilayer::detail {

namespace {

// Depth of the test points inside their own body [voxels]. Contacts handle shallower penetration, so that a body that
// slides along another one is not stopped.
constexpr float testDepth = 0.25f;
// A point that starts inside may get as deep as `maxStartDepth`, so that a body slides on at its depth. It may always
// get deeper by `minDeepening`, and never by more than `maxDeepening` in a step [voxels]: more would add up over steps.
constexpr float maxStartDepth = 0.45f, minDeepening = 0.02f, maxDeepening = 0.1f;
// Maximum depth of a surface point below the plane where its test point enters [voxels].
constexpr float maxDepth = testDepth + maxDeepening;
// A stopped body goes back by this much at most from where the test point entered [voxels]. An oblique path touches far
// before it enters. Where the surface bends in between, the next step's contacts would miss the surface that the body
// met, and it would be stopped in the same place again.
constexpr float maxReturn = 0.5f;
// A body that goes back to less than this from its start stops where the test point enters [voxels]. At its start,
// contacts would miss the surface ahead, and it would be stopped there in each step.
constexpr float minAdvance = 0.05f;
// Beyond a convex edge, the surface is below the plane where a point entered. So the depth of a point is measured to
// the nearest surface above or below it instead, if that and the plane are at most this far away [voxels],
constexpr float maxPlaneDepth = 1;
// and if that surface faces the same way as the plane (cosine of the angle between the normals).
constexpr float minSimilarCosine = 0.5f;
// A test point has passed an open surface that cuts its body at most this far below the point [voxels].
constexpr float maxPassedDepth = 1;
// That holds only where the body is thick: at that depth, its own surface is at least this far away [voxels]. The open
// surface may else just touch the other side of a thin body.
constexpr float minCoreDepth = 0.35f;
// A point that passes an open surface with its body ahead of it leaves that surface: a point enters only where the
// cosine of the angle between its normal and that of the surface is at most this. The margin is for faces that pass
// edgewise.
constexpr float maxFacing = -0.05f;
// A point that is moved back to an open surface starts this far in front of it, so that it enters again [voxels].
constexpr float startHeight = 0.01f;
// Arcs are approximated by chords of this angle [rad]; their error is its square over eight, in fractions of the
// radius.
constexpr float maxChordAngle = 0.1f;
constexpr int maxProbes = 1 << 20;     // along an edge; distant ones are skipped
constexpr double arcOverChord = 1.12;  // length of an arc of a rim over its chord, up to a quarter of the rim

/// Transforms coordinates of the points' shape into those of the surface at some time of the step.
struct StepTransform : BodyTransform {
    float time;
};

/// Moments from start to end, so close together that the paths between them are straight.
std::vector<StepTransform> stepTransforms(const SweptShape& points, const SweptShape& surface) {
    const int chords = std::max(1, int(std::ceil(float(points.sweep.angle() + surface.sweep.angle()) / maxChordAngle)));
    std::vector<float> times{float(points.sweep.stopTime()), float(surface.sweep.stopTime())};
    for (int i = 0; i <= chords; ++i) times.push_back(float(i) / float(chords));
    std::sort(times.begin(), times.end());
    times.erase(std::unique(times.begin(), times.end()), times.end());
    std::vector<StepTransform> transforms;
    for (const float time : times) {
        const Pose from = points.at(double(time)), into = surface.at(double(time));
        transforms.push_back({BodyTransform(from, points.scale, into, surface.scale), time});
    }
    return transforms;
}

/// In double precision: the square of a length above 1e19 is no float.
double lengthBetween(const glm::vec3& a, const glm::vec3& b) {
    return glm::distance(glm::dvec3(a), glm::dvec3(b));
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
        : surface_(surface), transforms_(transforms), voxel_(voxel), scale_(transforms.front().scale) {}

    /// Follows the surface points of a collider.
    void follow(const Collider& collider) {
        body_ = &collider.field();
        const auto reject = [&](const glm::vec3& centre, float radius) { return !comesNear(centre, scale_ * radius); };
        dataOf(collider).points().visit(reject, [&](std::uint32_t, const SurfacePoint& point) {
            if (!(Surface::isOpen && point.isInner)) follow({point.position, point.normal});
        });
    }

    /// Follows the vertices and edges of a convex body, grown by its radius.
    /// @param voxel  in the units of the body
    void follow(const Convex& convex, float voxel) {
        const auto pointAt = [](const glm::vec3& point, float radius) {
            const float length = glm::length(point);
            return RoundedPoint{point, length > 0 ? point / length : glm::vec3(0), radius};
        };
        const auto vertices = convex.vertices();
        for (std::uint32_t i = 0; i < vertices.size(); ++i) follow(pointAt(vertices[i], convex.radius(i)));
        for (const Convex::Edge& edge : convex.edges())
            followEdge(lengthBetween(vertices[edge.from], vertices[edge.to]), voxel, [&](float fraction) {
                return pointAt(convex.place(edge, fraction), convex.radius(edge, fraction));
            });
    }

    /// Follows the sharp features of triangles.
    void follow(const SharpFeatures& sharp, float voxel) {
        for (const SharpFeatures::OutwardVertex& vertex : sharp.vertices) follow({vertex.place, vertex.outward});
        for (const SharpFeatures::OutwardEdge& edge : sharp.edges)
            followEdge(lengthBetween(edge.from, edge.to), voxel, [&](float fraction) {
                return RoundedPoint{glm::mix(edge.from, edge.to, fraction), edge.outward};
            });
    }

    /// The first penetration, in the surface's coordinates.
    const Penetration& first() const { return first_; }

  private:
    /// What is followed in place of a rounded point: a point or a sphere that is `testDepth` inside the body's surface.
    struct TestPoint {
        glm::vec3 place;  ///< in the body's coordinates
        float radius;
        float radiusReduction, inwardOffset;  ///< compared with the rounded point; their sum is `testDepth`

        /// The depth of the test point where the rounded point touches a surface.
        /// @param facing  cosine of the angle between the normals of the body and of the surface
        float touchingDepth(float facing) const { return std::min(inwardOffset * facing, 0.f) - radiusReduction; }
    };
    TestPoint testPointOf(const RoundedPoint& rounded) const {
        const float radius = std::max(scale_ * rounded.radius - testDepth * voxel_, 0.f),
                    reduction = scale_ * rounded.radius - radius, offset = testDepth * voxel_ - reduction;
        return {rounded.place - offset / scale_ * rounded.outward, radius, reduction, offset};
    }

    void follow(const RoundedPoint& rounded) {
        const TestPoint point = testPointOf(rounded);
        // a point that starts inside is followed from the surface on, so that it may move on at its depth
        const auto depenetration = depenetrationOf(point.place, rounded.outward, point.radius);
        if (!depenetration) return;
        const glm::vec3 offset = *depenetration;
        const float lead = Surface::isOpen && offset != glm::vec3(0) ? startHeight * voxel_ : 0;
        glm::vec3 from = transforms_.front()(point.place) + offset;
        std::optional<SurfaceEntry> entered;
        float stop = 0;  // where the body stops if the point that has entered gets too deep
        for (std::size_t i = 0; i + 1 < transforms_.size() && transforms_[i].time < first_.time; ++i) {
            const glm::vec3 to = transforms_[i + 1](point.place) + offset;
            const glm::vec3 ahead = transforms_[i].rotated(rounded.outward);
            const bool wasInside = entered.has_value();
            if (!wasInside) entered = entryOf(from, to, ahead, point.radius);
            if (entered) {
                const float touching = point.touchingDepth(glm::dot(ahead, entered->normal));
                if (!wasInside) stop = stoppingTime(i, chordOf(*entered, from, to, point.radius), touching, lead);
                const float limit = offset == glm::vec3(0) ? maxDepth * voxel_ + touching : deepening(offset) * voxel_;
                if (getsDeeper(*entered, to, point.radius, limit)) {
                    first_ = {std::min(stop, first_.time), entered->position - offset, entered->normal};
                    return;
                }
                if (depthBelow(*entered, to, point.radius) < 0) entered.reset();
            }
            from = to;
        }
    }

    /// How much deeper a point may get that starts inside [voxels].
    /// @param offset  from its test point to the surface
    float deepening(const glm::vec3& offset) const {
        const float depth = glm::length(offset) / voxel_ + testDepth;
        return std::clamp(maxStartDepth - depth, minDeepening, maxDeepening);
    }

    /// Where a test point enters the surface on a chord.
    /// @param ahead  the outward normal of its body
    std::optional<SurfaceEntry> entryOf(const glm::vec3& from, const glm::vec3& to, const glm::vec3& ahead,
                                        float radius) const {
        const auto entry = surface_.entry(from, to, radius);
        return entry && leaves(ahead, *entry) ? std::nullopt : entry;
    }

    /// Whether a test point that has entered is deeper than this. If it is, takes the surface around it, if that is
    /// known, in place of the plane where it entered.
    bool getsDeeper(SurfaceEntry& entered, const glm::vec3& point, float radius, float limit) const {
        const float depth = depthBelow(entered, point, radius);
        if (!(depth > limit)) return false;
        if (const auto around = surfaceAround(point, depth, entered, radius)) entered = *around;
        return depthBelow(entered, point, radius) > limit;
    }

    /// How deep a sphere is below the tangent plane of the place where it entered.
    static float depthBelow(const SurfaceEntry& entry, const glm::vec3& centre, float radius) {
        return glm::dot(entry.position - centre, entry.normal) + radius;
    }

    /// The straight path of a test point between two moments.
    struct Chord {
        float length;
        float before, after;  ///< depths at its ends

        /// Where it reaches a depth, as a fraction of its length; not limited to the chord.
        float partAt(float depth) const { return after > before ? (depth - before) / (after - before) : 0; }
    };

    static Chord chordOf(const SurfaceEntry& entry, const glm::vec3& from, const glm::vec3& to, float radius) {
        return {glm::distance(from, to), depthBelow(entry, from, radius), depthBelow(entry, to, radius)};
    }

    /// The time at which a body stops if its test point enters on this chord: the time at which the point itself
    /// touches, if that is not far back. Before the chord the path has another direction.
    /// @param touching  depth of the test point then
    /// @param lead      height of the test point above the surface at its start, if it was moved back to that
    float stoppingTime(std::size_t chordIndex, const Chord& chord, float touching, float lead) const {
        const float entering = chord.partAt(-lead),
                    part = std::max(chord.partAt(touching), entering - maxReturn * voxel_ / chord.length);
        // there is too little path to go back on: the body stops where the point enters
        const bool isAtStart = chordIndex == 0 && part * chord.length < minAdvance * voxel_;
        return glm::mix(transforms_[chordIndex].time, transforms_[chordIndex + 1].time,
                        std::clamp(isAtStart ? entering : part, 0.f, 1.f));
    }

    /// The surface around a point that is below the plane of its entry; nothing if that is unknown.
    std::optional<SurfaceEntry> surfaceAround(const glm::vec3& point, float depth, const SurfaceEntry& plane,
                                              float radius) const {
        const float reach = maxPlaneDepth * voxel_;
        if (depth > reach) return std::nullopt;
        const auto found = surface_.entry(point + (depth + reach) * plane.normal, point - reach * plane.normal, radius);
        if (!found || glm::dot(found->normal, plane.normal) < minSimilarCosine) return std::nullopt;
        return found;
    }

    /// Whether a point passes an open surface with its body ahead of it.
    /// @param outward  normal of its body
    bool leaves(const glm::vec3& outward, const SurfaceEntry& entry) const {
        return Surface::isOpen && glm::dot(outward, entry.normal) > maxFacing;
    }

    /// The displacement to the surface of a point that starts inside; zero if it starts outside, nothing if unknown.
    /// @param inner    the test point
    /// @param outward  normal of its body
    std::optional<glm::vec3> depenetrationOf(const glm::vec3& inner, const glm::vec3& outward, float radius) const {
        if constexpr (Surface::isOpen) {
            return backThroughOpenSurface(inner, outward);
        } else {
            const glm::vec3 from = transforms_.front()(inner);
            if (surface_.entry(from, from, radius)) return surface_.depenetration(from, radius);
            return glm::vec3(0);
        }
    }

    /// The displacement to an open surface of a point that has passed it, so that the surface cuts the body right below
    /// the point. Zero if it does not.
    glm::vec3 backThroughOpenSurface(const glm::vec3& inner, const glm::vec3& outward) const {
        const glm::vec3 core = inner - maxPassedDepth * voxel_ / scale_ * outward;
        const glm::vec3 from = transforms_.front()(core), to = transforms_.front()(inner);
        const auto cut = surface_.entry(from, to, 0);
        if (!cut || scale_ * body_->distance(core) > -minCoreDepth * voxel_) return glm::vec3(0);
        return (glm::dot(cut->position - to, cut->normal) + startHeight * voxel_) * cut->normal;
    }

    /// Follows the points of an edge, ends excluded.
    /// @param length   between its ends
    /// @param voxel    of the field that is met, in the same units
    /// @param pointAt  (float fraction) -> RoundedPoint
    template <class PointAt>
    void followEdge(double length, float voxel, const PointAt& pointAt) {
        const int intervals = probeIntervals(float(length), voxel, maxProbes);
        const float radius = std::max(pointAt(0.f).radius, pointAt(1.f).radius);
        followBetween(0, intervals, arcOverChord * length / intervals, radius,
                      [&](int i) { return pointAt(float(i) / float(intervals)); });
    }

    /// Follows the points with numbers in between, if any of them may come near.
    /// @param length, radius  from one point to the next, and of the largest point
    template <class PointAt>
    void followBetween(int from, int to, double length, float radius, const PointAt& pointAt) {
        if (to - from < 2) return;
        const int middle = from + (to - from) / 2;
        const RoundedPoint rounded = pointAt(middle);
        if (!comesNear(rounded.place, scale_ * (float((to - middle) * length) + radius))) return;
        follow(rounded);
        followBetween(from, middle, length, radius, pointAt);
        followBetween(middle, to, length, radius, pointAt);
    }

    bool comesNear(const glm::vec3& centre, float radius) const {
        for (std::size_t i = 0; i + 1 < transforms_.size() && transforms_[i].time < first_.time; ++i)
            if (surface_.isNear(transforms_[i](centre), transforms_[i + 1](centre), radius)) return true;
        return false;
    }

    const Surface& surface_;
    const std::vector<StepTransform>& transforms_;
    float voxel_, scale_;
    const Field* body_ = nullptr;  ///< that the points belong to, if it is a collider
    Penetration first_;
};

/// The edge of a shape's voxel [m]; infinite if it has none.
float voxelOf(const SweptShape& body) {
    const Collider* collider = body.shape.collider();
    return collider ? body.scale * collider->field().voxelSize() : std::numeric_limits<float>::infinity();
}

/// The sharp features of an open surface that a collider may meet.
SharpFeatures sharpFeaturesOn(const OpenSurface& openSurface, float scale, const SweptShape& field,
                              const std::vector<StepTransform>& intoOpenSurface) {
    const Bounds& bounds = field.shape.collider()->bounds();
    std::vector<glm::vec3> path;
    for (const StepTransform& transform : intoOpenSurface) path.push_back(transform(bounds.centre()));
    const float radius = 0.5f * field.scale / scale * glm::length(bounds.size());
    return sharpFeaturesOf(trianglesAlong(openSurface, path, radius));
}

/// The first penetration of the points of one shape into the surface of another, in world coordinates.
/// @param voxel  the smaller one of both [m]
Penetration firstOf(const SweptShape& points, const SweptShape& other, float voxel) {
    const std::vector<StepTransform> transforms = stepTransforms(points, other);
    const auto& shape = dataOf(points.shape).shape;
    const auto into = [&](const auto& solid) {
        const auto surface = surfaceOf(solid, voxel / other.scale);
        PointSweep sweep(surface, transforms, voxel / other.scale);
        const float ownVoxel = voxel / points.scale;
        if (const auto* collider = std::get_if<Collider>(&shape))
            sweep.follow(*collider);
        else if constexpr (std::is_same_v<decltype(surface), const FieldSurface>) {
            if (const auto* convex = std::get_if<Convex>(&shape)) sweep.follow(*convex, ownVoxel);
            if (const auto* openSurface = std::get_if<OpenSurface>(&shape))
                sweep.follow(sharpFeaturesOn(*openSurface, points.scale, other, stepTransforms(other, points)),
                             ownVoxel);
        }
        return sweep.first();
    };
    const Penetration first = std::visit(into, dataOf(other.shape).shape);
    const Pose pose = other.at(double(first.time));
    return {first.time, pose.toWorld(other.scale * first.position), pose.rotation * first.normal};
}

}  // namespace

Penetration firstPenetration(const SweptShape& a, const SweptShape& b) {
    const float voxel = std::min(voxelOf(a), voxelOf(b));
    const Penetration byA = firstOf(a, b, voxel), byB = firstOf(b, a, voxel).reversed();
    return earlier(byA, byB, relativeDisplacement(a.sweep, b.sweep));
}

}  // namespace bilayer::detail
