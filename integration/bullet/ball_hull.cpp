#include "integration/bullet/ball_hull.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

namespace bilayer::bullet {

namespace {

// Balls may stand out of a plane by this part of the hull's size: rounding.
constexpr float rounding = 1e-5f;

glm::vec3 squareTo(const glm::vec3& axis) {
    const glm::vec3 away = std::abs(axis.x) < 0.6f ? glm::vec3(1, 0, 0) : glm::vec3(0, 1, 0);
    return glm::normalize(glm::cross(axis, away));
}

}  // namespace

BallHull::BallHull(std::vector<Ball> balls) {
    for (std::size_t i = 0; i < balls.size(); ++i) {
        const auto holds = [&](std::size_t j) {
            const float room = balls[j].radius - balls[i].radius;
            const float apart = glm::distance(balls[i].centre, balls[j].centre);
            // of two that are the same, the first stays
            return j != i && apart <= room && (apart < room || j < i || room > 0);
        };
        bool isHeld = false;
        for (std::size_t j = 0; j < balls.size(); ++j) isHeld |= holds(j);
        if (!isHeld) balls_.push_back(balls[i]);
    }
    leastRadius_ = std::numeric_limits<float>::max();
    for (const Ball& ball : balls_) {
        leastRadius_ = std::min(leastRadius_, ball.radius);
        size_ = std::max(size_, ball.radius + glm::distance(ball.centre, balls_.front().centre));
    }
    const auto count = static_cast<std::uint32_t>(balls_.size());
    for (std::uint32_t i = 0; i < count; ++i)
        for (std::uint32_t j = i + 1; j < count; ++j) {
            pairs_.emplace_back(i, j);
            for (std::uint32_t k = j + 1; k < count; ++k) addPlanes(i, j, k);
        }
}

/// Those of the two planes on three balls that have all others below.
void BallHull::addPlanes(std::uint32_t i, std::uint32_t j, std::uint32_t k) {
    const glm::vec3 u = balls_[j].centre - balls_[i].centre, v = balls_[k].centre - balls_[i].centre;
    const glm::vec3 square = glm::cross(u, v);
    const float area = glm::length(square);
    if (area <= rounding * size_ * size_) return;
    // The normal n goes down by the difference of radii along each side.
    const float a = balls_[i].radius - balls_[j].radius, b = balls_[i].radius - balls_[k].radius;
    const glm::vec3 along = (a * glm::cross(v, square) + b * glm::cross(square, u)) / (area * area);
    const float rest = 1 - glm::dot(along, along);
    if (rest <= 0) return;
    for (const float side : {-1.f, 1.f}) {
        const glm::vec3 normal = along + side * std::sqrt(rest) * (square / area);
        const float offset = glm::dot(normal, balls_[i].centre) + balls_[i].radius;
        const auto below = [&](const Ball& ball) {
            return glm::dot(normal, ball.centre) + ball.radius <= offset + rounding * size_;
        };
        if (std::all_of(balls_.begin(), balls_.end(), below)) planes_.push_back({normal, offset, {i, j, k}});
    }
}

BallHull::Near BallHull::aroundBall(const Ball& ball, const glm::vec3& point) const {
    const float length = glm::distance(point, ball.centre);
    const glm::vec3 normal = length > 0 ? (point - ball.centre) / length : glm::vec3(0, 0, 1);
    return {length - ball.radius, normal, ball};
}

/// Against all balls between two.
BallHull::Near BallHull::aroundPair(const Ball& from, const Ball& to, const glm::vec3& point) const {
    const glm::vec3 between = to.centre - from.centre;
    const float length = glm::length(between);
    const glm::vec3 axis = between / length, way = point - from.centre;
    const float along = glm::dot(way, axis);
    const glm::vec3 aside = way - along * axis;
    const float out = glm::length(aside);
    // The normal leans towards the smaller ball.
    const float sine = (from.radius - to.radius) / length, cosine = std::sqrt(1 - sine * sine);
    const float part = std::clamp((along - out * sine / cosine) / length, 0.f, 1.f);
    const Ball ball{from.centre + part * between, from.radius + part * (to.radius - from.radius)};
    if (part <= 0 || part >= 1) return aroundBall(ball, point);
    const glm::vec3 normal = cosine * (out > 0 ? aside / out : squareTo(axis)) + sine * axis;
    return {glm::dot(point - ball.centre, normal) - ball.radius, normal, ball};
}

BallHull::Near BallHull::nearest(const glm::vec3& point) const {
    Near best = aroundBall(balls_.front(), point);
    const auto consider = [&](const Near& near) {
        if (near.distance < best.distance) best = near;
    };
    for (const Ball& ball : balls_) consider(aroundBall(ball, point));
    for (const auto& [i, j] : pairs_) consider(aroundPair(balls_[i], balls_[j], point));
    if (planes_.empty()) return best;
    for (const Plane& plane : planes_) {
        const float distance = glm::dot(plane.normal, point) - plane.offset;
        if (distance >= best.distance) continue;
        const Ball &a = balls_[plane.corners[0]], &b = balls_[plane.corners[1]], &c = balls_[plane.corners[2]];
        const glm::vec3 u = b.centre - a.centre, v = c.centre - a.centre, square = glm::cross(u, v);
        // Where the line along the normal meets the plane of the centres: only between them is the plane the hull's.
        const float way = glm::dot(point - a.centre, square) / glm::dot(plane.normal, square);
        const glm::vec3 foot = point - way * plane.normal - a.centre;
        const float area = glm::dot(square, square);
        const float atB = glm::dot(glm::cross(foot, v), square) / area;
        const float atC = glm::dot(glm::cross(u, foot), square) / area;
        if (way < 0 || atB < 0 || atC < 0 || atB + atC > 1) continue;
        const float radius = a.radius + atB * (b.radius - a.radius) + atC * (c.radius - a.radius);
        best = {distance, plane.normal, {a.centre + foot, radius}};
    }
    // Between four balls or more, none of the above is near though the point is inside.
    return best.distance >= 0 && along(best.normal, point) >= best.distance - rounding * size_ ? best : inside(point);
}

/// How far the hull lies below a point in a direction.
float BallHull::along(const glm::vec3& direction, const glm::vec3& point) const {
    float least = std::numeric_limits<float>::max();
    for (const Ball& ball : balls_) least = std::min(least, glm::dot(direction, point - ball.centre) - ball.radius);
    return least;
}

/// Of all directions in which the hull may be left, the shortest way out lies along a ball's, a cone's or a plane's.
BallHull::Near BallHull::inside(const glm::vec3& point) const {
    Near best{-std::numeric_limits<float>::max(), {0, 0, 1}, balls_.front()};
    const auto consider = [&](Near near) {
        near.distance = along(near.normal, point);
        if (near.distance > best.distance) best = near;
    };
    for (const Ball& ball : balls_) consider(aroundBall(ball, point));
    for (const auto& [i, j] : pairs_) consider(aroundPair(balls_[i], balls_[j], point));
    for (const Plane& plane : planes_) consider({0, plane.normal, {}});
    const glm::vec3 surface = point - best.distance * best.normal;
    best.ball = {surface - leastRadius_ * best.normal, leastRadius_};
    return best;
}

}  // namespace bilayer::bullet
