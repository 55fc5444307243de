#include "integration/bullet/narrow.h"

#include <BulletCollision/CollisionShapes/btTriangleCallback.h>
#include <LinearMath/btAabbUtil2.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <optional>

#include "integration/bullet/convert.h"

namespace bilayer::bullet {

namespace {

// Distance between probes along an edge [voxels], like that of the surface points.
constexpr float probeSpacing = 2;
// On the medial axis the interpolated gradient is short and says nothing of a direction.
constexpr float shortestGradient = 0.5f;
// A surface point touches a face that looks against its own normal, by this cosine at least: the points below the edge
// of a box must not be pushed out sideways. The corners of a cube, whose normals are mixed of three, reach 0.57.
// Those of faces that do not touch yet: farther aslant is an edge of the other body beside them.
constexpr ContactOptions opposition{.leastOpposition = 0.3f, .leastOppositionApart = 0.9f};
// Steps towards the deepest place of a round surface; each divides the error by the ratio of the radii of curvature.
constexpr int mostRefinements = 6;
// A way has met a convex body where it is this near to it [voxels]; it is followed for so many steps of what is clear.
constexpr float sweepTolerance = 0.1f;
constexpr int mostSteps = 64;
// By less than this a way only grazes, and goes past [voxels].
constexpr float grazing = 0.25f;

/// A field in metres of the world and the axes of its body, and how another body moves towards it.
class Local {
  public:
    Local(const Placed& field, const Pose& other, const Motion& motion)
        : field_(field.collider.field()),
          scale_(field.scale),
          pose_(field.pose),
          ways_(other, motion, field.pose, field.motion) {
        const Bounds& bounds = field.collider.bounds();
        longestWay_ = ways_.longest(scale_ * bounds.centre(), 0.5f * scale_ * glm::length(bounds.size()));
    }

    /// Of the other body's points as the field sees them.
    const RelativeWays& ways() const { return ways_; }
    /// The longest way of any that is in the field's box; those that come from afar may go farther by their turn.
    float longestWay() const { return longestWay_; }

    struct Answer {
        enum { near, outside, inside, unclear } where = unclear;
        float distance = 0;   ///< [m]
        glm::vec3 normal{0};  ///< of unit length if near
    };

    Answer at(const glm::vec3& point) const {
        const Sample sample = field_.sample(point / scale_);
        if (!sample.inBand)
            return {sample.distance > 0 ? Answer::outside : Answer::inside, scale_ * sample.distance, {}};
        const float length = glm::length(sample.gradient);
        if (length < shortestGradient) return {Answer::unclear, scale_ * sample.distance, {}};
        return {Answer::near, scale_ * sample.distance, sample.gradient / length};
    }

    /// The contact of a point of the other body's core, grown by a radius.
    std::optional<Contact> probe(const glm::vec3& point, float radius, std::uint32_t feature, float margin,
                                 ContactReport& report) const {
        ++report.pointsTested;
        const Answer answer = at(point);
        if (answer.where == Answer::inside) ++report.beyondBand;
        if (answer.distance - radius > margin) return probeOnWay(point, radius, feature, margin, answer.distance);
        if (answer.where != Answer::near) return std::nullopt;
        return contact(point - answer.distance * answer.normal, answer.normal, answer.distance - radius, feature,
                       approach(point, answer.normal, margin));
    }

    /// Contact::approach of the other body's point.
    float approach(const glm::vec3& point, const glm::vec3& normal, float margin) const {
        return longestWay_ > margin ? std::max(-glm::dot(ways_.of(point), normal), 0.f) : 0;
    }

    Contact contact(const glm::vec3& position, const glm::vec3& normal, float distance, std::uint32_t feature,
                    float approach = 0) const {
        return {pose_.toWorld(position), pose_.rotation * normal, distance, feature, approach};
    }

  private:
    /// The same for a point that is farther away: where its way meets the surface.
    std::optional<Contact> probeOnWay(const glm::vec3& point, float radius, std::uint32_t feature, float margin,
                                      float distance) const {
        if (longestWay_ <= margin) return std::nullopt;
        const glm::vec3 way = ways_.of(point);
        const float length = glm::length(way);
        if (distance - radius > length) return std::nullopt;
        const Ray ray{point / scale_, way, length / scale_};
        const auto hit = radius > 0 ? field_.sphereCast(ray, radius / scale_) : field_.raycast(ray);
        if (!hit) return std::nullopt;
        const float gap = glm::dot(point - scale_ * hit->position, hit->normal);
        return contact(point - gap * hit->normal, hit->normal, std::max(gap - radius, 0.f), feature,
                       -glm::dot(way, hit->normal));
    }

