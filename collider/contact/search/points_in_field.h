// SPDX-License-Identifier: Apache-2.0
// The search for contacts of one body's surface points in the field of another body. The point hierarchy is traversed
// with the relative pose, so that only points near the other body are sampled.
// Tested by tests/collider/collide.cpp through collide().
#pragma once

#include <bilayer/collider/contact.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <optional>
#include <span>

#include "collider/contact/body/body_transform.h"
#include "collider/contact/body/motion.h"
#include "collider/contact/reduction/contact_cache.h"
#include "collider/contact/search/contact_field.h"
#include "collider/contact/search/contact_range.h"
#include "collider/contact/search/edges_in_field.h"
#include "collider/contact/search/normal_filter.h"
#include "collider/contact/search/sampled_points.h"
#include "collider/field/layout/interpolant.h"
#include "collider/field/samples/field_data.h"
#include "sdf/base/access.h"

namespace bilayer::detail {

class PointsInField {
  public:
    PointsInField(const Placed& body, const Placed& other, const ContactOptions& options, ContactRange range)
        : body_(body),
          other_(other),
          beyondBand_(options.exact || reachesBeyondBand(other, options.margin, range)),
          surface_(other.collider, options.exact, beyondBand_),
          sampler_(surface_.field()),
          transform_(body, other),
          coarse_(transform_.intoCoarseCells(field())),
          relativeMotion_(body.pose, body.motion, other.pose, other.motion),
          clearance_(dataOf(field()).coarse),
          options_(options),
          reach_(options.margin / other.scale) {
        const Bounds &bounds = body.collider.bounds(), &otherBounds = other.collider.bounds();
        centre_ = bounds.centre(), radius_ = 0.5f * glm::length(bounds.size());
        // A contact lies in the boxes of both bodies. The smaller of the two bounds of the displacement therefore
        // decides for the points of either body.
        speculative_ =
            std::min(maxDisplacement(transform_(centre_), body_.scale * radius_ / other_.scale),
                     maxDisplacement(otherBounds.centre(), 0.5f * glm::length(otherBounds.size()))) > maxReach(range);
    }

    /// Calls found(index, point, sample) for the points within the margin of the surface, inside it, or predicted to
    /// hit it.
    template <class Found>
    void visit(CandidateLists::List* candidates, ContactReport& report, Found&& found) {
        if (!candidates || speculative_ || beyondBand_) return visitAll(report, found);
        const float voxel = field().voxelSize();
        // voxels outside the band have no values: a list must not reach that far
        const float maxSlack =
            std::min(voxel, (field().exteriorWidth() - reach_) / maxInterpolantSlope - rounding * voxel);
        const CandidateLists::RelativePose pose{body_.collider.id(), other_.collider.id(), reach_, transform_.linear,
                                                transform_.shift};
        if (candidates->keepOrReset(pose, centre_, radius_, voxel, maxSlack))
            visitListed(*candidates, report, found);
        else if (candidates->slack() > 0)
            visitAndList(*candidates, report, found);
        else
            visitAll(report, found);
    }

    /// The same for the points that a sampler has found.
    template <class Found>
    void visitFound(std::span<const FoundPoint> points, ContactReport& report, Found&& found) const {
        for (const auto& [index, sample] : points) {
            ++report.pointsTested;
            const SurfacePoint& point = dataOf(body_.collider).points().points()[index];
            test(index, point, transform_(point.position), sample, report, found);
        }
    }

    /// The query for a sampler.
    std::optional<PointQuery> query() const {
        if (speculative_) return std::nullopt;
        return PointQuery{0, 0, transform_.linear, transform_.shift, transform_.scale, reach_};
    }

  private:
    static constexpr float rounding = 1e-3f;  // [voxels]
    // The distance along its normal at which a sharp point that penetrates another vertex is tested again [voxels].
    static constexpr float retestOffset = 1;

    const Field& field() const { return surface_.field(); }

    // The distance to which contacts are certainly found without speculative ones, of either body's points.
    float maxReach(ContactRange range) const {
        if (range == ContactRange::margin) return reach_;
        const auto inBand = [](const Placed& of) {
            const Field& field = of.collider.field();
            return of.scale * surelyInBand(field.exteriorWidth(), field.voxelSize());
        };
        return std::min(reach_, std::min(inBand(body_), inBand(other_)) / other_.scale);
    }

    // An upper bound of the displacements of the body's points in a sphere, all in the other body's units.
    float maxDisplacement(const glm::vec3& centre, float radius) const {
        return relativeMotion_.maxDisplacement(other_.scale * centre, other_.scale * radius) / other_.scale;
    }

    // Max distance of the body's points in a sphere that may make a contact.
    float maxContactDistance(const glm::vec3& centre, float radius) const {
        if (!speculative_) return reach_;
        return reach_ + maxDisplacement(transform_(centre), body_.scale * radius / other_.scale);
    }

    // Min distance at which points can be rejected [coarse cells].
    float minRejectedDistance(float distance) const {
        return (distance / field().voxelSize() + maxInterpolationError) / float(Clearance::cellSide);
    }

    // @param kept  float (centre, radius): max distance of points in a sphere that may matter [coarse cells]
    template <class Kept, class Visit>
    void descend(Kept&& kept, Visit&& visit) const {
        const auto reject = [&](const glm::vec3& centre, float radius) {
            return clearance_.isOutside(coarse_(centre), radius * coarse_.scale + kept(centre, radius));
        };
        dataOf(body_.collider).points().visit(reject, visit);
    }

