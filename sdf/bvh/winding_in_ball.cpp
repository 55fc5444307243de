// SPDX-License-Identifier: Apache-2.0
#include "sdf/bvh/winding_in_ball.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <span>

#include "sdf/bvh/solid_angle.h"

namespace bilayer::detail {
namespace {

/// A cluster is far if its radius and the ball's are at most this share of the distance of their centres. The bound of
/// its error is then at most a seventh of the solid angle that it can fill.
constexpr double farRatio = 0.25;
/// A cluster is expanded for each point if its radius is at most this share of its distance from the ball.
constexpr double clusterRatio = 0.35;
/// Maximum error of a triangle as a dipole.
constexpr double dipoleError = 3e-4;

// Returns m u.
glm::dvec3 times(const Symmetric2& m, const glm::dvec3& u) {
    return {m[0] * u.x + m[3] * u.y + m[5] * u.z, m[3] * u.x + m[1] * u.y + m[4] * u.z,
            m[5] * u.x + m[4] * u.y + m[2] * u.z};
}

bool isFar(double clusterRadius, double distance, double radius) {
    return clusterRadius + radius < farRatio * distance;
}

}  // namespace

WindingInBall::WindingInBall(const WindingNumber& winding, const glm::dvec3& centre, double radius)
    : winding_(winding), centre_(centre) {
    const auto isSettled = [&](const Node& node) {
        const glm::dvec3 toCentre = node.centre - centre;
        const double distance = glm::length(toCentre);
        const bool far = isFar(node.radius, distance, radius);
        const bool isCluster = !far && node.radius < clusterRatio * (distance - radius);
        if (far) addFar(node, toCentre, radius);
        if (isCluster) clusters_.push_back(&node);
        return far || isCluster;
    };
    winding.tree_.forEachLeaf(isSettled, [&](const Node& leaf) {
        addTriangles(leaf, radius);
        return true;
    });
    clusterBound_ = clusterBound(radius);
}

// The kernel of WindingCluster about a triangle's centre: its term of first order integrates to 0, and those of order
// k - 1 > 1 are at most k t^(k - 1) / R^2 with t = radius / R < 1/4, in sum less than 5 t^2 / R^2.
void WindingInBall::addTriangles(const Node& leaf, double radius) {
    for (std::uint32_t i = leaf.begin; i < leaf.end; ++i) {
        const Corners& t = winding_.triangles_[i];
        const glm::dvec3 a(t[0]), b(t[1]), c(t[2]), centre = (a + b + c) / 3.0;
        const glm::dvec3 normal = glm::cross(b - a, c - a) / (8 * glm::pi<double>());
        const double area = glm::length(normal);
        const double squared = std::max(
            {glm::dot(a - centre, a - centre), glm::dot(b - centre, b - centre), glm::dot(c - centre, c - centre)});
        if (const glm::dvec3 toCentre = centre - centre_; isFar(std::sqrt(squared), glm::length(toCentre), radius)) {
            addFar(WindingCluster(std::span(&t, 1)), toCentre, radius);
            continue;
        }
        const double error = 5 * squared * area, reach = std::max(16 * squared, std::sqrt(error / dipoleError));
        triangles_.push_back({centre, normal, area, squared, reach, error, &t});
    }
}

// A displacement d of the point is one of -d of all triangles: the moments of the cluster about its centre, less d, are
// polynomials in d, and so is the expansion of WindingCluster. Its bound holds for |s - d| in place of |s|, whose
// square integrates to at most (sqrt(spread) + radius sqrt(area))^2.
void WindingInBall::addFar(const WindingCluster& node, const glm::dvec3& toCentre, double radius) {
    const double squared = glm::dot(toCentre, toCentre), distance = std::sqrt(squared);
    const double t = (node.radius + radius) / distance, unit = 1 / (4 * glm::pi<double>() * squared);
    const double spread = std::sqrt(node.spread) + radius * std::sqrt(node.area);
    far_.error += unit * spread * spread / squared * t * (4 - 3 * t) / ((1 - t) * (1 - t));
    far_.value += node.expansion(centre_).value;
    const glm::dvec3 u = toCentre / distance, mu = times(node.moment, u);
    const double au = glm::dot(node.vectorArea, u), umu = glm::dot(u, mu);
    const double sum = node.moment[0] + node.moment[1] + node.moment[2];
    slope_ +=
        unit / distance * (3 * au * u - node.vectorArea) + unit / squared * (6.0 * mu + 3 * sum * u - 15 * umu * u);
    const double scale = unit / squared;
    add(curvature_, product(u, u), 7.5 * au * scale);
    add(curvature_, product(node.vectorArea, u), -3 * scale);
    for (std::size_t axis = 0; axis < 3; ++axis) curvature_[axis] -= 1.5 * au * scale;
}

WindingNumber::Estimate WindingInBall::farEstimate(const glm::dvec3& point) const {
    const glm::dvec3 d = point - centre_;
    return {far_.value + glm::dot(d, slope_ + times(curvature_, d)), far_.error};
}

// A surface of area A that is nowhere closer than d fills at most A / (4 pi d^2) of all directions. From two radii
// away and more, as from all clusters, d is at least half the distance from the centre.
double WindingInBall::clusterBound(double radius) const {
    double bound = 0;
    for (const Node* cluster : clusters_) {
        const double away = glm::length(cluster->centre - centre_) - radius;
        bound += cluster->area / (glm::pi<double>() * away * away);
    }
    return bound;
}

WindingNumber::Estimate WindingInBall::coarseEstimate(const glm::dvec3& point) const {
    WindingNumber::Estimate sum = farEstimate(point);
    sum.error += clusterBound_;
    for (const NearTriangle& triangle : triangles_) {
        const glm::dvec3 away = triangle.centre - point;
        const double squared = glm::dot(away, away);
        sum.error += squared > 4 * triangle.squaredRadius ? 4 * triangle.area / squared : 0.5;
    }
    return sum;
}

WindingNumber::Estimate WindingInBall::estimate(const glm::dvec3& point) const {
    WindingNumber::Estimate sum = farEstimate(point);
    for (const Node* cluster : clusters_) {
        const WindingNumber::Estimate part = cluster->expansion(point);
        sum.value += part.value;
        sum.error += part.error;
    }
    for (const NearTriangle& triangle : triangles_) {
        const glm::dvec3 toCentre = triangle.centre - point;
        const double squared = glm::dot(toCentre, toCentre);
        if (squared > triangle.squaredReach) {
            sum.value += glm::dot(triangle.normal, toCentre) / (squared * std::sqrt(squared));
            sum.error += triangle.error / (squared * squared);
            continue;
        }
        const Corners& t = *triangle.corners;
        const SolidAngle angle =
            solidAngle(glm::dvec3(t[0]) - point, glm::dvec3(t[1]) - point, glm::dvec3(t[2]) - point);
        sum.value += angle.value / (4 * glm::pi<double>());
        sum.error += angle.jumps ? 1 : 0;
    }
    return sum;
}

}  // namespace bilayer::detail
