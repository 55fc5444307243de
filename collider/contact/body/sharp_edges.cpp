// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/body/sharp_edges.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>

namespace bilayer::detail {
namespace {

// Max distance of neighbours on an edge [voxels]. Candidates are at least 1.4 voxels apart. Every second or third of
// them remains where points are two voxels apart.
constexpr float maxNeighbourDistance = 4.5f;
// Of two neighbours in about the same direction, only the nearer one counts: cosine of 60 degrees.
constexpr float minNeighbourCosine = 0.5f;
// Max cosine between an edge and the normals at its ends. An edge is perpendicular to them except at vertices: a
// cube's have 0.58.
constexpr float maxNormalCosine = 0.7f;
// Max rounding of sharp edges by the interpolant [voxels]; at larger distances there is a groove between the two
// points.
constexpr float sampleOnSurface = 0.45f;
// Max height of a segment above the edge between its ends, as around a hole [voxels].
constexpr float maxAbove = 0.05f;
constexpr std::size_t maxNeighbours = 6;
// Edges that cross at a smaller angle (sine) count as parallel: the contacts of their points suffice.
constexpr float minCrossing = 0.2f;
// Max distance of a crossing from the deepest place of the field, which rounds edges off [voxels].
constexpr float crossingWithin = 1.5f;
// Max depth of a crossing, as a multiple of the depth in the field and as an excess over it [voxels]. The field's depth
// is across faces instead of both edges, and a sampled field rounds edges off.
constexpr float maxDepthFactor = 1.5f, maxExcessDepth = 1, maxDepthFactorExact = 2, maxExcessDepthExact = 0.25f;
// Min angle (sine) between the faces and the plane that separates two edges. Coplanar faces touch by their points.
constexpr float minLeaving = 0.09f;
// Smaller angles (sine) count as level.
constexpr float level = 0.09f;
// Max length of the mean direction along the edges around a point: longer where they bend by more than ten degrees.
constexpr float minBend = 0.0872f;
// Distance from an edge at which its faces are sampled [voxels].
constexpr float conormalOffset = 1.5f;
// The ends of an edge have normals with a larger cosine: those of two borders of a strip are opposite.
constexpr float oppositeNormals = -0.99f;
// Min distance from an edge at which its faces are found [voxels].
constexpr float minConormal = 0.1f;
// Tolerance for the ends of an edge's segments, relative to their length.
constexpr float endTolerance = 0.02f;
// Min count of points, within the neighbour distance, to surround a point.
constexpr int minAround = 3;

struct Neighbour {
    std::uint32_t index;
    glm::vec3 direction;
    float distance;
};

std::vector<Neighbour> neighboursOf(std::uint32_t index, const SurfacePoints& points, const Field& field) {
    const SurfacePoint& point = points.points()[index];
    const float reach = maxNeighbourDistance * field.voxelSize();
    std::vector<Neighbour> candidates;
    points.visit(
        [&](const glm::vec3& centre, float radius) { return glm::distance(centre, point.position) > radius + reach; },
        [&](std::uint32_t other, const SurfacePoint& there) {
            if (!there.isSharp || other == index) return;
            const glm::vec3 offset = there.position - point.position;
            const float distance = glm::length(offset);
            if (!(distance > 0) || distance > reach) return;
            const glm::vec3 direction = offset / distance;
            const float cosine =
                std::max(std::abs(glm::dot(direction, point.normal)), std::abs(glm::dot(direction, there.normal)));
            // the height of the segment above an arc with these normals: a quarter of its ends' heights over each
            // other
            const float above = 0.125f * (glm::dot(offset, point.normal) - glm::dot(offset, there.normal));
            const bool isOneEdge = glm::dot(point.normal, there.normal) > oppositeNormals;
            if (isOneEdge && cosine < maxNormalCosine && above <= maxAbove * field.voxelSize())
                candidates.push_back({other, direction, distance});
        });
    std::sort(candidates.begin(), candidates.end(), [](const Neighbour& a, const Neighbour& b) {
        return a.distance < b.distance || (a.distance == b.distance && a.index < b.index);
    });
    std::vector<Neighbour> kept;
    for (const Neighbour& next : candidates) {
        const auto hides = [&](const Neighbour& k) {
            return glm::dot(k.direction, next.direction) > minNeighbourCosine;
        };
        if (kept.size() == maxNeighbours) break;
        if (std::any_of(kept.begin(), kept.end(), hides)) continue;
        const glm::vec3 middle = 0.5f * (point.position + points.points()[next.index].position);
        if (std::abs(field.sample(middle).distance) <= sampleOnSurface * field.voxelSize()) kept.push_back(next);
    }
    return kept;
}

/// The conormals of an edge, from the surface next to its middle.
Conormals conormalsOf(const SurfacePoint& a, const SurfacePoint& b, const Field& field) {
    const glm::vec3 along = glm::normalize(b.position - a.position), middle = 0.5f * (a.position + b.position);
    const glm::vec3 across = glm::normalize(glm::cross(along, a.normal + b.normal));
    const auto conormal = [&](float side) {
        glm::vec3 place = middle + side * conormalOffset * field.voxelSize() * across;
        for (int i = 0; i < 2; ++i) {
            const Sample sample = field.sample(place);
            if (sample.inBand) place -= sample.distance * sample.gradient;
        }
        const glm::vec3 offset = place - middle, conormal = offset - glm::dot(offset, along) * along;
        const float length = glm::length(conormal);
        // from both sides of an open surface, its border is nearest
        return length > minConormal * field.voxelSize() ? conormal / length : -glm::normalize(a.normal + b.normal);
    };
    return {conormal(-1), conormal(1)};
}

}  // namespace

SharpEdges::SharpEdges(const SurfacePoints& points, const Field& field)
    : maxDepthFactor_(field.mesh() ? maxDepthFactorExact : maxDepthFactor),
      maxExcessDepth_(field.mesh() ? maxExcessDepthExact : maxExcessDepth),
      neighbourDistance_(maxNeighbourDistance * field.voxelSize()) {
    const auto all = points.points();
    std::vector<std::vector<Neighbour>> neighbours(all.size());
    tbb::parallel_for(std::uint32_t(0), std::uint32_t(all.size()), [&](std::uint32_t i) {
        if (all[i].isSharp) neighbours[i] = neighboursOf(i, points, field);
    });
    for (std::uint32_t i = 0; i < all.size(); ++i)
        for (const Neighbour& next : neighbours[i]) {
            const auto isBack = [&](const Neighbour& n) { return n.index == i; };
            const auto& theirs = neighbours[next.index];
            if (next.index < i || std::none_of(theirs.begin(), theirs.end(), isBack)) continue;
            edges_.push_back({i, next.index, conormalsOf(all[i], all[next.index], field)});
            maxLength_ = std::max(maxLength_, next.distance);
        }
    first_.assign(all.size() + 1, 0);
    for (const SharpEdge& edge : edges_) ++first_[edge.from + 1], ++first_[edge.to + 1];
    for (std::size_t i = 0; i < all.size(); ++i) first_[i + 1] += first_[i];
    ofPoints_.resize(2 * edges_.size());
    std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
    for (std::uint32_t e = 0; e < edges_.size(); ++e)
        ofPoints_[next[edges_[e].from]++] = e, ofPoints_[next[edges_[e].to]++] = e;
}

bool SharpEdges::isConvexVertex(const SurfacePoints& points, std::uint32_t point, const glm::vec3& direction) const {
    return pointsRecede(points, point, direction) || edgesRecede(points, point, direction);
}

bool SharpEdges::isWithinEdge(const SurfacePoints& points, std::uint32_t point) const {
    glm::vec3 sum(0);
    for (const std::uint32_t e : around(point)) {
        const std::uint32_t next = edges_[e].otherEnd(point);
        sum += glm::normalize(points.points()[next].position - points.points()[point].position);
    }
    return !around(point).empty() && glm::length(sum) <= minBend * float(around(point).size());
}

bool SharpEdges::edgesRecede(const SurfacePoints& points, std::uint32_t point, const glm::vec3& direction) const {
    const auto recedes = [&](std::uint32_t e) {
        const SharpEdge& edge = edges_[e];
        const std::uint32_t next = edge.otherEnd(point);
        const glm::vec3 along = points.points()[next].position - points.points()[point].position;
        return glm::dot(along, direction) <= level * glm::length(along) &&
               glm::dot(edge.conormals[0], direction) <= level && glm::dot(edge.conormals[1], direction) <= level;
    };
    const auto edges = around(point);
    return !edges.empty() && std::all_of(edges.begin(), edges.end(), recedes);
}

bool SharpEdges::pointsRecede(const SurfacePoints& points, std::uint32_t point, const glm::vec3& direction) const {
    const glm::vec3 vertex = points.points()[point].position;
    int found = 0;
    bool recede = true;
    points.visit([&](const glm::vec3& centre,
                     float radius) { return !recede || glm::distance(centre, vertex) > radius + neighbourDistance_; },
                 [&](std::uint32_t other, const SurfacePoint& there) {
                     const glm::vec3 offset = there.position - vertex;
                     const float distance = glm::length(offset);
                     if (other == point || distance > neighbourDistance_) return;
                     ++found;
                     recede = recede && glm::dot(offset, direction) <= level * distance;
                 });
    return recede && found >= minAround;
}

std::optional<SharpEdges::Crossing> SharpEdges::crossing(const SurfacePoints& points, const glm::vec3& from,
                                                         const glm::vec3& to, const Conormals& conormals,
                                                         const glm::vec3& place, float distance,
                                                         float voxelSize) const {
    if (edges_.empty()) return std::nullopt;
    const glm::vec3 along = to - from;
    const float within = crossingWithin * voxelSize,
                minDistance = std::min(maxDepthFactor_ * distance, distance - maxExcessDepth_ * voxelSize);
    const float reach = within + maxLength_;
    std::optional<Crossing> best;
    float nearest = within;
    const auto consider = [&](const SharpEdge& edge) {
        const SurfacePoint &a = points.points()[edge.from], &b = points.points()[edge.to];
        const glm::vec3 thisAlong = b.position - a.position, across = glm::cross(along, thisAlong);
        const float area = glm::length(across);
        if (area < minCrossing * glm::length(along) * glm::length(thisAlong)) return;
        // The closest points of the two lines.
        const glm::vec3 offset = a.position - from;
        const float onOther = glm::dot(glm::cross(offset, thisAlong), across) / (area * area);
        const float onThis = glm::dot(glm::cross(offset, along), across) / (area * area);
        if (onOther < 0 || onOther > 1 || onThis < -endTolerance || onThis > 1 + endTolerance) return;
        const glm::vec3 there = from + onOther * along, here = a.position + onThis * thisAlong;
        const float distanceFromPlace = glm::distance(there, place);
        const glm::vec3 normal = (glm::dot(across, a.normal + b.normal) < 0 ? -1.f : 1.f) / area * across;
        if (distanceFromPlace > nearest) return;
        for (int i = 0; i < 2; ++i)
            if (glm::dot(normal, edge.conormals[i]) > -minLeaving || glm::dot(normal, conormals[i]) < minLeaving)
                return;
        const float distance = glm::dot(there - here, normal);
        if (distance < minDistance) return;
        nearest = distanceFromPlace;
        best = Crossing{here, normal, distance};
    };
    points.visit([&](const glm::vec3& centre, float radius) { return glm::distance(centre, place) > radius + reach; },
                 [&](std::uint32_t index, const SurfacePoint& point) {
                     if (!point.isSharp) return;
                     for (const std::uint32_t e : around(index))
                         if (edges_[e].from == index) consider(edges_[e]);
                 });
    return best;
}

}  // namespace bilayer::detail
