// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/search/edge_contacts.h"

#include <algorithm>
#include <glm/geometric.hpp>

#include "collider/contact/body/collider_data.h"
#include "collider/contact/search/contact_field.h"
#include "collider/contact/search/edge_probes.h"
#include "collider/field/layout/interpolant.h"
#include "collider/field/layout/path.h"
#include "sdf/base/access.h"

namespace bilayer::detail {

glm::vec3 ProbedEdge::directionAt(float fraction) const {
    const float offset = isStraight ? 0.5f : 1e-3f;
    return glm::normalize(place(fraction + offset) - place(fraction - offset));
}

void EdgeContacts::find(const ProbedEdge& edge, const FieldSample& first, const FieldSample& last,
                        ContactReport& report, std::vector<Contact>& contacts) const {
    const float voxel = field_.voxel(), length = glm::distance(edge.place(0), edge.place(1));
    if (!(length > 0)) return;
    // probes are sparser farther from the field
    const int intervals = probeIntervals(length, voxel, (1 << probeBits) - 1);
    const float displacement = field_.relativeMotion().maxDisplacement(edge.place(0.5f), length);
    const float reach =
        margin_ + displacement + maxInterpolationError * voxel + std::max(edge.radius[0], edge.radius[1]);
    if (edge.isStraight && !mayReach(edge.place(0), edge.place(1), reach)) return;
    FieldSample before = first;
    for (int i = 0; i < intervals;) {
        // Intervals that are clear of the surface need no probes. The count is no number where floats overflow.
        const float clear = (before.distance - reach) * float(intervals) / length;
        const int next = i + (clear > 1 ? int(std::min(clear, float(intervals - i))) : 1);
        const float fraction = float(next) / float(intervals);
        FieldSample there = last;
        if (next < intervals) {
            there = sampleAt(edge, fraction);
            const std::uint32_t feature = edge.feature + 2 * std::uint32_t(next);
            if (const auto found =
                    field_.probe(edge.place(fraction), there, edge.radiusAt(fraction), feature, margin_, report))
                contacts.push_back(*found);
        }
        if (edge.isSearched && next == i + 1)
            if (const auto found = deepest(edge, float(i) / float(intervals), before, fraction, there)) {
                contacts.push_back(*found);
                contacts.back().feature = edge.feature + 2 * std::uint32_t(i) + 1;
            }
        i = next;
        before = there;
    }
}

// Whether a line segment comes this close to the bounding box of the surface.
bool EdgeContacts::mayReach(const glm::vec3& from, const glm::vec3& to, float reach) const {
    const Bounds& bounds = field_.collider().bounds();
    const float scale = field_.scale();
    const double length = glm::distance(from, to);
    const Path path{from, glm::dvec3(to - from) / length, length};
    return clip(path, scale * bounds.lower - reach, scale * bounds.upper + reach).has_value();
}

LocalField::FieldSample EdgeContacts::sampleAt(const ProbedEdge& edge, float fraction) const {
    return field_.at(edge.place(fraction), edge.radiusAt(fraction));
}

std::optional<Contact> EdgeContacts::deepest(const ProbedEdge& edge, float from, const FieldSample& atFrom, float to,
                                             const FieldSample& atTo) const {
    if (!atFrom.isKnown() || !atTo.isKnown()) return std::nullopt;
    const Interval interval{edge, from, to, glm::distance(edge.place(from), edge.place(to))};
    // as short as rounding: it has no direction
    const float tolerance = searchTolerance * field_.voxel();
    if (!(interval.length > tolerance)) return std::nullopt;
    const ValueAndSlope first = slopeOf(interval, 0, atFrom), last = slopeOf(interval, interval.length, atTo);
    const bool isNear = std::min(first.value, last.value) - 0.5f * interval.length <= margin_;
    if (!isNear || !mayBeDeeperBetween(first, last)) return std::nullopt;
    const auto slopeAt = [&](float distance) -> std::optional<ValueAndSlope> {
        const FieldSample sample = sampleAt(edge, interval.fractionAt(distance));
        if (!sample.isKnown()) return std::nullopt;
        return slopeOf(interval, distance, sample);
    };
    const std::optional<ValueAndSlope> lowest = deepestBetween(first, last, tolerance, slopeAt);
    if (!lowest) return std::nullopt;
    const float fraction = interval.fractionAt(lowest->place);
    const FieldSample here = sampleAt(edge, fraction);
    if (const auto crossing = crossingAt(edge, fraction, here)) {
        const float scale = field_.scale();
        const float height = field_.isExact() ? edgeHeight(field_.collider(), crossing->position) : 0;
        const float distance = scale * (crossing->distance + height);
        if (distance > margin_) return std::nullopt;
        return field_.contact(scale * crossing->position, crossing->normal, distance, 0,
                              field_.approach(edge.place(fraction), crossing->normal, margin_));
    }
    if (!fallsBetween(first, last) || here.where != FieldSample::nearSurface) return std::nullopt;
    return across(interval, lowest->place, here);
}

ValueAndSlope EdgeContacts::slopeOf(const Interval& interval, float distance, const FieldSample& sample) const {
    const ProbedEdge& edge = interval.edge;
    const float fraction = interval.fractionAt(distance);
    const float growth = (edge.radius[1] - edge.radius[0]) * (interval.to - interval.from) / interval.length;
    return {distance, sample.distance - edge.radiusAt(fraction),
            glm::dot(sample.gradient, edge.directionAt(fraction)) - growth};
}

// The crossing of a sharp edge with one of the field's.
std::optional<SharpEdges::Crossing> EdgeContacts::crossingAt(const ProbedEdge& edge, float fraction,
                                                             const FieldSample& there) const {
    if (!edge.conormals || edge.radiusAt(fraction) > 0) return std::nullopt;
    const ColliderData& data = dataOf(field_.collider());
    const float scale = field_.scale();
    return data.edges().crossing(data.points(), edge.place(0) / scale, edge.place(1) / scale, *edge.conormals,
                                 edge.place(fraction) / scale, there.distance / scale, field_.voxel() / scale);
}

std::optional<Contact> EdgeContacts::across(const Interval& interval, float distance, const FieldSample& there) const {
    const ProbedEdge& edge = interval.edge;
    const float fraction = interval.fractionAt(distance), radius = edge.radiusAt(fraction);
    const auto surfaceAt = [&](float other) -> std::optional<SurfaceSample> {
        const FieldSample sample = field_.at(edge.place(interval.fractionAt(other)), radius);
        if (sample.where != FieldSample::nearSurface) return std::nullopt;
        return SurfaceSample{sample.distance, sample.normal};
    };
    const auto found = acrossEdge(edge.directionAt(fraction), SurfaceSample{there.distance, there.normal}, distance,
                                  field_.voxel(), surfaceAt);
    if (!found || found->distance - radius > margin_) return std::nullopt;
    const glm::vec3 point = edge.place(fraction);
    return field_.contact(point - found->distance * found->normal, found->normal, found->distance - radius, 0,
                          field_.approach(point, found->normal, margin_));
}

}  // namespace bilayer::detail