    template <class Found>
    void visitAll(ContactReport& report, Found& found) {
        const auto kept = [&](const glm::vec3& centre, float radius) {
            return minRejectedDistance(maxContactDistance(centre, radius));
        };
        descend(kept, [&](std::uint32_t index, const SurfacePoint& point) {
            const glm::vec3 cell = coarse_(point.position);
            const float distance = maxContactDistance(point.position, 0);
            const bool isAbove = !beyondBand_ && clearance_.isAbove(cell, distance);  // or outside the band
            if (isAbove || clearance_.isOutside(cell, minRejectedDistance(distance))) return;
            const glm::vec3 at = transform_(point.position);
            test(index, point, at, sampleAt(at, report), report, found);
        });
    }

    // Lists the points that can touch before the bodies have moved by the slack. Until then the interpolant changes by
    // at most the max slope times the slack, and the distance by the slack.
    template <class Found>
    void visitAndList(CandidateLists::List& candidates, ContactReport& report, Found& found) {
        const float slack = candidates.slack(), above = reach_ + maxInterpolantSlope * slack, within = reach_ + slack,
                    beyondBand = within + maxInterpolationError * field().voxelSize(),
                    kept = minRejectedDistance(within);
        descend([&](const glm::vec3&, float) { return kept; },
                [&](std::uint32_t index, const SurfacePoint& point) {
                    const glm::vec3 cell = coarse_(point.position);
                    if (clearance_.isAbove(cell, above) || clearance_.isOutside(cell, kept)) return;
                    const glm::vec3 at = transform_(point.position);
                    const Sample sample = sampleAt(at, report);
                    if (sample.distance > (sample.inBand ? above : beyondBand)) return;
                    candidates.add(index);
                    test(index, point, at, sample, report, found);
                });
    }

    template <class Found>
    void visitListed(const CandidateLists::List& candidates, ContactReport& report, Found& found) {
        const auto points = dataOf(body_.collider).points().points();
        for (const std::uint32_t index : candidates.points()) {
            const SurfacePoint& point = points[index];
            if (clearance_.isAbove(coarse_(point.position), reach_)) continue;
            const glm::vec3 at = transform_(point.position);
            test(index, point, at, sampleAt(at, report), report, found);
        }
    }

    Sample sampleAt(const glm::vec3& at, ContactReport& report) {
        ++report.pointsTested;
        return sampler_.sample(at);
    }

    template <class Found>
    void test(std::uint32_t index, const SurfacePoint& point, const glm::vec3& at, const Sample& sample,
              ContactReport& report, Found& found) const {
        if (!sample.inBand && sample.distance < 0) {
            ++report.beyondBand;
            return;
        }
        const auto here = sample.distance <= reach_ ? surface_.at(at, sample, reach_) : std::nullopt;
        if (here && here->distance <= reach_) {
            SurfaceSample contact = point.isSharp && here->distance <= 0 ? opposedSurface(point, at, *here) : *here;
            if (speculative_) contact.approach = approachOf(point, at, contact);
            found(index, point, contact);
            if (point.isSharp)
                EdgesInField(body_.collider, transform_, surface_, reach_).visit(index, at, *here, found);
        } else if (speculative_) {
            const glm::vec3 displacement = displacementOf(at);
            if (sample.distance > glm::length(displacement) || isGrazing(point, at, displacement)) return;
            if (const auto contact = surface_.impact(at, displacement)) found(index, point, *contact);
        }
    }

    // The surface that a convex vertex inside the other body has come through, where the nearest surface does not
    // oppose the vertex's normal: it has penetrated another convex vertex, and the sides of that one are nearest. Looks
    // for the surface at an offset against the normal. Returns `here` if that place is not outside the other body.
    SurfaceSample opposedSurface(const SurfacePoint& point, const glm::vec3& at, const SurfaceSample& here) const {
        const glm::vec3 normal = transform_.rotated(point.normal);
        const auto cosine = [&](const SurfaceSample& sample) { return -glm::dot(sample.normal, normal); };
        if (passesNormalFilter(options_, cosine(here), false)) return here;
        const float back = retestOffset * field().voxelSize();
        const glm::vec3 outside = at - back * normal;
        const Sample sample = field().sample(outside);
        if (!sample.inBand) return here;
        const SurfaceSample there = surface_.inBand(outside, sample);
        if (!(there.distance > 0) || !passesNormalFilter(options_, cosine(there), false)) return here;
        return {std::min(there.distance - back * cosine(there), 0.f), there.normal};
    }

    float approachOf(const SurfacePoint& point, const glm::vec3& at, const SurfaceSample& contact) const {
        const glm::vec3 displacement = displacementOf(at);
        const float approach = -glm::dot(displacement, contact.normal);
        return approach > 0 && (contact.distance <= 0 || !isGrazing(point, at, displacement)) ? approach : 0;
    }

    // Whether a point's path only grazes the field, or misses it.
    bool isGrazing(const SurfacePoint& point, const glm::vec3& at, const glm::vec3& displacement) const {
        const glm::vec3 normal = glm::normalize(transform_.linear * point.normal);
        const glm::vec3 start = grazingTestStart(at, normal, displacement, field().voxelSize());
        return !field().segment(start, start + displacement).has_value();
    }

    glm::vec3 displacementOf(const glm::vec3& at) const { return relativeMotion_.of(other_.scale * at) / other_.scale; }

    const Placed &body_, &other_;
    bool beyondBand_;  // the other surface is searched for from points beyond its band, too
    ContactField surface_;
    FieldSampler sampler_;  // neighbours in the hierarchy of points are near each other
    BodyTransform transform_, coarse_;
    RelativeMotion relativeMotion_;
    Clearance clearance_;
    ContactOptions options_;
    float reach_;
    glm::vec3 centre_;  // of a bounding sphere of the body
    float radius_;
    bool speculative_;  // some point moves farther than the range in which contacts are certainly found
};

}  // namespace bilayer::detail
