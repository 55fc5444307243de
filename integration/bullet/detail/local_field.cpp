#include "integration/bullet/detail/local_field.h"
#include <bilayer/collider/contact.h>
#include "collider/contact/collider_data.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "collider/contact/edge_search.h"
#include "collider/contact/surface_query.h"
#include "collider/field/interpolant.h"
#include "collider/field/path.h"
#include "integration/bullet/detail/edge_probes.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

namespace {

Contact turning(Contact contact, float radius) {
    contact.turningRadius = radius;
    return contact;
}

}  // namespace

LocalField::LocalField(const Placed& field, const Pose& other, const Motion& motion, float reach, bool measured)
    : collider_(field.collider),
      field_(measured ? field.collider.exactField() : field.collider.field()),
      measured_(measured),
      scale_(field.scale),
      voxel_(field.scale * field.collider.field().voxelSize()),
      pose_(field.pose),
      relativeMotion_(other, motion, field.pose, field.motion) {
    const Bounds& bounds = field.collider.bounds();
    if (reach > surelyInBand(scale_ * field_.exteriorWidth(), voxel_)) farReach_ = reach / scale_;
    exactReach_ = reach + maxInterpolationError * voxel_;
    longestWay_ = relativeMotion_.maxDisplacement(scale_ * bounds.centre(), 0.5f * scale_ * glm::length(bounds.size()));
}

LocalField::Answer LocalField::at(const glm::vec3& point, float radius) const {
    const Sample sample = field_.sample(point / scale_);
    if (!sample.inBand && sample.distance > 0 && farReach_ > 0) return farAway(point, radius, sample.distance);
    if (!sample.inBand) return {sample.distance > 0 ? Answer::outside : Answer::inside, scale_ * sample.distance};
    if (scale_ * sample.distance - radius <= exactReach_ && collider_.data().isExactAt(point / scale_, measured_))
        return exactly(point, sample);
    const glm::vec3 normal = directionOf(sample, field_.voxelSize());
    const auto where = normal == glm::vec3(0) ? Answer::unclear : Answer::near;
    return {where, scale_ * sample.distance, normal, sample.gradient};
}

// The exact answer from the triangles, in the band.
LocalField::Answer LocalField::exactly(const glm::vec3& point, const Sample& sample) const {
    const SurfaceSample touch = surfaceSampleAt(field_, point / scale_, sample, true);
    if (touch.normal == glm::vec3(0)) return {Answer::unclear, scale_ * touch.distance, {}, sample.gradient};
    return {Answer::near, scale_ * touch.distance, touch.normal, touch.normal};
}

// Beyond the band, for contact tests that ask for more than the band covers.
LocalField::Answer LocalField::farAway(const glm::vec3& point, float radius, float bound) const {
    const ClosestPoint closest = field_.closest(point / scale_, farReach_ + radius / scale_);
    if (!closest.found) return {Answer::outside, std::max(scale_ * bound, scale_ * farReach_ + radius)};
    const glm::vec3 normal = (point / scale_ - closest.position) / closest.distance;
    return {Answer::near, scale_ * closest.distance, normal, normal};
}

std::optional<Contact> LocalField::probe(const glm::vec3& point, const Answer& answer, float radius,
                                         std::uint32_t feature, float margin, ContactReport& report) const {
    ++report.pointsTested;
    if (answer.where == Answer::inside) ++report.beyondBand;
    if (answer.distance - radius > margin) return probeOnWay(point, radius, feature, margin, answer.distance);
    if (answer.where != Answer::near) return std::nullopt;
    return turning(contact(point - answer.distance * answer.normal, answer.normal, answer.distance - radius, feature,
                           approach(point, answer.normal, margin)),
                   radius);
}

// For a point that is farther away: the contact where its path meets the surface.
std::optional<Contact> LocalField::probeOnWay(const glm::vec3& point, float radius, std::uint32_t feature, float margin,
                                              float distance) const {
    if (longestWay_ <= margin) return std::nullopt;
    const glm::vec3 way = relativeMotion_.of(point);
    const float length = glm::length(way);
    if (distance - radius > length) return std::nullopt;
    const Ray ray{point / scale_, way, length / scale_};
    const auto hit = radius > 0 ? field_.sphereCast(ray, radius / scale_) : field_.raycast(ray);
    if (!hit) return std::nullopt;
    const float gap = glm::dot(point - scale_ * hit->position, hit->normal);
    return turning(contact(point - gap * hit->normal, hit->normal, std::max(gap - radius, 0.f), feature,
                           -glm::dot(way, hit->normal)),
                   radius);
}

glm::vec3 LocalField::Edge::directionAt(float part) const {
    const float aside = isStraight ? 0.5f : 1e-3f;
    return glm::normalize(place(part + aside) - place(part - aside));
}