    const Field& field_;
    float scale_;
    Pose pose_;
    RelativeWays ways_;
    float longestWay_;
};

/// A convex body in the coordinates of a Local field.
class Touching {
  public:
    Touching(const Convex& convex, const Pose& pose, const Motion& motion, const Placed& field, float margin)
        : convex_(convex),
          local_(field, pose, motion),
          margin_(margin),
          scale_(field.scale),
          voxel_(field.scale * field.collider.field().voxelSize()) {
        const Pose inField = relative(field.pose, pose);
        toField_ = glm::mat3(inField.rotation);
        toConvex_ = glm::transpose(toField_);
        origin_ = inField.position;
    }

    bool reject(const glm::vec3& centre, float radius) const {
        const float reach = scale_ * radius + margin_ + local_.longestWay();
        return convex_.nearest(intoConvex(scale_ * centre), reach).distance > reach;
    }

    /// A surface point against the convex body's formula.
    void visit(std::uint32_t index, const SurfacePoint& point, ContactReport& report,
               std::vector<Contact>& contacts) const {
        ++report.pointsTested;
        const glm::vec3 position = scale_ * point.position;
        const std::uint32_t feature = index | featureOfB;
        const Convex::Near near = convex_.nearest(intoConvex(position), margin_);
        if (near.distance > margin_) return visitOnWay(position, point, feature, near.distance, contacts);
        const glm::vec3 normal = -(toField_ * near.normal);
        float approach = local_.approach(position, normal, margin_);
        if (near.distance > 0 && approach > 0 && !meets(position, point)) approach = 0;
        const bool apart = near.distance > 0 && approach == 0 && !point.isSharp;
        if (!opposition.keeps(glm::dot(normal, point.normal), apart)) return;
        if (convex_.isCurved())
            if (const auto better = refine(near, feature)) {
                contacts.push_back(*better);
                return;
            }
        contacts.push_back(local_.contact(position, normal, near.distance, feature, approach));
    }

    void visitProbes(const Bounds& bounds, float spacing, ContactReport& report, std::vector<Contact>& contacts) const {
        const float within =
            0.5f * glm::length(scale_ * bounds.size()) + convex_.radius() + margin_ + local_.longestWay();
        const auto ask = [&](const glm::vec3& point, std::uint32_t number) {
            if (const auto contact = local_.probe(intoField(point), convex_.radius(), number, margin_, report))
                contacts.push_back(*contact);
        };
        convex_.visitProbes(intoConvex(scale_ * bounds.centre()), within, spacing, ask);
    }

  private:
    glm::vec3 intoConvex(const glm::vec3& point) const { return toConvex_ * (point - origin_); }
    glm::vec3 intoField(const glm::vec3& point) const { return toField_ * point + origin_; }

    /// Where a way meets the convex body.
    struct Meeting {
        glm::vec3 normal;  ///< of the convex body, in its own coordinates
        float gap;         ///< from the start to the plane that is met [m]
    };

    /// @param start, way  in the convex body's coordinates
    std::optional<Meeting> meeting(const glm::vec3& start, const glm::vec3& way) const {
        const float length = glm::length(way), touch = sweepTolerance * voxel_;
        float gone = 0;
        for (int i = 0; i < mostSteps; ++i) {
            const Convex::Near near = convex_.nearest(start + gone / length * way, length);
            if (near.distance <= touch) return Meeting{near.normal, -glm::dot(near.normal, gone / length * way)};
            gone += near.distance;
            if (gone > length) break;
        }
        return std::nullopt;
    }

    glm::vec3 wayIntoConvex(const glm::vec3& position) const { return -(toConvex_ * local_.ways().of(position)); }

