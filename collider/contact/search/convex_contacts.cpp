// SPDX-License-Identifier: Apache-2.0
// Contacts between a field and convex shapes.
#include "collider/contact/search/convex_contacts.h"

#include <bilayer/collider/contact.h>
#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <limits>
#include <optional>

#include "collider/contact/body/collider_data.h"
#include "collider/contact/search/edge_contacts.h"
#include "collider/contact/search/edge_probes.h"
#include "collider/contact/search/edge_search.h"
#include "collider/contact/search/local_field.h"
#include "collider/contact/search/normal_filter.h"
#include "collider/contact/search/surface_query.h"
#include "sdf/base/access.h"

namespace bilayer::detail {

namespace {

// Iterations towards the deepest point of a curved surface; each reduces the error by the ratio of the radii of
// curvature.
constexpr int maxRefinements = 6;
// Faces with a smaller slope lie flat on the other surface: the next surface points are as deep to 0.01 voxels.
constexpr float minDownhill = 0.05f;
constexpr float touchingFace = 0.25f;  // [voxels]
// A path meets a convex body at this distance [voxels]; a larger tolerance would hit edges that the path passes.
constexpr float sweepTolerance = 1e-3f;

/// A convex body in the coordinates of a field.
struct ConvexInField {
    const Convex& convex;
    LocalField local;
    const ContactOptions& options;
    float scale, voxel;
    float edgeReach;  ///< maximum distance of sharp edges' points that are considered
    glm::mat3 toField, toConvex;
    glm::vec3 origin;

    ConvexInField(const Convex& convex, const Pose& pose, const Motion& motion, const Placed& field,
                  const ContactOptions& options)
        : convex(convex),
          local(field, pose, motion, options.margin, options.exact),
          options(options),
          scale(field.scale),
          voxel(field.scale * field.collider.field().voxelSize()),
          edgeReach(options.margin) {
        const Pose inField = relative(field.pose, pose);
        toField = glm::mat3(inField.rotation);
        toConvex = glm::transpose(toField);
        origin = inField.position;
        // the deepest point of an edge is within half its length of one of its ends
        if (convex.isCurved()) edgeReach += 0.5f * scale * dataOf(field.collider).edges().maxLength();
    }