void LocalField::probeEdge(const Edge& edge, const Answer& first, const Answer& last, float margin,
                           ContactReport& report, std::vector<Contact>& contacts) const {
    const float length = glm::distance(edge.place(0), edge.place(1));
    if (!(length > 0)) return;
    // probes are sparser farther from the field
    const int parts = probeIntervals(length, voxel_, (1 << partBits) - 1);
    const float way = relativeMotion_.maxDisplacement(edge.place(0.5f), length);
    const float reach = margin + way + maxInterpolationError * voxel_ + std::max(edge.radius[0], edge.radius[1]);
    if (edge.isStraight && !comesNear(edge.place(0), edge.place(1), reach)) return;
    Answer before = first;
    for (int i = 0; i < parts;) {
        // Parts that are clear of the surface need no probes.
        const float clear = (before.distance - reach) * float(parts) / length;
        const int next = i + std::max(1, int(std::min(clear, float(parts - i))));
        const float part = float(next) / float(parts);
        Answer there = last;
        if (next < parts) {
            const glm::vec3 point = edge.place(part);
            there = at(point, edge.radiusAt(part));
            const std::uint32_t feature = edge.feature + 2 * std::uint32_t(next);
            if (const auto found = probe(point, there, edge.radiusAt(part), feature, margin, report))
                contacts.push_back(*found);
        }
        if (edge.isSearched && next == i + 1)
            if (const auto found = deepestBetween(edge, float(i) / float(parts), before, part, there, margin)) {
                contacts.push_back(*found);
                contacts.back().feature = edge.feature + 2 * std::uint32_t(i) + 1;
            }
        i = next;
        before = there;
    }
}

// Whether a line segment comes this close to the bounding box of the surface.
bool LocalField::comesNear(const glm::vec3& from, const glm::vec3& to, float reach) const {
    const Bounds& bounds = collider_.bounds();
    const double length = glm::distance(from, to);
    const Path path{from, glm::dvec3(to - from) / length, length};
    return clip(path, scale_ * bounds.lower - reach, scale_ * bounds.upper + reach).has_value();
}

std::optional<Contact> LocalField::deepestBetween(const Edge& edge, float from, const Answer& atFrom, float to,
                                                  const Answer& atTo, float margin) const {
    if (!atFrom.isKnown() || !atTo.isKnown()) return std::nullopt;
    const Piece piece{edge, from, to, glm::distance(edge.place(from), edge.place(to))};
    // as short as rounding: it has no direction
    if (!(piece.length > searchTolerance * voxel_)) return std::nullopt;
    const Slope first = slopeOf(piece, 0, atFrom), last = slopeOf(piece, piece.length, atTo);
    const bool isNear = std::min(first.value, last.value) - 0.5f * piece.length <= margin;
    const bool falls = fallsBetween(first, last);
    if (!isNear || !(falls || mayKinkBetween(first, last))) return std::nullopt;
    const auto slopeAt = [&](float way) -> std::optional<Slope> {
        const float part = piece.partAt(way);
        const Answer answer = at(edge.place(part), edge.radiusAt(part));
        if (!answer.isKnown()) return std::nullopt;
        return slopeOf(piece, way, answer);
    };
    const std::optional<Slope> lowest = falls ? lowestBetween(first, last, searchTolerance * voxel_, slopeAt)
                                        : first.value < last.value ? first
                                                                   : last;
    if (!lowest) return std::nullopt;
    const float part = piece.partAt(lowest->place);
    const Answer here = at(edge.place(part), edge.radiusAt(part));
    if (const auto crossing = crossingAt(edge, part, here)) {
        if (scale_ * crossing->distance > margin) return std::nullopt;
        return contact(scale_ * crossing->position, crossing->normal, scale_ * crossing->distance, 0,
                       approach(edge.place(part), crossing->normal, margin));
    }
    if (!falls || here.where != Answer::near) return std::nullopt;
    return touchAcross(piece, lowest->place, here, margin);
}

Slope LocalField::slopeOf(const Piece& piece, float way, const Answer& answer) const {
    const Edge& edge = piece.edge;
    const float part = piece.partAt(way);
    const float growth = (edge.radius[1] - edge.radius[0]) * (piece.to - piece.from) / piece.length;
    return {way, answer.distance - edge.radiusAt(part), glm::dot(answer.gradient, edge.directionAt(part)) - growth};
}

// The crossing of a sharp edge with one of the field's.
std::optional<SharpEdges::Crossing> LocalField::crossingAt(const Edge& edge, float part, const Answer& there) const {
    if (!edge.conormals || edge.radiusAt(part) > 0) return std::nullopt;
    return collider_.data().edges().crossing(collider_.data().points(), edge.place(0) / scale_, edge.place(1) / scale_,
                                             *edge.conormals, edge.place(part) / scale_, there.distance / scale_,
                                             voxel_ / scale_);
}

std::optional<Contact> LocalField::touchAcross(const Piece& piece, float way, const Answer& there, float margin) const {
    const float part = piece.partAt(way), radius = piece.edge.radiusAt(part), aside = 2 * searchTolerance * voxel_;
    const auto touchAt = [&](float place) -> std::optional<SurfaceSample> {
        const Answer answer = at(piece.edge.place(piece.partAt(place)), radius);
        if (answer.where != Answer::near) return std::nullopt;
        return SurfaceSample{answer.distance, answer.normal};
    };
    const auto held = acrossEdge(piece.edge.directionAt(part), SurfaceSample{there.distance, there.normal},
                                 touchAt(way - aside), touchAt(way + aside));
    if (!held || held->distance - radius > margin) return std::nullopt;
    const glm::vec3 point = piece.edge.place(part);
    return contact(point - held->distance * held->normal, held->normal, held->distance - radius, 0,
                   approach(point, held->normal, margin));
}

float LocalField::approach(const glm::vec3& point, const glm::vec3& normal, float margin) const {
    return longestWay_ > margin ? std::max(-glm::dot(relativeMotion_.of(point), normal), 0.f) : 0;
}

Contact LocalField::contact(const glm::vec3& position, const glm::vec3& normal, float distance, std::uint32_t feature,
                            float approach) const {
    return {pose_.toWorld(position), pose_.rotation * normal, distance, feature, approach};
}

}  // namespace bilayer::bullet::detail