    /// Whether a surface point's way does more than graze the convex body (see collide()).
    bool meets(const glm::vec3& position, const SurfacePoint& point) const {
        const glm::vec3 way = wayIntoConvex(position), normal = toConvex_ * point.normal;
        const glm::vec3 across = normal - glm::dot(normal, way) / glm::dot(way, way) * way;
        return meeting(intoConvex(position) - grazing * voxel_ * across, way).has_value();
    }

    /// The same as visit() for a point that is farther away.
    void visitOnWay(const glm::vec3& position, const SurfacePoint& point, std::uint32_t feature, float distance,
                    std::vector<Contact>& contacts) const {
        if (local_.longestWay() <= margin_) return;
        const glm::vec3 way = wayIntoConvex(position);
        if (distance > glm::length(way) || !meets(position, point)) return;
        const auto met = meeting(intoConvex(position), way);
        if (!met || !(met->gap > 0)) return;
        const glm::vec3 normal = -(toField_ * met->normal);
        if (opposition.keeps(glm::dot(normal, point.normal), false))
            contacts.push_back(local_.contact(position, normal, met->gap, feature, -glm::dot(met->normal, way)));
    }

    /// Follows the field's normal from the place of a round surface under a surface point to the deepest place nearby.
    std::optional<Contact> refine(const Convex::Near& near, std::uint32_t feature) const {
        glm::vec3 place = intoField(near.core + convex_.radius() * near.normal);
        Local::Answer here = local_.at(place);
        if (here.where != Local::Answer::near) return std::nullopt;
        for (int i = 0; i < mostRefinements; ++i) {
            const glm::vec3 next = intoField(convex_.slide(near, -(toConvex_ * here.normal)));
            const Local::Answer there = local_.at(next);
            if (there.where != Local::Answer::near || !(there.distance < here.distance)) break;
            place = next;
            here = there;
        }
        if (here.distance > margin_) return std::nullopt;
        return local_.contact(place - here.distance * here.normal, here.normal, here.distance, feature,
                              local_.approach(place, here.normal, margin_));
    }

    const Convex& convex_;
    Local local_;
    float margin_, scale_, voxel_;
    glm::mat3 toField_, toConvex_;
    glm::vec3 origin_;
};

/// Triangles as Bullet hands them over, one by one.
class TriangleProbes : public btTriangleCallback {
  public:
    TriangleProbes(const btTransform& transform, const Motion& motion, const Placed& field, float margin,
                   ContactReport& report, std::vector<Contact>& contacts)
        : inField_(relative(field.pose, toPose(transform))),
          field_(field),
          local_(field, toPose(transform), motion),
          margin_(margin),
          reach_(std::max(margin, field.scale * field.collider.field().interiorWidth()) + local_.longestWay()),
          spacing_(probeSpacing * field.scale * field.collider.field().voxelSize()),
          report_(report),
          contacts_(contacts) {
        const Bounds& bounds = field.collider.bounds();
        centre_ = field.scale * bounds.centre();
        within_ = 0.5f * field.scale * glm::length(bounds.size()) + margin + local_.longestWay();
    }

    /// Triangles farther than this from the field's box are of no interest [m].
    float room() const { return margin_ + local_.longestWay(); }

    void processTriangle(btVector3* triangle, int, int) override {
        const glm::vec3 corners[3] = {inField_.toWorld(toGlm(triangle[0])), inField_.toWorld(toGlm(triangle[1])),
                                      inField_.toWorld(toGlm(triangle[2]))};
        const glm::vec3 middle = (corners[0] + corners[1] + corners[2]) / 3.f;
        float around = 0, longest = 0;
        for (int i = 0; i < 3; ++i) {
            around = std::max(around, glm::distance(corners[i], middle));
            longest = std::max(longest, glm::distance(corners[i], corners[(i + 1) % 3]));
        }
        if (local_.at(middle).distance > around + room() + spacing_) return;
        for (int i = 0; i < 3; ++i) {
            probe(corners[i], 0);
            visitAlong(corners[i], corners[(i + 1) % 3], centre_, within_, spacing_,
                       [&](const glm::vec3& point, std::uint32_t) { probe(point, 0); });
        }
        if (longest > spacing_) visitFace(corners);
    }

  private:
    void probe(const glm::vec3& point, std::uint32_t feature) {
        if (const auto contact = local_.probe(point, 0, feature, margin_, report_)) contacts_.push_back(*contact);
    }