    glm::vec3 intoConvex(const glm::vec3& point) const { return toConvex * (point - origin); }
    glm::vec3 intoField(const glm::vec3& point) const { return toField * point + origin; }
    NearestPoint nearest(const glm::vec3& point) const { return convex.nearest(point, edgeReach); }
    /// The place of the convex surface that is nearest.
    glm::vec3 placeOf(const NearestPoint& nearest) const {
        return intoField(nearest.core + nearest.radius * nearest.normal);
    }
};

/// Finds the deepest points of the sharp edges of a field that descend into a curved body and rise again.
/// @param index, here  a surface point at an end of the edges, and the convex surface there
void followEdges(const ConvexInField& body, std::uint32_t index, const NearestPoint& here,
                 std::vector<Contact>& contacts) {
    const Collider& collider = body.local.collider();
    const auto points = dataOf(collider).points().points();
    const SharpEdges& edges = dataOf(collider).edges();
    for (const std::uint32_t e : edges.around(index)) {
        const SharpEdge& edge = edges.edges()[e];
        const std::uint32_t next = edge.otherEnd(index);
        const glm::vec3 from = body.intoConvex(body.scale * points[index].position),
                        to = body.intoConvex(body.scale * points[next].position);
        const float length = glm::distance(from, to);
        const glm::vec3 along = (to - from) / length;
        const auto sampleAt = [&](float place) -> SurfaceSample {
            const NearestPoint nearest = body.nearest(from + place * along);
            return {nearest.distance, nearest.normal};
        };
        const auto slopeAt = [&](float place) -> std::optional<ValueAndSlope> {
            return slopeAlong(along, place, sampleAt(place));
        };
        const ValueAndSlope first = slopeAlong(along, 0, {here.distance, here.normal}), last = *slopeAt(length);
        // if both ends are within reach, process the edge only once
        const bool isOther = last.value <= body.edgeReach && next < index;
        if (!fallsBetween(first, last) || isOther) continue;
        const auto lowest = deepestBetween(first, last, searchTolerance * body.voxel, slopeAt);
        const auto across = acrossEdge(along, sampleAt(lowest->place), lowest->place, body.voxel, sampleAt);
        if (!across || across->distance > body.options.margin) continue;
        const glm::vec3 normal = -(body.toField * across->normal);
        if (!passesNormalFilter(body.options, glm::dot(normal, points[index].normal + points[next].normal), false))
            continue;
        const glm::vec3 place = body.intoField(from + lowest->place * along);
        contacts.push_back(body.local.contact(place, normal, across->distance,
                                              (std::uint32_t(points.size()) + e) | featureOfB,
                                              body.local.approach(place, normal, body.options.margin)));
    }
}

/// Tests the vertices and edges of a convex body in a field.
void probeFeatures(const ConvexInField& body, ContactReport& report, std::vector<Contact>& contacts) {
    const Convex& convex = body.convex;
    const auto vertices = convex.vertices();
    std::vector<LocalField::FieldSample> samples;
    for (std::uint32_t i = 0; i < vertices.size(); ++i) {
        const glm::vec3 point = body.intoField(vertices[i]);
        samples.push_back(body.local.at(point, convex.radius(i)));
        if (const auto found = body.local.probe(point, samples[i], convex.radius(i), i, body.options.margin, report))
            contacts.push_back(*found);
    }
    const EdgeContacts edges(body.local, body.options.margin);
    auto feature = static_cast<std::uint32_t>(vertices.size());
    for (const Convex::Edge& edge : convex.edges()) {
        ProbedEdge probed{[&](float fraction) { return body.intoField(convex.place(edge, fraction)); },
                          {convex.radius(edge, 0), convex.radius(edge, 1)},
                          !(edge.rim > 0),
                          feature,
                          edge.conormals};
        if (edge.conormals)
            probed.conormals = Conormals{body.toField * (*edge.conormals)[0], body.toField * (*edge.conormals)[1]};
        edges.find(probed, samples[edge.from], samples[edge.to], report, contacts);
        feature = (feature + (2u << probeBits)) & ~featureOfB;
    }
}

/// The surface points of a field on a convex body, which has a closed form.
class PointsOnConvex {
  public:
    explicit PointsOnConvex(const ConvexInField& body) : body_(body), convex_(body.convex), local_(body.local) {}

    /// Finds the contacts of all points, and of the sharp edges between them.
    void visit(ContactReport& report, std::vector<Contact>& contacts) const {
        dataOf(local_.collider())
            .points()
            .visit([&](const glm::vec3& centre, float radius) { return isFar(centre, radius); },
                   [&](std::uint32_t index, const SurfacePoint& point) { test(index, point, report, contacts); });
    }

  private:
    bool isFar(const glm::vec3& centre, float radius) const {
        const float displacement = local_.relativeMotion().maxDisplacement(body_.scale * centre, body_.scale * radius);
        const float reach = body_.scale * radius + std::max(body_.edgeReach, body_.options.margin + displacement);
        return convex_.nearest(body_.intoConvex(body_.scale * centre), reach).distance > reach;
    }

