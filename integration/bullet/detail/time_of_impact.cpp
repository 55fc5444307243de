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
constexpr float sunk = 0.25f;
// Maximum depth of such a point below the plane at its entry, or beyond its initial depth [voxels].
constexpr float allowed = 0.1f;
// Arcs are approximated by chords of this angle [rad]; their error is its square over eight, in fractions of the
// radius.
constexpr float pieceTurn = 0.1f;
// A path is certainly free while nothing is closer than this [voxels].
constexpr float nearby = 0.5f;
constexpr int maxProbes = 1 << 20;  // along an edge; distant ones are skipped
constexpr float bent = 1.12f;       // length of an arc of a rim over its chord, up to a quarter of the rim
constexpr int maxStrides = 64;      // of a path near a surface; a longer path counts as a hit

/// Transforms a field's coordinates into those of a surface at some time of the step.
struct Moment {
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

Frame frameOf(const Part& part, const btTransform& object) {
    const btTransform here = object * part.local;
    if (part.shape->getShapeType() != FAST_CONCAVE_MESH_PROXYTYPE) return {toPose(here), 1};
    const Placed placed = static_cast<const Shape*>(part.shape)->placed(here);
    return {placed.pose, placed.scale};
}

/// @param touch  in the coordinates of the surface
Impact inWorld(const Impact& touch, const Part& obstacle, const BodySweep& its) {
    const Frame frame = frameOf(obstacle, its.at(touch.time));
    return {touch.time, frame.pose.toWorld(frame.scale * touch.place), frame.pose.rotation * touch.normal};
}

/// Moments from start to end, so close together that the paths between them are straight.
std::vector<Moment> momentsOf(const Part& points, const BodySweep& its, const Part& obstacle, const BodySweep& others) {
    const int pieces = std::max(1, int(std::ceil((its.turn() + others.turn()) / pieceTurn)));
    std::vector<float> times{its.part(), others.part()};
    for (int i = 0; i <= pieces; ++i) times.push_back(float(i) / float(pieces));
    std::sort(times.begin(), times.end());
    times.erase(std::unique(times.begin(), times.end()), times.end());
    std::vector<Moment> moments;
    for (const float time : times) {
        const Frame from = frameOf(points, its.at(time)), into = frameOf(obstacle, others.at(time));
        const Pose pose = relative(into.pose, from.pose);
        moments.push_back({time, from.scale / into.scale * glm::mat3_cast(pose.rotation), pose.position / into.scale});
    }
    return moments;
}

/// A point of a body, grown by a radius.
struct Ball {
    glm::vec3 place;
    glm::vec3 outward;  ///< outward normal of the body, of unit length; or zero
    float radius = 0;
};

/// Follows points on their paths through a surface.
template <class Obstacle>
class Passage {
  public:
    /// @param voxel  in the surface's units
    Passage(const Obstacle& obstacle, const std::vector<Moment>& moments, float voxel)
        : obstacle_(obstacle), moments_(moments), voxel_(voxel), scale_(glm::length(moments.front().linear[0])) {}

    /// Follows the surface points of a field.
    void follow(const SurfacePoints& points) {
        const auto reject = [&](const glm::vec3& centre, float radius) { return !comesNear(centre, scale_ * radius); };
        points.visit(reject, [&](std::uint32_t, const SurfacePoint& point) { follow({point.position, point.normal}); });
    }

    void follow(const Ball& ball) {
        const auto& [point, outward, radius] = ball;
        const float inward = sunk * voxel_, smaller = std::max(scale_ * radius - inward, 0.f);
        const glm::vec3 inner = point - (inward - scale_ * radius + smaller) / scale_ * outward;
        glm::vec3 from = moments_.front()(inner), aside(0);
        // a point that starts inside may move on at its depth
        if (obstacle_.entry(from, from, smaller)) {
            const auto out = obstacle_.wayOut(from, smaller);
            if (!out) return;
            aside = *out;
        }
        from += aside;
        std::optional<Entry> entered;
        for (std::size_t i = 0; i + 1 < moments_.size() && moments_[i].time < first_.time; ++i) {
            const glm::vec3 to = moments_[i + 1](inner) + aside;
            if (!entered) entered = obstacle_.entry(from, to, smaller);
            if (entered) {
                const auto depth = [&](const glm::vec3& at) {
                    return glm::dot(entered->position - at, entered->normal) + smaller;
                };
                const float before = depth(from), after = depth(to), deepest = allowed * voxel_;
                if (after > deepest) {
                    // back to the contact of its own surface
                    const glm::vec3 out = moments_[i].linear * outward / scale_;
                    const float touching = std::min(inward * glm::dot(out, entered->normal), 0.f);
                    const float part = (touching - before) / (after - before);
                    const float time = moments_[i].time + part * (moments_[i + 1].time - moments_[i].time);
                    first_ = {std::clamp(time, 0.f, first_.time), entered->position - aside, entered->normal};
                    return;
                }
                if (after < 0) entered.reset();
            }
            from = to;
        }
    }

    /// Follows the points of an edge, ends excluded.
    /// @param ballAt   (float part) -> Ball
    /// @param length   between its ends
    /// @param spacing  of the field that is met, in the same units
    template <class BallAt>
    void followEdge(float length, float spacing, const BallAt& ballAt) {
        const int parts = probeIntervals(length, spacing, maxProbes);
        const float radius = std::max(ballAt(0.f).radius, ballAt(1.f).radius);
        followBetween(0, parts, bent * length / float(parts), radius,
                      [&](int i) { return ballAt(float(i) / float(parts)); });
    }

    /// The first impact, in the surface's coordinates.
    const Impact& first() const { return first_; }

