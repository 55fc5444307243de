// Contacts between a field and convex shapes.
// Tested by tests/bullet/edges.cpp.
#include <bilayer/collider/contact.h>
#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <limits>
#include <optional>

#include "collider/contact/collider_data.h"
#include "collider/contact/edge_search.h"
#include "collider/contact/normal_filter.h"
#include "collider/contact/surface_query.h"
#include "integration/bullet/detail/local_field.h"
#include "integration/bullet/detail/narrow_phase.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

namespace {

// Iterations towards the deepest point of a curved surface; each reduces the error by the ratio of the radii of
// curvature.
constexpr int maxRefinements = 6;
// Faces with a smaller slope lie flat on the other surface: the next surface points are as deep to 0.01 voxels.
constexpr float minDownhill = 0.05f;
constexpr float touchingFace = 0.25f;  // [voxels]
// Normals within one degree belong to one face (cosine).
constexpr float straight = 0.99985f;
// A path meets a convex body at this distance [voxels]; a larger tolerance would hit edges that the path passes.
constexpr float sweepTolerance = 1e-3f;

/// A convex body in the coordinates of a field.
class Touching {
  public:
    Touching(const Convex& convex, const Pose& pose, const Motion& motion, const Placed& field, float margin,
             bool measured)
        : convex_(convex),
          local_(field, pose, motion, margin, measured),
          margin_(margin),
          measured_(measured),
          scale_(field.scale),
          voxel_(field.scale * field.collider.field().voxelSize()) {
        const Pose inField = relative(field.pose, pose);
        toField_ = glm::mat3(inField.rotation);
        toConvex_ = glm::transpose(toField_);
        origin_ = inField.position;
        // the deepest point of an edge is within half its length of one of its ends
        if (convex.isCurved()) edgeReach_ += 0.5f * scale_ * field.collider.data().edges().longest();
    }

    bool reject(const glm::vec3& centre, float radius) const {
        const float way = local_.relativeMotion().longest(scale_ * centre, scale_ * radius);
        const float reach = scale_ * radius + std::max(edgeReach_, margin_ + way);
        return convex_.nearest(intoConvex(scale_ * centre), reach).distance > reach;
    }

    /// Tests a surface point against the closed form of the convex body.
    void visit(std::uint32_t index, const SurfacePoint& point, ContactReport& report,
               std::vector<Contact>& contacts) const {
        ++report.pointsTested;
        const glm::vec3 position = scale_ * point.position;
        const std::uint32_t feature = index | featureOfB;
        const Convex::Near near = convex_.nearest(intoConvex(position), edgeReach_);
        if (convex_.isCurved() && point.isSharp && near.distance <= edgeReach_) followEdges(index, near, contacts);
        if (near.distance > margin_) return visitOnWay(position, point, feature, near.distance, contacts);
        const glm::vec3 normal = -(toField_ * near.normal);
        float approach = local_.approach(position, normal, margin_);
        if (near.distance > 0 && approach > 0 && !meets(position, point)) approach = 0;
        // A curved surface has no edge that a point could see at an oblique angle.
        const bool apart = near.distance > 0 && !point.isSharp && !convex_.isRound(near) && !measured_;
        if (!keeps({}, -normal, point.normal, -local_.relativeMotion().rotation(), apart)) return;
        if (apart && approach == 0 &&
            seesEdgeObliquely(intoConvex(position), toConvex_ * point.normal, near.distance, near.normal,
                              [&](const glm::vec3& place) { return convex_.nearest(place, edgeReach_).normal; }))
            return;
        if (!convex_.isFlat(near)) {
            // vertices and edges are exact, and samples next to them are not
            const auto better = refine(near, feature);
            if (better && !(point.isSharp && near.distance < better->distance)) {
                contacts.push_back(*better);
                return;
            }
        } else if (!point.isSharp) {
            const glm::vec3 place = intoField(near.core + near.radius * near.normal);
            if (auto deeper = downhill(near, place, local_.at(place))) {
                deeper->feature = feature;
                deeper->turningRadius = 0;
                contacts.push_back(*deeper);
                return;
            }
        }
        contacts.push_back(local_.contact(position, normal, near.distance, feature, approach));
        contacts.back().turningRadius = 0;
    }

