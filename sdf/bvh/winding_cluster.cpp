// SPDX-License-Identifier: Apache-2.0
#include "sdf/bvh/winding_cluster.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <limits>

namespace bilayer::detail {

WindingCluster::WindingCluster(std::span<const Corners> triangles)
    : radius(0), area(0), vectorArea(0), moment{}, moment2{}, spread(0) {
    glm::dvec3 weighted(0), plain(0);
    for (const Corners& t : triangles) {
        const glm::dvec3 a(t[0]), b(t[1]), c(t[2]), n = 0.5 * glm::cross(b - a, c - a), middle = (a + b + c) / 3.0;
        area += glm::length(n);
        vectorArea += n;
        weighted += glm::length(n) * middle;
        plain += middle;
    }
    centre = area > 0 ? weighted / area : plain / double(triangles.size());
    for (const Corners& t : triangles) {
        const glm::dvec3 a = glm::dvec3(t[0]) - centre, b = glm::dvec3(t[1]) - centre, c = glm::dvec3(t[2]) - centre;
        const glm::dvec3 n = 0.5 * glm::cross(b - a, c - a), s = (a + b + c) / 3.0;
        radius = std::max({radius, glm::length(a), glm::length(b), glm::length(c)});
        // The integral of x x^T over a triangle: area / 12 (a a^T + b b^T + c c^T + 9 s s^T).
        Symmetric2 second{};
        for (const glm::dvec3& corner : {a, b, c}) add(second, product(corner, corner), 1.0 / 12);
        add(second, product(s, s), 9.0 / 12);
        spread += glm::length(n) * (second[0] + second[1] + second[2]);
        add(moment, product(s, n));
        add(moment2, product(second, n));
    }
}

WindingCluster::WindingCluster(const WindingCluster& left, const WindingCluster& right, const Bounds& box)
    : area(left.area + right.area), vectorArea(left.vectorArea + right.vectorArea), moment{}, moment2{}, spread(0) {
    centre =
        area > 0 ? (left.area * left.centre + right.area * right.centre) / area : 0.5 * (left.centre + right.centre);
    double reach = 0;
    for (const WindingCluster* child : {&left, &right}) {
        const glm::dvec3 s = child->centre - centre;
        reach = std::max(reach, glm::length(s) + child->radius);
        spread += child->spread + child->area * glm::dot(s, s);
        add(moment, child->moment);
        add(moment, product(s, child->vectorArea));
        add(moment2, child->moment2);
        add(moment2, product(child->moment, s), 2);
        add(moment2, product(product(s, s), child->vectorArea));
    }
    const glm::dvec3 corner = glm::max(centre - glm::dvec3(box.lower), glm::dvec3(box.upper) - centre);
    radius = std::min(reach, glm::length(corner));
}

// The kernel n . (x - q) / |x - q|^3 is expanded in s = x - centre to second order. The term of order k - 1 is the
// gradient of a solid harmonic of degree k, at most k |s|^(k - 1) / R^(k + 1) (Bernstein's inequality), with R =
// |centre - q|. For |s| <= t R the truncated terms sum to at most t |s|^2 / R^4 (4 - 3 t) / (1 - t)^2.
WindingEstimate WindingCluster::expansion(const glm::dvec3& point) const {
    const glm::dvec3 toCentre = centre - point;
    const double squared = glm::dot(toCentre, toCentre), distance = std::sqrt(squared);
    if (!(radius < distance)) return {0, std::numeric_limits<double>::infinity()};
    const double t = radius / distance, unit = 1 / (4 * glm::pi<double>() * squared);
    const double error = unit * spread / squared * t * (4 - 3 * t) / ((1 - t) * (1 - t));
    if (!(error < uselessError)) return {0, error};
    const glm::dvec3 u = toCentre / distance;
    const Symmetric2& m = moment;
    const double along = m[0] * u.x * u.x + m[1] * u.y * u.y + m[2] * u.z * u.z +
                         2 * (m[3] * u.x * u.y + m[4] * u.y * u.z + m[5] * u.z * u.x);
    const double first = (m[0] + m[1] + m[2] - 3 * along) / distance;
    const double second = (7.5 * cubic(moment2, u) - 4.5 * trace(moment2, u)) / squared;
    return {unit * (glm::dot(vectorArea, u) + first + second), error};
}

}  // namespace bilayer::detail
