// SPDX-License-Identifier: Apache-2.0
// Contacts of a body's sharp edges between its surface points, in the field of another body.
// Tested by tests/bullet/edges.cpp through collide().
#pragma once

#include <algorithm>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <optional>

#include "collider/contact/body/body_transform.h"
#include "collider/contact/search/contact_field.h"
#include "collider/contact/search/edge_search.h"
#include "sdf/base/access.h"

namespace bilayer::detail {

class EdgesInField {
  public:
    /// @param transform  from the body into the other one
    /// @param reach      max separation of contacts, in the other body's units
    EdgesInField(const Collider& body, const BodyTransform& transform, const ContactField& other, float reach)
        : body_(body), transform_(transform), other_(other), reach_(reach) {}

    /// Finds the edges that reach deeper between a point with a contact and its neighbours on sharp edges. Calls
    /// found(feature, point, sample) for each.
    /// @param at, here  the point in the other body's coordinates, and the other surface there
    template <class Found>
    void visit(std::uint32_t index, const glm::vec3& at, const SurfaceSample& here, Found& found) const {
        const SharpEdges& edges = dataOf(body_).edges();
        for (const std::uint32_t e : edges.around(index)) {
            const SharpEdge& edge = edges.edges()[e];
            const std::uint32_t next = edge.otherEnd(index);
            const glm::vec3 end = transform_(pointOf(next).position);
            const float length = glm::distance(at, end);
            const glm::vec3 along = (end - at) / length;
            const Sample sample = other_.field().sample(end);
            const auto there = other_.at(end, sample, reach_ + length);
            if (!there) continue;
            // if both ends touch, process the edge only once
            if (std::max(sample.distance, there->distance) <= reach_ && next < index) continue;
            const ValueAndSlope from = slopeAlong(along, 0, here), to = slopeAlong(along, length, *there);
            if (!mayBeDeeperBetween(from, to)) continue;
            if (auto deepest = deepestOf(at, end, along, from, to, edge.conormals)) {
                const float part = deepest->place / length;
                const SurfacePoint &a = pointOf(index), &b = pointOf(next);
                const SurfacePoint between{glm::mix(a.position, b.position, part), glm::normalize(a.normal + b.normal),
                                           true};
                if (other_.isExact())
                    deepest->sample.distance += transform_.scale * edgeHeight(body_, between.position);
                if (deepest->sample.distance > reach_) continue;
                found(std::uint32_t(dataOf(body_).points().points().size()) + e, between, deepest->sample);
            }
        }
    }

  private:
    /// The contact of an edge, and its distance from the edge's start.
    struct EdgeContact {
        float place;
        SurfaceSample sample;
    };

    std::optional<EdgeContact> deepestOf(const glm::vec3& start, const glm::vec3& end, const glm::vec3& along,
                                         const ValueAndSlope& from, const ValueAndSlope& to,
                                         const Conormals& conormals) const {
        const auto sampleAt = [&](float place) {
            const glm::vec3 point = start + place * along;
            return other_.at(point, other_.field().sample(point), reach_ + to.place);
        };
        const auto slopeAt = [&](float place) -> std::optional<ValueAndSlope> {
            const auto sample = sampleAt(place);
            if (!sample) return std::nullopt;
            return slopeAlong(along, place, *sample);
        };
        const std::optional<ValueAndSlope> lowest =
            deepestBetween(from, to, searchTolerance * other_.voxelSize(), slopeAt);
        const auto here = lowest ? sampleAt(lowest->place) : std::nullopt;
        if (!here) return std::nullopt;

        const Conormals rotated{transform_.rotated(conormals[0]), transform_.rotated(conormals[1])};
        if (const auto crossing = other_.crossing(start, end, rotated, start + lowest->place * along, here->distance)) {
            const glm::vec3 onEdge = crossing->position + crossing->distance * crossing->normal;
            const float height = other_.isExact() ? edgeHeight(other_.collider(), crossing->position) : 0;
            return EdgeContact{glm::dot(onEdge - start, along),
                               SurfaceSample{crossing->distance + height, crossing->normal}};
        }
        if (!fallsBetween(from, to)) return std::nullopt;
        const auto across = acrossEdge(along, *here, lowest->place, other_.voxelSize(), sampleAt);
        if (!across) return std::nullopt;
        return EdgeContact{lowest->place, *across};
    }

    const SurfacePoint& pointOf(std::uint32_t index) const { return dataOf(body_).points().points()[index]; }

    const Collider& body_;
    const BodyTransform& transform_;
    const ContactField& other_;
    float reach_;
};

}  // namespace bilayer::detail