    /// Tests the convex body's own vertices and edges in the field.
    void visitProbes(ContactReport& report, std::vector<Contact>& contacts) const {
        const auto corners = convex_.corners();
        std::vector<LocalField::Answer> answers;
        for (std::uint32_t i = 0; i < corners.size(); ++i) {
            const glm::vec3 point = intoField(corners[i]);
            answers.push_back(local_.at(point, convex_.radius(i)));
            if (const auto found = local_.probe(point, answers[i], convex_.radius(i), i, margin_, report))
                contacts.push_back(*found);
        }
        auto number = static_cast<std::uint32_t>(corners.size());
        for (const Convex::Edge& edge : convex_.edges()) {
            LocalField::Edge seen{[&](float part) { return intoField(convex_.place(edge, part)); },
                                  {convex_.radius(edge, 0), convex_.radius(edge, 1)},
                                  !(edge.rim > 0),
                                  number,
                                  edge.conormals};
            if (edge.conormals)
                seen.conormals = Conormals{toField_ * (*edge.conormals)[0], toField_ * (*edge.conormals)[1]};
            local_.probeEdge(seen, answers[edge.from], answers[edge.to], margin_, report, contacts);
            number = (number + (2u << partBits)) & ~featureOfB;
        }
    }

  private:
    glm::vec3 intoConvex(const glm::vec3& point) const { return toConvex_ * (point - origin_); }
    glm::vec3 intoField(const glm::vec3& point) const { return toField_ * point + origin_; }

    /// The entry of a path into the convex body, both in the convex body's coordinates.
    std::optional<Convex::Entry> meeting(const glm::vec3& start, const glm::vec3& way) const {
        return convex_.enter(start, way, sweepTolerance * voxel_);
    }

    glm::vec3 wayIntoConvex(const glm::vec3& position) const {
        return -(toConvex_ * local_.relativeMotion().of(position));
    }

    /// Whether a surface point's path does more than graze the convex body (see collide()).
    bool meets(const glm::vec3& position, const SurfacePoint& point) const {
        const glm::vec3 way = wayIntoConvex(position), normal = toConvex_ * point.normal;
        const glm::vec3 across = normal - glm::dot(normal, way) / glm::dot(way, way) * way;
        return meeting(intoConvex(position) - grazingTolerance * voxel_ * across, way).has_value();
    }

    /// visit() for a point that is farther away.
    void visitOnWay(const glm::vec3& position, const SurfacePoint& point, std::uint32_t feature, float distance,
                    std::vector<Contact>& contacts) const {
        if (local_.longestWay() <= margin_) return;
        const glm::vec3 way = wayIntoConvex(position);
        if (distance > glm::length(way) || !meets(position, point)) return;
        const auto met = meeting(intoConvex(position), way);
        if (!met) return;
        // separation from the tangent plane at the entry
        const float gap = -glm::dot(met->near.normal, met->part * way);
        if (!(gap > 0)) return;
        const glm::vec3 normal = -(toField_ * met->near.normal);
        const bool apart = !point.isSharp && !convex_.isRound(met->near);
        if (!keeps({}, -normal, point.normal, -local_.relativeMotion().rotation(), apart)) return;
        contacts.push_back(local_.contact(position, normal, gap, feature, -glm::dot(met->near.normal, way)));
        contacts.back().turningRadius = 0;
    }

    /// Follows sharp edges of the field from a touching point: adds the deepest point of each edge that descends into a
    /// curved body and rises again.
    void followEdges(std::uint32_t index, const Convex::Near& near, std::vector<Contact>& contacts) const {
        const Collider& collider = local_.collider();
        const auto points = collider.data().points().points();
        const SharpEdges& edges = collider.data().edges();
        for (const std::uint32_t e : edges.around(index)) {
            const SharpEdge& edge = edges.edges()[e];
            const std::uint32_t next = edge.from == index ? edge.to : edge.from;
            const glm::vec3 from = intoConvex(scale_ * points[index].position),
                            to = intoConvex(scale_ * points[next].position);
            const float length = glm::distance(from, to);
            const glm::vec3 along = (to - from) / length;
            const auto nearAt = [&](float way) { return convex_.nearest(from + way * along, edgeReach_); };
            const auto slopeOf = [&](float way, const Convex::Near& there) {
                return Slope{way, there.distance, glm::dot(there.normal, along)};
            };
            const Convex::Near there = nearAt(length);
            const Slope first = slopeOf(0, near), last = slopeOf(length, there);
            // If both ends are within reach, one of them is enough.
            const bool isOther = there.distance <= edgeReach_ && next < index;
            if (!fallsBetween(first, last) || isOther) continue;
            const auto lowest = lowestBetween(first, last, searchTolerance * voxel_, [&](float way) {
                return std::optional<Slope>(slopeOf(way, nearAt(way)));
            });
            const auto touchAt = [&](float way) -> SurfaceSample {
                const Convex::Near near = nearAt(way);
                return {near.distance, near.normal};
            };
            const float aside = 2 * searchTolerance * voxel_;
            const auto touch = acrossEdge(along, touchAt(lowest->place), touchAt(lowest->place - aside),
                                          touchAt(lowest->place + aside));
            if (!touch || touch->distance > margin_) continue;
            const glm::vec3 normal = -(toField_ * touch->normal);
            if (!keeps({}, glm::dot(normal, points[index].normal + points[next].normal), false)) continue;
            const glm::vec3 place = intoField(from + lowest->place * along);
            contacts.push_back(local_.contact(place, normal, touch->distance,
                                              (std::uint32_t(points.size()) + e) | featureOfB,
                                              local_.approach(place, normal, margin_)));
        }
    }