    void test(std::uint32_t index, const SurfacePoint& point, ContactReport& report,
              std::vector<Contact>& contacts) const {
        ++report.pointsTested;
        const glm::vec3 position = body_.scale * point.position;
        const std::uint32_t feature = index | featureOfB;
        const NearestPoint nearest = body_.nearest(body_.intoConvex(position));
        if (convex_.isCurved() && point.isSharp && nearest.distance <= body_.edgeReach)
            followEdges(body_, index, nearest, contacts);
        if (nearest.distance > body_.options.margin)
            return testSpeculative(position, point, feature, nearest.distance, contacts);
        const glm::vec3 normal = -(body_.toField * nearest.normal);
        float approach = local_.approach(position, normal, body_.options.margin);
        if (nearest.distance > 0 && approach > 0 && isGrazing(position, point)) approach = 0;
        // A curved surface has no edge that a point could face obliquely.
        const bool isSeparated = nearest.distance > -minFaceDepthVoxels * body_.voxel && !point.isSharp &&
                                 !convex_.isRound(nearest) && !body_.options.exact;
        const auto facesEdge = [&] {
            const auto holdsAt = [&](const glm::vec3& place, auto&& test) { return test(body_.nearest(place).normal); };
            return facesEdgeObliquely(body_.intoConvex(position), body_.toConvex * point.normal, nearest.distance,
                                      nearest.normal, holdsAt);
        };
        if (!passesNormalFilter(body_.options, -normal, point.normal, -local_.relativeMotion().rotation(), isSeparated,
                                facesEdge))
            return;
        if (!convex_.isFlat(nearest)) {
            // vertices and edges are exact, and samples next to them are not
            const auto better = refine(nearest, feature);
            if (better && !(point.isSharp && nearest.distance < better->distance)) {
                contacts.push_back(*better);
                return;
            }
        } else if (!point.isSharp) {
            const glm::vec3 place = body_.placeOf(nearest);
            if (auto deeper = descend(nearest, place, local_.at(place))) {
                deeper->feature = feature;
                deeper->roundingRadius = 0;
                contacts.push_back(*deeper);
                return;
            }
        }
        contacts.push_back(local_.contact(position, normal, nearest.distance, feature, approach, 0));
    }

    /// The first point of a path within the convex body, both in the convex body's coordinates.
    std::optional<Convex::PathHit> castPoint(const glm::vec3& start, const glm::vec3& displacement) const {
        return convex_.castPoint(start, displacement, sweepTolerance * body_.voxel);
    }

    glm::vec3 displacementIntoConvex(const glm::vec3& position) const {
        return -(body_.toConvex * local_.relativeMotion().of(position));
    }

    /// Whether a surface point's path only grazes the convex body, or misses it.
    bool isGrazing(const glm::vec3& position, const SurfacePoint& point) const {
        const glm::vec3 displacement = displacementIntoConvex(position), normal = body_.toConvex * point.normal;
        const glm::vec3 start = grazingTestStart(body_.intoConvex(position), normal, displacement, body_.voxel);
        return !castPoint(start, displacement).has_value();
    }

    /// test() for a point that is farther away.
    void testSpeculative(const glm::vec3& position, const SurfacePoint& point, std::uint32_t feature, float distance,
                         std::vector<Contact>& contacts) const {
        if (local_.maxDisplacement() <= body_.options.margin) return;
        const glm::vec3 displacement = displacementIntoConvex(position);
        if (distance > glm::length(displacement) || isGrazing(position, point)) return;
        const auto hit = castPoint(body_.intoConvex(position), displacement);
        if (!hit) return;
        // separation from the tangent plane at the entry
        const float separation = -glm::dot(hit->nearest.normal, hit->fraction * displacement);
        if (!(separation > 0)) return;
        const glm::vec3 normal = -(body_.toField * hit->nearest.normal);
        const bool isSeparated = !point.isSharp && !convex_.isRound(hit->nearest);
        if (!passesNormalFilter(body_.options, -normal, point.normal, -local_.relativeMotion().rotation(), isSeparated))
            return;
        contacts.push_back(
            local_.contact(position, normal, separation, feature, -glm::dot(hit->nearest.normal, displacement), 0));
    }

