#include "integration/bullet/detail/multisphere.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

namespace bilayer::bullet::detail {

namespace {

// Tolerance for rounding: spheres may protrude from a plane by this fraction of the hull's size.
constexpr float rounding = 1e-5f;
// Minimum squared cosine between a cone and its axis; one sphere then contains the other up to rounding.
constexpr double minSquare = 1e-12;

glm::dvec3 squareTo(const glm::dvec3& axis) {
    const glm::dvec3 away = std::abs(axis.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
    return glm::normalize(glm::cross(axis, away));
}

}  // namespace

MultisphereHull::MultisphereHull(std::vector<Ball> balls) {
    for (std::size_t i = 0; i < balls.size(); ++i) {
        const auto holds = [&](std::size_t j) {
            const float room = balls[j].radius - balls[i].radius;
            const float apart = glm::distance(balls[i].centre, balls[j].centre);
            // of two equal spheres, the first one stays
            return j != i && apart <= room && (apart < room || j < i || room > 0);
        };
        bool isHeld = false;
        for (std::size_t j = 0; j < balls.size(); ++j) isHeld |= holds(j);
        if (!isHeld) balls_.push_back(balls[i]);
    }
    minRadius_ = std::numeric_limits<float>::max();
    for (const Ball& ball : balls_) {
        minRadius_ = std::min(minRadius_, ball.radius);
        size_ = std::max(size_, ball.radius + glm::distance(ball.centre, balls_.front().centre));
    }
    const auto count = static_cast<std::uint32_t>(balls_.size());
    for (std::uint32_t i = 0; i < count; ++i)
        for (std::uint32_t j = i + 1; j < count; ++j) {
            pairs_.emplace_back(i, j);
            for (std::uint32_t k = j + 1; k < count; ++k) addPlanes(i, j, k);
        }
}

/// Adds those of the two tangent planes of three spheres that have all other spheres below them.
void MultisphereHull::addPlanes(std::uint32_t i, std::uint32_t j, std::uint32_t k) {
    const glm::dvec3 from(balls_[i].centre), u = glm::dvec3(balls_[j].centre) - from,
                                             v = glm::dvec3(balls_[k].centre) - from;
    const glm::dvec3 square = glm::cross(u, v);
    const double area = glm::length(square);
    if (area <= rounding * size_ * size_) return;
    // Along each side, the height over the plane falls by the difference of the radii.
    const double a = double(balls_[i].radius) - balls_[j].radius, b = double(balls_[i].radius) - balls_[k].radius;
    const glm::dvec3 along = (a * glm::cross(v, square) + b * glm::cross(square, u)) / (area * area);
    const double rest = 1 - glm::dot(along, along);
    if (rest <= 0) return;
    for (const double side : {-1., 1.}) {
        const glm::dvec3 normal = along + side * std::sqrt(rest) * (square / area);
        const double offset = glm::dot(normal, from) + balls_[i].radius;
        const auto below = [&](const Ball& ball) {
            return glm::dot(normal, glm::dvec3(ball.centre)) + ball.radius <= offset + rounding * size_;
        };
        if (std::all_of(balls_.begin(), balls_.end(), below)) planes_.push_back({normal, offset, {i, j, k}});
    }
}

MultisphereHull::Candidate MultisphereHull::aroundBall(const Ball& ball, const glm::dvec3& point) const {
    const glm::dvec3 centre(ball.centre);
    const double length = glm::distance(point, centre);
    return {length - ball.radius, length > 0 ? (point - centre) / length : glm::dvec3(0, 0, 1), centre, ball.radius};
}

/// Nearest point on the surface of the spheres between two spheres.
MultisphereHull::Candidate MultisphereHull::aroundPair(const Ball& from, const Ball& to,
                                                       const glm::dvec3& point) const {
    const glm::dvec3 start(from.centre), between = glm::dvec3(to.centre) - start;
    const double length = glm::length(between), growth = double(to.radius) - from.radius;
    const glm::dvec3 axis = between / length, way = point - start;
    const double along = glm::dot(way, axis);
    const glm::dvec3 aside = way - along * axis;
    const double out = glm::length(aside);
    // The normal is inclined towards the smaller sphere.
    const double sine = -growth / length, cosine = std::sqrt(std::max(1 - sine * sine, minSquare));
    const double part = (along - out * sine / cosine) / length;
    if (part <= 0) return aroundBall(from, point);
    if (part >= 1) return aroundBall(to, point);
    const glm::dvec3 centre = start + part * between,
                     normal = cosine * (out > 0 ? aside / out : squareTo(axis)) + sine * axis;
    const double radius = from.radius + part * growth;
    return {glm::dot(point - centre, normal) - radius, normal, centre, radius};
}

MultisphereHull::Near MultisphereHull::nearest(const glm::vec3& place) const {
    const glm::dvec3 point(place);
    Candidate best = aroundBall(balls_.front(), point);
    const auto consider = [&](const Candidate& candidate) {
        if (candidate.distance < best.distance) best = candidate;
    };
    for (const Ball& ball : balls_) consider(aroundBall(ball, point));
    for (const auto& [i, j] : pairs_) consider(aroundPair(balls_[i], balls_[j], point));
    for (const Plane& plane : planes_) {
        const double distance = glm::dot(plane.normal, point) - plane.offset;
        if (distance >= best.distance) continue;
        const Ball &a = balls_[plane.corners[0]], &b = balls_[plane.corners[1]], &c = balls_[plane.corners[2]];
        const glm::dvec3 from(a.centre), u = glm::dvec3(b.centre) - from, v = glm::dvec3(c.centre) - from,
                                         square = glm::cross(u, v);
        // The line along the normal through the plane of the centres: the tangent plane is on the hull only between the
        // centres.
        const double way = glm::dot(point - from, square) / glm::dot(plane.normal, square);
        const glm::dvec3 foot = point - way * plane.normal - from;
        const double area = glm::dot(square, square);
        const double atB = glm::dot(glm::cross(foot, v), square) / area;
        const double atC = glm::dot(glm::cross(u, foot), square) / area;
        if (way < 0 || atB < 0 || atC < 0 || atB + atC > 1) continue;
        const double radius = a.radius + atB * (b.radius - a.radius) + atC * (c.radius - a.radius);
        best = {distance, plane.normal, from + foot, radius};
    }
    // Between four or more spheres, the point may be inside although none of the above is near.
    const bool isOutside = best.distance >= 0 && along(best.normal, point) >= best.distance - rounding * size_;
    if (!isOutside && !planes_.empty()) best = inside(point);
    return {float(best.distance), glm::vec3(best.normal), {glm::vec3(best.centre), float(best.radius)}};
}

/// The distance from a point to the hull's support plane in a direction.
double MultisphereHull::along(const glm::dvec3& direction, const glm::dvec3& point) const {
    double least = std::numeric_limits<double>::max();
    for (const Ball& ball : balls_)
        least = std::min(least, glm::dot(direction, point - glm::dvec3(ball.centre)) - ball.radius);
    return least;
}

/// Inside: the shortest depenetration is along the normal of a sphere, a cone or a plane.
MultisphereHull::Candidate MultisphereHull::inside(const glm::dvec3& point) const {
    Candidate best{-std::numeric_limits<double>::max(), {0, 0, 1}, point, minRadius_};
    const auto consider = [&](const glm::dvec3& normal) {
        const double distance = along(normal, point);
        if (distance > best.distance) best.distance = distance, best.normal = normal;
    };
    for (const Ball& ball : balls_) consider(aroundBall(ball, point).normal);
    for (const auto& [i, j] : pairs_) consider(aroundPair(balls_[i], balls_[j], point).normal);
    for (const Plane& plane : planes_) consider(plane.normal);
    best.centre = point - (best.distance + minRadius_) * best.normal;
    return best;
}

}  // namespace bilayer::bullet::detail