    /// Follows the field's normal from the point of a curved surface under a surface point to the deepest point nearby.
    std::optional<Contact> refine(const Convex::Near& near, std::uint32_t feature) const {
        glm::vec3 place = intoField(near.core + near.radius * near.normal);
        LocalField::Answer here = local_.at(place);
        if (here.where != LocalField::Answer::near) return std::nullopt;
        for (int i = 0; i < maxRefinements; ++i) {
            const glm::vec3 next = intoField(convex_.slide(near, -(toConvex_ * here.normal)));
            const LocalField::Answer there = local_.at(next);
            if (there.where != LocalField::Answer::near || !(there.distance < here.distance)) break;
            place = next;
            here = there;
        }
        std::optional<Contact> found = downhill(near, place, here);
        if (!found && here.distance <= margin_)
            found = local_.contact(place - here.distance * here.normal, here.normal, here.distance, feature,
                                   local_.approach(place, here.normal, margin_));
        if (found) found->feature = feature;
        return found;
    }

    /// Edge descent: the deeper point of a face, or of the generator line on the side of a cylinder or a cone, near a
    /// point on it.
    std::optional<Contact> downhill(const Convex::Near& near, const glm::vec3& place,
                                    const LocalField::Answer& here) const {
        const float step = probeSpacing * scale_ * local_.collider().field().voxelSize();
        const glm::vec3 slope = toConvex_ * here.gradient, start = intoConvex(place);
        glm::vec3 end;
        float least = std::numeric_limits<float>::lowest();
        bool isWithinFace = false;
        if (const auto line = convex_.sideLine(near, start)) {
            const glm::vec3 from = (*line)[0] + near.radius * near.normal, along = (*line)[1] - (*line)[0];
            const float length = glm::length(along), steepness = glm::dot(slope, along) / length;
            if (!(std::abs(steepness) > minDownhill)) return std::nullopt;
            const float middle = glm::dot(start - from, along) / (length * length);
            const float there = std::clamp(middle - std::copysign(step / length, steepness), 0.f, 1.f);
            end = start + (there - middle) * along;
        } else {
            // Where faces touch, points are exact; next to sharp edges the interpolant is not.
            const bool isSmooth = local_.collider().data().edges().edges().empty();
            if (!measured_ && !isSmooth) least = touchingFace * scale_ * local_.collider().field().voxelSize();
            if (!convex_.isFlat(near) || near.distance < least) return std::nullopt;
            const glm::vec3 uphill = slope - glm::dot(slope, near.normal) * near.normal;
            const float steepness = glm::length(uphill);
            if (!(steepness > minDownhill)) return std::nullopt;
            // no farther than the border of the face
            const Convex::Near last = convex_.nearest(start - step / steepness * uphill, step);
            end = last.core + last.radius * near.normal;
            isWithinFace = glm::dot(last.normal, near.normal) > straight;
        }
        const LocalField::Edge way{
            [&, to = intoField(end)](float part) { return glm::mix(place, to, part); }, {0, 0}, true, 0, std::nullopt};
        auto found = local_.deepestBetween(way, 0, here, 1, local_.at(intoField(end)), margin_);
        if (!found || found->distance < least) return std::nullopt;
        // within a face the face's normal counts, on its border the field's
        const Contact border = local_.contact(intoField(end), -(toField_ * near.normal), 0, 0);
        const glm::vec3 onFace = found->position + found->distance * found->normal;
        if (isWithinFace && glm::distance(onFace, border.position) > 2 * searchTolerance * voxel_)
            found->normal = border.normal;
        return found;
    }

    const Convex& convex_;
    LocalField local_;
    float margin_;
    bool measured_;
    float scale_, voxel_;
    float edgeReach_ = margin_;  ///< maximum distance of sharp edges' points that are considered
    glm::mat3 toField_, toConvex_;
    glm::vec3 origin_;
};

}  // namespace

ContactReport collideConvex(const Convex& convex, const Pose& pose, const Motion& motion, const Placed& field,
                            float margin, bool measured, std::vector<Contact>& contacts) {
    ContactReport report;
    const Touching touching(convex, pose, motion, field, margin, measured);
    field.collider.data().points().visit(
        [&](const glm::vec3& centre, float radius) { return touching.reject(centre, radius); },
        [&](std::uint32_t index, const SurfacePoint& point) { touching.visit(index, point, report, contacts); });
    touching.visitProbes(report, contacts);
    return report;
}

}  // namespace bilayer::bullet::detail
