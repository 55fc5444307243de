// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/open_surface/face_contacts.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

#include "collider/contact/body/collider_data.h"
#include "collider/contact/search/normal_filter.h"
#include "collider/contact/shapes/nearest_on_triangle.h"
#include "sdf/base/access.h"

namespace bilayer::detail {

namespace {

// Small triangles whose planes enclose less than 108 degrees have no crease that a convex vertex could be below
// (tangent).
constexpr float maxCreaseSlope = 3;

}  // namespace

void FaceContacts::visitLarge(std::uint32_t triangle) {
    std::optional<TriangleFace> face = TriangleFace::of(triangles_[triangle]);
    if (!face) return;
    face->findNeighbours(triangles_.adjacency(), triangle);
    const float scale = field_.placed.scale, rounding = onFace * field_.spacing;
    const auto isOutside = [&](const glm::vec3& place, float distance) {
        return face->isOutsideAboveCreases(place, distance) || face->heightOf(place) > field_.reach + distance;
    };
    const auto reject = [&](const glm::vec3& centre, float radius) {
        return isOutside(scale * centre, scale * radius + rounding);
    };
    const SurfacePoints& points = dataOf(field_.placed.collider).points();
    points.visit(reject, [&](std::uint32_t index, const SurfacePoint& point) {
        if (point.isInner || isOutside(scale * point.position, rounding)) return;
        if (const auto contact = contactOver(*face, true, index, point))
            found_.push_back({index, triangles_.id(triangle), *contact});
    });
}

void FaceContacts::visitSmall(const std::vector<std::uint32_t>& triangles) {
    if (triangles.empty()) return;
    const std::vector<SharpVertex> vertices = sharpVerticesNear(triangles);
    const auto isBefore = [](const SharpVertex& one, float x) { return one.place.x < x; };
    for (const std::uint32_t triangle : triangles) {
        const Triangle& corners = triangles_[triangle];
        const float radius = field_.reach + field_.spacing;
        std::optional<TriangleFace> face;
        auto at = std::lower_bound(vertices.begin(), vertices.end(), corners[0].x - radius, isBefore);
        for (; at != vertices.end() && at->place.x <= corners[0].x + radius; ++at) {
            if (glm::distance(at->place, corners[0]) > radius) continue;
            if (!face) face = TriangleFace::of(corners);
            if (!face) break;
            visitSmall(triangle, *face, *at);
        }
    }
}

void FaceContacts::visitSmall(std::uint32_t triangle, TriangleFace& face, const SharpVertex& vertex) {
    const SurfacePoint& point = dataOf(field_.placed.collider).points().points()[vertex.index];
    const glm::vec3 normal = face.normalFacing(point);
    if (glm::dot(normal, face.corners[0] - vertex.place) > field_.margin) return;
    const float height = face.heightOf(vertex.place), rounding = onFace * field_.spacing;
    if (height > field_.reach || face.isOutside(vertex.place, rounding + maxCreaseSlope * height)) return;
    if (face.isOutside(vertex.place, rounding)) {
        face.findNeighbours(triangles_.adjacency(), triangle);
        if (face.isOutsideAboveCreases(vertex.place, rounding)) return;
    }
    if (!height_.isConvexVertex(vertex.index, normal)) return;
    if (const auto contact = contactOver(face, false, vertex.index, point))
        found_.push_back({vertex.index, triangles_.id(triangle), *contact});
}

/// The field's sharp vertices near small triangles, sorted by x.
std::vector<FaceContacts::SharpVertex> FaceContacts::sharpVerticesNear(
    const std::vector<std::uint32_t>& triangles) const {
    glm::vec3 lower = triangles_[triangles.front()][0], upper = lower;
    for (const std::uint32_t triangle : triangles) {
        lower = glm::min(lower, triangles_[triangle][0]);
        upper = glm::max(upper, triangles_[triangle][0]);
    }
    const glm::vec3 middle = 0.5f * (lower + upper), half = 0.5f * (upper - lower) + field_.reach + field_.spacing;
    const float scale = field_.placed.scale;
    const auto reject = [&](const glm::vec3& centre, float radius) {
        return glm::any(glm::greaterThan(glm::abs(scale * centre - middle), half + scale * radius));
    };
    const ColliderData& data = dataOf(field_.placed.collider);
    std::vector<SharpVertex> vertices;
    data.points().visit(reject, [&](std::uint32_t index, const SurfacePoint& point) {
        if (point.isSharp && !point.isInner && !data.edges().isWithinEdge(data.points(), index))
            vertices.push_back({scale * point.position, index});
    });
    std::sort(vertices.begin(), vertices.end(), [](const SharpVertex& a, const SharpVertex& b) {
        return a.place.x < b.place.x || (a.place.x == b.place.x && a.index < b.index);
    });
    return vertices;
}

/// The contact of a surface point with the face under it. A foot that is much nearer to other triangles belongs to
/// them.
/// @param probesFoot  whether to test the field at the foot where the height is not exact
std::optional<Contact> FaceContacts::contactOver(const TriangleFace& face, bool probesFoot, std::uint32_t index,
                                                 const SurfacePoint& point) {
    const glm::vec3 place = field_.placed.scale * point.position;
    const glm::vec3 foot = nearestOnTriangle(place, face.corners[0], face.corners[1], face.corners[2]);
    const glm::vec3 normal = face.normalFacing(point);
    const float height = glm::dot(foot - place, normal);
    if (face.isOutside(place, onFace * field_.spacing)) return contactBelowCrease(face, index, normal, height);
    const LocalField::FieldSample there = field_.local.at(foot);
    const bool isFar = std::abs(height) > std::abs(there.distance) + field_.spacing + field_.local.maxDisplacement();
    if (isFar && !(point.isSharp && height < 0)) return std::nullopt;
    if (reaches(face, place, normal, height) && height_.isExact(index, normal, height, there))
        return contactAt(place, normal, height);
    if (isFar || !probesFoot) return std::nullopt;
    if (glm::dot(point.normal, normal) < minFacing || !height_.hasEdgeNear(foot, there.normal, normal))
        return std::nullopt;
    return contactAtFoot(foot, normal, there);
}

/// Whether a point over a face is within the margin of it, or meets it in the step.
bool FaceContacts::reaches(const TriangleFace& face, const glm::vec3& place, const glm::vec3& normal,
                           float height) const {
    if (height <= field_.margin) return true;
    const glm::vec3 foot = place + height * normal;
    const float approach = field_.local.approach(foot, normal, field_.margin);
    if (!(height <= approach)) return false;
    return !face.isOutside(place - height / approach * field_.local.relativeMotion().of(foot), onFace * field_.spacing);
}

/// The contact of a convex vertex that has penetrated an open surface next to a crease. It lies over neither triangle,
/// and entered from above both.
std::optional<Contact> FaceContacts::contactBelowCrease(const TriangleFace& face, std::uint32_t index,
                                                        const glm::vec3& normal, float height) {
    const SurfacePoint& point = dataOf(field_.placed.collider).points().points()[index];
    if (height >= 0 || !height_.isConvexVertex(index, normal)) return std::nullopt;
    const glm::vec3 place = field_.placed.scale * point.position;
    float distance = FaceHeight::distanceAlongAxis(point, normal, height), deepest = height;
    for (int i = 0; i < 3; ++i) {
        const glm::vec3 from = place - face.corners[i];
        if (!(glm::dot(face.outwards[i], from) > onFace * field_.spacing)) continue;
        const glm::vec3 along = face.corners[(i + 1) % 3] - face.corners[i];
        const glm::vec3 across = glm::normalize(glm::cross(along, *face.outwardsOfOthers[i]));
        const glm::vec3 other = glm::dot(across, point.normal) < 0 ? -across : across;
        const float below = -glm::dot(from, other);
        if (below >= 0) return std::nullopt;
        distance = std::max(distance, FaceHeight::distanceAlongAxis(point, other, below));
        deepest = std::min(deepest, below);
    }
    if (!height_.hasPenetrated(point, normal, deepest, distance)) return std::nullopt;
    return contactAt(place, normal, height);
}

/// The contact of a surface point with a plane.
Contact FaceContacts::contactAt(const glm::vec3& place, const glm::vec3& normal, float height) {
    ++report_.pointsTested;
    const glm::vec3 foot = place + height * normal;
    return field_.local.contact(place, normal, height, 0, field_.local.approach(foot, normal, field_.margin), 0);
}

/// The contact of the face as the field at the foot gives it. An oblique normal there means that the body is next to
/// the face. The exception is a touching foot: there an edge or a vertex has no direction of its own.
std::optional<Contact> FaceContacts::contactAtFoot(const glm::vec3& foot, const glm::vec3& normal,
                                                   const LocalField::FieldSample& there) {
    std::optional<Contact> contact = field_.local.probe(foot, there, 0, 0, field_.margin, report_);
    if (!contact) return std::nullopt;
    const bool isSeparated = !(std::abs(there.distance) <= touchingDistanceVoxels * field_.voxel);
    const glm::quat& rotation = field_.placed.pose.rotation;
    const auto facesEdge = [&] {
        const auto holdsAt = [&](const glm::vec3& place, auto&& test) { return test(field_.local.at(place).normal); };
        return there.distance > 0 && facesEdgeObliquely(foot, -normal, there.distance, there.normal, holdsAt);
    };
    if (!passesNormalFilter(field_.options, contact->normal, -(rotation * normal),
                            rotation * field_.local.relativeMotion().rotation(), isSeparated, facesEdge))
        return std::nullopt;
    setNormal(*contact, field_, normal);
    contact->roundingRadius = -1;  // it stays below the point
    return contact;
}

void FaceContacts::take(std::vector<Contact>& contacts) {
    const auto isEarlier = [](const OverFace& a, const OverFace& b) { return a.point < b.point; };
    std::stable_sort(found_.begin(), found_.end(), isEarlier);
    for (auto first = found_.begin(); first != found_.end();) {
        const auto last = std::upper_bound(first, found_.end(), *first, isEarlier);
        const bool isAlone = last - first == 1;
        for (; first != last; ++first) {
            first->contact.feature =
                (isAlone ? first->point
                         : NearbyTriangles::featureOf(first->face, NearbyTriangles::facePart + first->point)) |
                featureOfB;
            contacts.push_back(first->contact);
        }
    }
}

}  // namespace bilayer::detail
