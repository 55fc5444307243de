// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/shapes/multisphere.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

namespace bilayer::detail {

namespace {

// Tolerance for rounding: spheres may protrude from a plane by this fraction of the hull's size.
constexpr float sizeRounding = 1e-5f;
// Minimum squared cosine between a cone and its axis; one sphere then contains the other up to rounding.
constexpr double minSquaredCosine = 1e-12;

glm::dvec3 perpendicularAxis(const glm::dvec3& axis) {
    const glm::dvec3 other = std::abs(axis.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
    return glm::normalize(glm::cross(axis, other));
}

}  // namespace

MultisphereHull::MultisphereHull(std::vector<SphereOfHull> spheres) {
    for (std::size_t i = 0; i < spheres.size(); ++i) {
        const auto isContainedIn = [&](std::size_t j) {
            const float excess = spheres[j].radius - spheres[i].radius;
            const float separation = glm::distance(spheres[i].centre, spheres[j].centre);
            // of two equal spheres, the first one stays
            return j != i && separation <= excess && (separation < excess || j < i || excess > 0);
        };
        bool isContained = false;
        for (std::size_t j = 0; j < spheres.size(); ++j) isContained |= isContainedIn(j);
        if (isContained) continue;
        spheres_.push_back(spheres[i]);
        vertices_.push_back(spheres[i].centre);
    }
    minRadius_ = std::numeric_limits<float>::max();
    for (const SphereOfHull& sphere : spheres_) {
        minRadius_ = std::min(minRadius_, sphere.radius);
        size_ = std::max(size_, sphere.radius + glm::distance(sphere.centre, spheres_.front().centre));
    }
    const auto count = static_cast<std::uint32_t>(spheres_.size());
    for (std::uint32_t i = 0; i < count; ++i)
        for (std::uint32_t j = i + 1; j < count; ++j) {
            edges_.push_back({i, j, 0});
            for (std::uint32_t k = j + 1; k < count; ++k) addPlanes(i, j, k);
        }
}

/// Adds those of the two tangent planes of three spheres that have all other spheres below them.
void MultisphereHull::addPlanes(std::uint32_t i, std::uint32_t j, std::uint32_t k) {
    const glm::dvec3 from(spheres_[i].centre), u = glm::dvec3(spheres_[j].centre) - from,
                                               v = glm::dvec3(spheres_[k].centre) - from;
    const glm::dvec3 square = glm::cross(u, v);
    const double area = glm::length(square);
    if (area <= sizeRounding * size_ * size_) return;
    // Along each side, the height over the plane falls by the difference of the radii.
    const double a = double(spheres_[i].radius) - spheres_[j].radius,
                 b = double(spheres_[i].radius) - spheres_[k].radius;
    const glm::dvec3 along = (a * glm::cross(v, square) + b * glm::cross(square, u)) / (area * area);
    const double rest = 1 - glm::dot(along, along);
    if (rest <= 0) return;
    for (const double side : {-1., 1.}) {
        const glm::dvec3 normal = along + side * std::sqrt(rest) * (square / area);
        const double offset = glm::dot(normal, from) + spheres_[i].radius;
        const auto below = [&](const SphereOfHull& sphere) {
            return glm::dot(normal, glm::dvec3(sphere.centre)) + sphere.radius <= offset + sizeRounding * size_;
        };
        if (std::all_of(spheres_.begin(), spheres_.end(), below)) planes_.push_back({normal, offset, {i, j, k}});
    }
}

MultisphereHull::Candidate MultisphereHull::aroundSphere(const SphereOfHull& sphere, const glm::dvec3& point) const {
    const glm::dvec3 centre(sphere.centre);
    const double length = glm::distance(point, centre);
    return {length - sphere.radius, length > 0 ? (point - centre) / length : glm::dvec3(0, 0, 1), centre,
            sphere.radius};
}

/// Nearest point on the surface of the spheres between two spheres.
MultisphereHull::Candidate MultisphereHull::aroundPair(const SphereOfHull& from, const SphereOfHull& to,
                                                       const glm::dvec3& point) const {
    const glm::dvec3 start(from.centre), between = glm::dvec3(to.centre) - start;
    const double length = glm::length(between), growth = double(to.radius) - from.radius;
    const glm::dvec3 axis = between / length, offset = point - start;
    const double along = glm::dot(offset, axis);
    const glm::dvec3 radial = offset - along * axis;
    const double out = glm::length(radial);
    // The normal is inclined towards the smaller sphere.
    const double sine = -growth / length, cosine = std::sqrt(std::max(1 - sine * sine, minSquaredCosine));
    const double part = (along - out * sine / cosine) / length;
    if (part <= 0) return aroundSphere(from, point);
    if (part >= 1) return aroundSphere(to, point);
    const glm::dvec3 centre = start + part * between,
                     normal = cosine * (out > 0 ? radial / out : perpendicularAxis(axis)) + sine * axis;
    const double radius = from.radius + part * growth;
    return {glm::dot(point - centre, normal) - radius, normal, centre, radius};
}

NearestPoint MultisphereHull::nearest(const glm::vec3& place, float) const {
    const glm::dvec3 point(place);
    Candidate best = aroundSphere(spheres_.front(), point);
    const auto consider = [&](const Candidate& candidate) {
        if (candidate.distance < best.distance) best = candidate;
    };
    for (const SphereOfHull& sphere : spheres_) consider(aroundSphere(sphere, point));
    for (const ConvexEdge& edge : edges_) consider(aroundPair(spheres_[edge.from], spheres_[edge.to], point));
    for (const TangentPlane& plane : planes_) {
        const double distance = glm::dot(plane.normal, point) - plane.offset;
        if (distance >= best.distance) continue;
        const SphereOfHull &a = spheres_[plane.corners[0]], &b = spheres_[plane.corners[1]],
                           &c = spheres_[plane.corners[2]];
        const glm::dvec3 from(a.centre), u = glm::dvec3(b.centre) - from, v = glm::dvec3(c.centre) - from,
                                         square = glm::cross(u, v);
        // The line along the normal through the plane of the centres: the tangent plane is on the hull only between the
        // centres.
        const double height = glm::dot(point - from, square) / glm::dot(plane.normal, square);
        const glm::dvec3 foot = point - height * plane.normal - from;
        const double area = glm::dot(square, square);
        const double atB = glm::dot(glm::cross(foot, v), square) / area;
        const double atC = glm::dot(glm::cross(u, foot), square) / area;
        if (height < 0 || atB < 0 || atC < 0 || atB + atC > 1) continue;
        const double radius = a.radius + atB * (b.radius - a.radius) + atC * (c.radius - a.radius);
        best = {distance, plane.normal, from + foot, radius};
    }
    // Between four or more spheres, the point may be inside although none of the above is near.
    const bool isOutside = best.distance >= 0 && along(best.normal, point) >= best.distance - sizeRounding * size_;
    if (!isOutside && !planes_.empty()) best = inside(point);
    return {float(best.distance), glm::vec3(best.normal), glm::vec3(best.centre), float(best.radius)};
}

glm::vec3 MultisphereHull::support(const glm::vec3& direction) const {
    const float length = glm::length(direction);
    const auto height = [&](const SphereOfHull& sphere) {
        return glm::dot(direction, sphere.centre) + length * sphere.radius;
    };
    const SphereOfHull& farthest =
        *std::max_element(spheres_.begin(), spheres_.end(),
                          [&](const SphereOfHull& a, const SphereOfHull& b) { return height(a) < height(b); });
    return length > 0 ? farthest.centre + farthest.radius / length * direction : farthest.centre;
}

/// The distance from a point to the hull's support plane in a direction.
double MultisphereHull::along(const glm::dvec3& direction, const glm::dvec3& point) const {
    double minDistance = std::numeric_limits<double>::max();
    for (const SphereOfHull& sphere : spheres_)
        minDistance = std::min(minDistance, glm::dot(direction, point - glm::dvec3(sphere.centre)) - sphere.radius);
    return minDistance;
}

/// Inside: the shortest depenetration is along the normal of a sphere, a cone or a plane.
MultisphereHull::Candidate MultisphereHull::inside(const glm::dvec3& point) const {
    Candidate best{-std::numeric_limits<double>::max(), {0, 0, 1}, point, minRadius_};
    const auto consider = [&](const glm::dvec3& normal) {
        const double distance = along(normal, point);
        if (distance > best.distance) best.distance = distance, best.normal = normal;
    };
    for (const SphereOfHull& sphere : spheres_) consider(aroundSphere(sphere, point).normal);
    for (const ConvexEdge& edge : edges_) consider(aroundPair(spheres_[edge.from], spheres_[edge.to], point).normal);
    for (const TangentPlane& plane : planes_) consider(plane.normal);
    best.centre = point - (best.distance + minRadius_) * best.normal;
    return best;
}

}  // namespace bilayer::detail