    /// Asks the field at the feet of its own surface points on the triangle: a bump finds a large face.
    void visitFace(const glm::vec3 (&corners)[3]) {
        const float scale = field_.scale;
        const auto foot = [&](const glm::vec3& point) {
            return nearestOnTriangle(scale * point, corners[0], corners[1], corners[2]);
        };
        const auto reject = [&](const glm::vec3& centre, float radius) {
            return glm::distance(foot(centre), scale * centre) > scale * radius + reach_;
        };
        field_.collider.points().visit(reject, [&](std::uint32_t index, const SurfacePoint& point) {
            const glm::vec3 below = foot(point.position);
            if (glm::distance(below, scale * point.position) <= reach_) probe(below, index | featureOfB);
        });
    }

    Pose inField_;  ///< of the mesh
    const Placed& field_;
    Local local_;
    float margin_, reach_, spacing_;
    glm::vec3 centre_;
    float within_;
    ContactReport& report_;
    std::vector<Contact>& contacts_;
};

}  // namespace

ContactReport collideFields(const Placed& a, const Placed& b, float margin, NearPoints& near,
                            std::vector<Contact>& contacts) {
    ContactOptions options = opposition;
    options.margin = margin;
    return collide(a, b, options, contacts, &near);
}

ContactReport collideFields(const Placed& a, const Placed& b, float margin, std::span<const FoundPoint> ofA,
                            std::span<const FoundPoint> ofB, std::vector<Contact>& contacts) {
    ContactOptions options = opposition;
    options.margin = margin;
    return collideFound(a, b, options, ofA, ofB, contacts);
}

ContactReport collidePlane(const glm::vec3& normal, float offset, const Motion& motion, const Placed& field,
                           float margin, std::vector<Contact>& contacts) {
    ContactReport report;
    // The plane in the collider's own coordinates.
    const glm::vec3 up = glm::conjugate(field.pose.rotation) * normal;
    const float height = (offset - glm::dot(normal, field.pose.position)) / field.scale;
    const float reach = margin / field.scale;
    const Local local(field, {}, motion);
    const auto above = [&](const glm::vec3& point) { return glm::dot(up, point) - height; };
    const auto reject = [&](const glm::vec3& centre, float radius) {
        return above(centre) - radius > reach + local.longestWay() / field.scale;
    };
    field.collider.points().visit(reject, [&](std::uint32_t index, const SurfacePoint& point) {
        ++report.pointsTested;
        const float distance = above(point.position);
        // the plane's own points come up to this one
        const float approach = local.approach(field.scale * point.position, -up, margin) / field.scale;
        if (distance > std::max(reach, approach)) return;
        const glm::vec3 position = field.pose.toWorld(field.scale * point.position);
        contacts.push_back({position, -normal, field.scale * distance, index | featureOfB, field.scale * approach});
    });
    return report;
}

ContactReport collideConvex(const Convex& convex, const Pose& pose, const Motion& motion, const Placed& field,
                            float margin, std::vector<Contact>& contacts) {
    ContactReport report;
    const Touching touching(convex, pose, motion, field, margin);
    field.collider.points().visit(
        [&](const glm::vec3& centre, float radius) { return touching.reject(centre, radius); },
        [&](std::uint32_t index, const SurfacePoint& point) { touching.visit(index, point, report, contacts); });
    const float spacing = probeSpacing * field.scale * field.collider.field().voxelSize();
    touching.visitProbes(field.collider.bounds(), spacing, report, contacts);
    return report;
}

ContactReport collideTriangles(const btConcaveShape& mesh, const btTransform& transform, const Motion& motion,
                               const Placed& field, float margin, std::vector<Contact>& contacts) {
    ContactReport report;
    TriangleProbes probes(transform, motion, field, margin, report, contacts);
    const Pose inMesh = relative(toPose(transform), field.pose);
    const Bounds& bounds = field.collider.bounds();
    btVector3 lower, upper;
    const btTransform place(toBullet(inMesh.rotation), toBullet(inMesh.toWorld(field.scale * bounds.centre())));
    btTransformAabb(toBullet(0.5f * field.scale * bounds.size()), probes.room(), place, lower, upper);
    mesh.processAllTriangles(&probes, lower, upper);
    return report;
}

}  // namespace bilayer::bullet