    /// Follows the field's normal from the point of a curved surface under a surface point to the deepest point nearby.
    std::optional<Contact> refine(const NearestPoint& nearest, std::uint32_t feature) const {
        glm::vec3 place = body_.placeOf(nearest);
        LocalField::FieldSample here = local_.at(place);
        if (here.where != LocalField::FieldSample::nearSurface) return std::nullopt;
        for (int i = 0; i < maxRefinements; ++i) {
            const glm::vec3 next = body_.intoField(convex_.supportNear(nearest, -(body_.toConvex * here.normal)));
            const LocalField::FieldSample there = local_.at(next);
            if (there.where != LocalField::FieldSample::nearSurface || !(there.distance < here.distance)) break;
            place = next;
            here = there;
        }
        std::optional<Contact> found = descend(nearest, place, here);
        if (!found && here.distance <= body_.options.margin)
            found = local_.contact(place - here.distance * here.normal, here.normal, here.distance, feature,
                                   local_.approach(place, here.normal, body_.options.margin));
        if (found) found->feature = feature;
        return found;
    }

    /// Edge descent: the deeper point of a face, or of the generator line on the side of a cylinder or a cone, near a
    /// point on it.
    std::optional<Contact> descend(const NearestPoint& nearest, const glm::vec3& place,
                                   const LocalField::FieldSample& here) const {
        const float step = probeSpacing * body_.scale * local_.collider().field().voxelSize();
        const glm::vec3 slope = body_.toConvex * here.gradient, start = body_.intoConvex(place);
        glm::vec3 end;
        float minDistance = std::numeric_limits<float>::lowest();
        bool isWithinFace = false;
        if (const auto line = convex_.sideLine(nearest, start)) {
            const glm::vec3 from = (*line)[0] + nearest.radius * nearest.normal, along = (*line)[1] - (*line)[0];
            const float length = glm::length(along), steepness = glm::dot(slope, along) / length;
            if (!(std::abs(steepness) > minDownhill)) return std::nullopt;
            const float middle = glm::dot(start - from, along) / (length * length);
            const float there = std::clamp(middle - std::copysign(step / length, steepness), 0.f, 1.f);
            end = start + (there - middle) * along;
        } else {
            // Where faces touch, points are exact; next to sharp edges the interpolant is not.
            const bool isSmooth = dataOf(local_.collider()).edges().edges().empty();
            if (!body_.options.exact && !isSmooth)
                minDistance = touchingFace * body_.scale * local_.collider().field().voxelSize();
            if (!convex_.isFlat(nearest) || nearest.distance < minDistance) return std::nullopt;
            const glm::vec3 uphill = slope - glm::dot(slope, nearest.normal) * nearest.normal;
            const float steepness = glm::length(uphill);
            if (!(steepness > minDownhill)) return std::nullopt;
            // no farther than the border of the face
            const NearestPoint last = convex_.nearest(start - step / steepness * uphill, step);
            end = last.core + last.radius * last.normal;
            isWithinFace = glm::dot(last.normal, nearest.normal) > sameFaceCosine;
        }
        const ProbedEdge path{[&, to = body_.intoField(end)](float fraction) { return glm::mix(place, to, fraction); },
                              {0, 0},
                              true,
                              0,
                              std::nullopt};
        const EdgeContacts edges(local_, body_.options.margin);
        auto found = edges.deepest(path, 0, here, 1, local_.at(body_.intoField(end)));
        if (!found || found->distance < minDistance) return std::nullopt;
        // within a face the face's normal counts, on its border the field's
        const Contact border = local_.contact(body_.intoField(end), -(body_.toField * nearest.normal), 0, 0);
        const glm::vec3 onFace = found->position + found->distance * found->normal;
        if (isWithinFace && glm::distance(onFace, border.position) > 2 * searchTolerance * body_.voxel)
            found->normal = border.normal;
        return found;
    }

    const ConvexInField& body_;
    const Convex& convex_;
    const LocalField& local_;
};

}  // namespace

ContactReport collideConvex(const Convex& convex, const Pose& pose, const Motion& motion, const Placed& field,
                            const ContactOptions& options, std::vector<Contact>& contacts) {
    ContactReport report;
    const ConvexInField body(convex, pose, motion, field, options);
    PointsOnConvex(body).visit(report, contacts);
    probeFeatures(body, report, contacts);
    return report;
}

}  // namespace bilayer::detail