  private:
    /// Follows the points with numbers in between, if any of them may come near.
    /// @param length, radius  from one point to the next, and of the largest point
    template <class BallAt>
    void followBetween(int from, int to, float length, float radius, const BallAt& ballAt) {
        if (to - from < 2) return;
        const int middle = from + (to - from) / 2;
        const Ball ball = ballAt(middle);
        if (!comesNear(ball.place, scale_ * (float(to - middle) * length + radius))) return;
        follow(ball);
        followBetween(from, middle, length, radius, ballAt);
        followBetween(middle, to, length, radius, ballAt);
    }

    bool comesNear(const glm::vec3& centre, float radius) const {
        for (std::size_t i = 0; i + 1 < moments_.size() && moments_[i].time < first_.time; ++i)
            if (isNear(moments_[i](centre), moments_[i + 1](centre), radius)) return true;
        return false;
    }

    bool isNear(const glm::vec3& from, const glm::vec3& to, float radius) const {
        if constexpr (std::is_same_v<Obstacle, TriangleSurface>) {
            return obstacle_.isNear(from, to, radius);
        } else {
            const float length = glm::distance(from, to), near = nearby * voxel_;
            float gone = 0;
            for (int i = 0; i < maxStrides && gone <= length; ++i) {
                const glm::vec3 at = length > 0 ? from + gone / length * (to - from) : from;
                const float left = obstacle_.bound(at) - radius;
                if (left < near) return true;
                gone += left;
            }
            return gone <= length;
        }
    }

    const Obstacle& obstacle_;
    const std::vector<Moment>& moments_;
    float voxel_, scale_;
    Impact first_;
};

template <class Obstacle>
Impact passageOf(const Shape& field, const Obstacle& obstacle, const std::vector<Moment>& moments, float voxel) {
    Passage timeOfImpact(obstacle, moments, voxel);
    timeOfImpact.follow(field.collider().data().points());
    return timeOfImpact.first();
}

/// Follows the vertices and edges of a convex body, grown by its radius.
Impact passageOf(const Convex& convex, const Shape& field, const std::vector<Moment>& moments) {
    const FieldSurface obstacle(field.collider().field());
    Passage timeOfImpact(obstacle, moments, field.voxelSize() / field.scale());
    const auto ballAt = [](const glm::vec3& point, float radius) {
        const float length = glm::length(point);
        return Ball{point, length > 0 ? point / length : glm::vec3(0), radius};
    };
    const auto vertices = convex.vertices();
    for (std::uint32_t i = 0; i < vertices.size(); ++i) timeOfImpact.follow(ballAt(vertices[i], convex.radius(i)));
    for (const Convex::Edge& edge : convex.edges())
        timeOfImpact.followEdge(
            glm::distance(vertices[edge.from], vertices[edge.to]), field.voxelSize(),
            [&](float part) { return ballAt(convex.place(edge, part), convex.radius(edge, part)); });
    return timeOfImpact.first();
}

/// Follows the sharp features of the triangles along a field's path.
/// @param ways, moments  of the field into the mesh, and of the mesh into the field
Impact passageOf(const btConcaveShape& mesh, const Shape& field, const std::vector<Moment>& ways,
                 const std::vector<Moment>& moments) {
    const Bounds& bounds = field.collider().bounds();
    std::vector<glm::vec3> way;
    for (const Moment& moment : ways) way.push_back(moment(bounds.centre()));
    const float radius = 0.5f * field.scale() * glm::length(bounds.size());
    const SharpTriangles sharp = sharpOf(trianglesAlong(mesh, way, radius));
    const FieldSurface obstacle(field.collider().field());
    Passage timeOfImpact(obstacle, moments, field.voxelSize() / field.scale());
    for (const SharpTriangles::Corner& corner : sharp.corners) timeOfImpact.follow({corner.place, corner.outward});
    for (const SharpTriangles::Side& side : sharp.sides)
        timeOfImpact.followEdge(glm::distance(side.from, side.to), field.voxelSize(), [&](float part) {
            return Ball{glm::mix(side.from, side.to, part), side.outward};
        });
    return timeOfImpact.first();
}

}  // namespace

Impact timeOfImpact(const Part& part, const BodySweep& its, const Part& other, const BodySweep& others) {
    const Shape& field = *part.field();
    const std::vector<Moment> moments = momentsOf(part, its, other, others);
    const float voxel = field.voxelSize();
    const int type = other.shape->getShapeType();
    const auto into = [&](const auto& obstacle, float its) {
        return inWorld(passageOf(field, obstacle, moments, its), other, others);
    };
    if (const Shape* second = other.field())
        return into(FieldSurface(second->collider().field()), std::min(voxel, second->voxelSize()) / second->scale());
    if (type == STATIC_PLANE_PROXYTYPE)
        return into(PlaneSurface(static_cast<const btStaticPlaneShape&>(*other.shape)), voxel);
    if (other.shape->isConvex()) {
        const Convex convex(static_cast<const btConvexShape&>(*other.shape));
        const Impact touch = passageOf(convex, field, momentsOf(other, others, part, its));
        return earlier(into(ConvexSurface(convex, 0.1f * allowed * voxel), voxel), inWorld(touch, part, its).turned());
    }
    if (!other.shape->isConcave() || type == GIMPACT_SHAPE_PROXYTYPE || type == FAST_CONCAVE_MESH_PROXYTYPE) return {};
    const auto& mesh = static_cast<const btConcaveShape&>(*other.shape);
    const Impact touch = passageOf(mesh, field, moments, momentsOf(other, others, part, its));
    return earlier(into(TriangleSurface(mesh), voxel), inWorld(touch, part, its).turned());
}

}  // namespace bilayer::bullet::detail
