// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/distance/gjk.h"

#include <optional>
#include <span>

namespace bilayer::detail {

namespace {

using Weights = std::array<double, 4>;

/// The weights of the point nearest to the origin in the plane, line or space through some points. Nothing if the
/// points are dependent, or if the nearest point is not between them.
std::optional<Weights> weightsBetween(std::span<const glm::dvec3> points) {
    const std::size_t count = points.size() - 1;  // of edges from the first point
    glm::dvec3 edges[3];
    double matrix[3][4];
    for (std::size_t i = 0; i < count; ++i) edges[i] = points[i + 1] - points[0];
    for (std::size_t i = 0; i < count; ++i) {
        for (std::size_t j = 0; j < count; ++j) matrix[i][j] = glm::dot(edges[i], edges[j]);
        matrix[i][count] = -glm::dot(edges[i], points[0]);
    }
    // Gauss elimination; the matrix is symmetric and positive, so that no row is exchanged
    for (std::size_t i = 0; i < count; ++i) {
        if (!(matrix[i][i] > 0)) return std::nullopt;
        for (std::size_t row = i + 1; row < count; ++row) {
            const double factor = matrix[row][i] / matrix[i][i];
            for (std::size_t column = i; column <= count; ++column) matrix[row][column] -= factor * matrix[i][column];
        }
    }
    Weights weights{};
    double rest = 1;
    for (std::size_t i = count; i-- > 0;) {
        double value = matrix[i][count];
        for (std::size_t column = i + 1; column < count; ++column) value -= matrix[i][column] * weights[column + 1];
        weights[i + 1] = value / matrix[i][i];
        if (!(weights[i + 1] >= 0)) return std::nullopt;
        rest -= weights[i + 1];
    }
    if (!(rest >= 0)) return std::nullopt;
    weights[0] = rest;
    return weights;
}

}  // namespace

// The nearest point lies within one of the parts: a vertex, an edge, a face or the whole. Each part whose own nearest
// point lies within it gives a point of the simplex, and the nearest of these is the answer.
void Simplex::add(const SimplexVertex& vertex) {
    vertices[count++] = vertex;
    double nearest2 = std::numeric_limits<double>::infinity();
    Simplex best;
    for (unsigned part = 1; part < 1u << count; ++part) {
        std::array<glm::dvec3, 4> points{};
        Simplex candidate;
        for (std::size_t i = 0; i < count; ++i) {
            if (!(part >> i & 1)) continue;
            points[candidate.count] = vertices[i].difference();
            candidate.vertices[candidate.count++] = vertices[i];
        }
        const auto weights = weightsBetween(std::span(points).first(candidate.count));
        if (!weights) continue;
        candidate.weights = *weights;
        const glm::dvec3 point = candidate.nearest();
        const double distance2 = glm::dot(point, point);
        if (distance2 < nearest2) nearest2 = distance2, best = candidate;
    }
    *this = best;
}

}  // namespace bilayer::detail
