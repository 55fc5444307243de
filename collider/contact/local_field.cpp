// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/local_field.h"
#include <bilayer/collider/contact.h>
#include "collider/contact/collider_data.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "collider/contact/edge_probes.h"
#include "collider/contact/edge_search.h"
#include "collider/contact/surface_query.h"
#include "collider/field/interpolant.h"
#include "collider/field/path.h"

namespace bilayer::detail {

LocalField::LocalField(const Placed& field, const Pose& other, const Motion& motion, float reach, bool exact)
    : collider_(field.collider),
      field_(exact ? field.collider.exactField() : field.collider.field()),
      exact_(exact),
      scale_(field.scale),
      voxel_(field.scale * field.collider.field().voxelSize()),
      pose_(field.pose),
      relativeMotion_(other, motion, field.pose, field.motion) {
    const Bounds& bounds = field.collider.bounds();
    if (reach > surelyInBand(scale_ * field_.exteriorWidth(), voxel_)) farReach_ = reach / scale_;
    exactReach_ = reach + maxInterpolationError * voxel_;
    maxDisplacement_ =
        relativeMotion_.maxDisplacement(scale_ * bounds.centre(), 0.5f * scale_ * glm::length(bounds.size()));
}

LocalField::FieldSample LocalField::at(const glm::vec3& point, float radius) const {
    const Sample sample = field_.sample(point / scale_);
    if (!sample.inBand && sample.distance > 0 && farReach_ > 0) return sampleBeyondBand(point, radius, sample.distance);
    if (!sample.inBand)
        return {sample.distance > 0 ? FieldSample::outside : FieldSample::inside, scale_ * sample.distance};
    if (scale_ * sample.distance - radius <= exactReach_ && collider_.data().isExactAt(point / scale_, exact_))
        return exactSample(point, sample);
    const glm::vec3 normal = directionOf(sample, field_.voxelSize());
    const auto where = normal == glm::vec3(0) ? FieldSample::noNormal : FieldSample::nearSurface;
    return {where, scale_ * sample.distance, normal, sample.gradient};
}

// The exact sample from the triangles, in the band.
LocalField::FieldSample LocalField::exactSample(const glm::vec3& point, const Sample& sample) const {
    const SurfaceSample surface = surfaceSampleAt(field_, point / scale_, sample, true);
    if (surface.normal == glm::vec3(0)) return {FieldSample::noNormal, scale_ * surface.distance, {}, sample.gradient};
    return {FieldSample::nearSurface, scale_ * surface.distance, surface.normal, surface.normal};
}

// Beyond the band, for contact tests that ask for more than the band covers.
LocalField::FieldSample LocalField::sampleBeyondBand(const glm::vec3& point, float radius, float bound) const {
    const ClosestPoint closest = field_.closest(point / scale_, farReach_ + radius / scale_);
    if (!closest.found) return {FieldSample::outside, std::max(scale_ * bound, scale_ * farReach_ + radius)};
    const glm::vec3 normal = (point / scale_ - closest.position) / closest.distance;
    return {FieldSample::nearSurface, scale_ * closest.distance, normal, normal};
}

std::optional<Contact> LocalField::probe(const glm::vec3& point, const FieldSample& sample, float radius,
                                         std::uint32_t feature, float margin, ContactReport& report) const {
    ++report.pointsTested;
    if (sample.where == FieldSample::inside) ++report.beyondBand;
    if (sample.distance - radius > margin) return speculativeContact(point, radius, feature, margin, sample.distance);
    if (sample.where != FieldSample::nearSurface) return std::nullopt;
    return contact(point - sample.distance * sample.normal, sample.normal, sample.distance - radius, feature,
                   approach(point, sample.normal, margin), radius);
}

// For a point that is farther away: the contact where its path meets the surface.
std::optional<Contact> LocalField::speculativeContact(const glm::vec3& point, float radius, std::uint32_t feature,
                                                      float margin, float distance) const {
    if (maxDisplacement_ <= margin) return std::nullopt;
    const glm::vec3 displacement = relativeMotion_.of(point);
    const float length = glm::length(displacement);
    if (distance - radius > length) return std::nullopt;
    const Ray ray{point / scale_, displacement, length / scale_};
    const auto hit = radius > 0 ? field_.sphereCast(ray, radius / scale_) : field_.raycast(ray);
    if (!hit) return std::nullopt;
    const float separation = glm::dot(point - scale_ * hit->position, hit->normal);
    return contact(point - separation * hit->normal, hit->normal, std::max(separation - radius, 0.f), feature,
                   -glm::dot(displacement, hit->normal), radius);
}

glm::vec3 ProbedEdge::directionAt(float fraction) const {
    const float offset = isStraight ? 0.5f : 1e-3f;
    return glm::normalize(place(fraction + offset) - place(fraction - offset));
}

void LocalField::probeEdge(const ProbedEdge& edge, const FieldSample& first, const FieldSample& last, float margin,
                           ContactReport& report, std::vector<Contact>& contacts) const {
    const float length = glm::distance(edge.place(0), edge.place(1));
    if (!(length > 0)) return;
    // probes are sparser farther from the field
    const int intervals = probeIntervals(length, voxel_, (1 << probeBits) - 1);
    const float displacement = relativeMotion_.maxDisplacement(edge.place(0.5f), length);
    const float reach =
        margin + displacement + maxInterpolationError * voxel_ + std::max(edge.radius[0], edge.radius[1]);
    if (edge.isStraight && !mayReach(edge.place(0), edge.place(1), reach)) return;
    FieldSample before = first;
    for (int i = 0; i < intervals;) {
        // Intervals that are clear of the surface need no probes. The count is no number where floats overflow.
        const float clear = (before.distance - reach) * float(intervals) / length;
        const int next = i + (clear > 1 ? int(std::min(clear, float(intervals - i))) : 1);
        const float fraction = float(next) / float(intervals);
        FieldSample there = last;
        if (next < intervals) {
            const glm::vec3 point = edge.place(fraction);
            there = at(point, edge.radiusAt(fraction));
            const std::uint32_t feature = edge.feature + 2 * std::uint32_t(next);
            if (const auto found = probe(point, there, edge.radiusAt(fraction), feature, margin, report))
                contacts.push_back(*found);
        }
        if (edge.isSearched && next == i + 1)
            if (const auto found = deepestContact(edge, float(i) / float(intervals), before, fraction, there, margin)) {
                contacts.push_back(*found);
                contacts.back().feature = edge.feature + 2 * std::uint32_t(i) + 1;
            }
        i = next;
        before = there;
    }
}

// Whether a line segment comes this close to the bounding box of the surface.
bool LocalField::mayReach(const glm::vec3& from, const glm::vec3& to, float reach) const {
    const Bounds& bounds = collider_.bounds();
    const double length = glm::distance(from, to);
    const Path path{from, glm::dvec3(to - from) / length, length};
    return clip(path, scale_ * bounds.lower - reach, scale_ * bounds.upper + reach).has_value();
}

std::optional<Contact> LocalField::deepestContact(const ProbedEdge& edge, float from, const FieldSample& atFrom,
                                                  float to, const FieldSample& atTo, float margin) const {
    if (!atFrom.isKnown() || !atTo.isKnown()) return std::nullopt;
    const EdgeInterval interval{edge, from, to, glm::distance(edge.place(from), edge.place(to))};
    // as short as rounding: it has no direction
    if (!(interval.length > searchTolerance * voxel_)) return std::nullopt;
    const ValueAndSlope first = slopeOf(interval, 0, atFrom), last = slopeOf(interval, interval.length, atTo);
    const bool isNear = std::min(first.value, last.value) - 0.5f * interval.length <= margin;
    if (!isNear || !mayBeDeeperBetween(first, last)) return std::nullopt;
    const auto slopeAt = [&](float distance) -> std::optional<ValueAndSlope> {
        const float fraction = interval.fractionAt(distance);
        const FieldSample sample = at(edge.place(fraction), edge.radiusAt(fraction));
        if (!sample.isKnown()) return std::nullopt;
        return slopeOf(interval, distance, sample);
    };
    const std::optional<ValueAndSlope> lowest = deepestBetween(first, last, searchTolerance * voxel_, slopeAt);
    if (!lowest) return std::nullopt;
    const float fraction = interval.fractionAt(lowest->place);
    const FieldSample here = at(edge.place(fraction), edge.radiusAt(fraction));
    if (const auto crossing = crossingAt(edge, fraction, here)) {
        if (scale_ * crossing->distance > margin) return std::nullopt;
        return contact(scale_ * crossing->position, crossing->normal, scale_ * crossing->distance, 0,
                       approach(edge.place(fraction), crossing->normal, margin));
    }
    if (!fallsBetween(first, last) || here.where != FieldSample::nearSurface) return std::nullopt;
    return contactAcross(interval, lowest->place, here, margin);
}

ValueAndSlope LocalField::slopeOf(const EdgeInterval& interval, float distance, const FieldSample& sample) const {
    const ProbedEdge& edge = interval.edge;
    const float fraction = interval.fractionAt(distance);
    const float growth = (edge.radius[1] - edge.radius[0]) * (interval.to - interval.from) / interval.length;
    return {distance, sample.distance - edge.radiusAt(fraction),
            glm::dot(sample.gradient, edge.directionAt(fraction)) - growth};
}

// The crossing of a sharp edge with one of the field's.
std::optional<SharpEdges::Crossing> LocalField::crossingAt(const ProbedEdge& edge, float fraction,
                                                           const FieldSample& there) const {
    if (!edge.conormals || edge.radiusAt(fraction) > 0) return std::nullopt;
    return collider_.data().edges().crossing(collider_.data().points(), edge.place(0) / scale_, edge.place(1) / scale_,
                                             *edge.conormals, edge.place(fraction) / scale_, there.distance / scale_,
                                             voxel_ / scale_);
}

std::optional<Contact> LocalField::contactAcross(const EdgeInterval& interval, float distance, const FieldSample& there,
                                                 float margin) const {
    const float fraction = interval.fractionAt(distance), radius = interval.edge.radiusAt(fraction);
    const auto sampleAt = [&](float other) -> std::optional<SurfaceSample> {
        const FieldSample sample = at(interval.edge.place(interval.fractionAt(other)), radius);
        if (sample.where != FieldSample::nearSurface) return std::nullopt;
        return SurfaceSample{sample.distance, sample.normal};
    };
    const auto across = acrossEdge(interval.edge.directionAt(fraction), SurfaceSample{there.distance, there.normal},
                                   distance, voxel_, sampleAt);
    if (!across || across->distance - radius > margin) return std::nullopt;
    const glm::vec3 point = interval.edge.place(fraction);
    return contact(point - across->distance * across->normal, across->normal, across->distance - radius, 0,
                   approach(point, across->normal, margin));
}

float LocalField::approach(const glm::vec3& point, const glm::vec3& normal, float margin) const {
    return maxDisplacement_ > margin ? std::max(-glm::dot(relativeMotion_.of(point), normal), 0.f) : 0;
}

Contact LocalField::contact(const glm::vec3& position, const glm::vec3& normal, float distance, std::uint32_t feature,
                            float approach, float turningRadius) const {
    return {pose_.toWorld(position), pose_.rotation * normal, distance, feature, approach, turningRadius};
}

}  // namespace bilayer::detail
