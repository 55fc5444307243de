#include "sdf/pieces.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

namespace bilayer {
namespace {

/// Rounding of a sample's place and of the radius around it [voxels].
constexpr float radiusSlack = 1e-5f;
/// Below this height a piece is as good as its longest edge [voxels].
constexpr float flatHeight = 1e-9f;
/// Below this part of the longest edge the height is too rounded to give a direction at once.
constexpr float flatPart = 0.1f;

// Rounds to the nearest, halves always up, so that a shift by whole voxels shifts the result. For |value| < 2^31.
int roundToInt(double value) {
    constexpr double shift = 2147483648.0;
    return int(std::int64_t(value + 0.5 + shift) - std::int64_t(shift));
}

// Any unit vector across a unit vector.
glm::vec3 across(const glm::vec3& u) {
    const glm::vec3 axis = std::abs(u.x) < 0.6f ? glm::vec3(1, 0, 0) : glm::vec3(0, 1, 0);
    return glm::normalize(glm::cross(u, axis));
}

struct Edge2 {
    float x, y, length;  // unit vector and length
};

Edge2 edgeTo(float x, float y) {
    const float length = std::sqrt(x * x + y * y), part = 1 / length;
    return length > 0 ? Edge2{x * part, y * part, length} : Edge2{1, 0, 0};
}

// The longest edge runs from corner `first` to the next.
Piece makePiece(const PieceCorners& corners, int first, std::uint32_t triangle) {
    Piece piece;
    const glm::dvec3& a = corners[std::size_t(first)];
    const glm::dvec3 &b = corners[std::size_t((first + 1) % 3)], &c = corners[std::size_t((first + 2) % 3)];
    piece.base = {roundToInt(a.x), roundToInt(a.y), roundToInt(a.z)};
    piece.origin = glm::vec3(a - glm::dvec3(piece.base));
    const glm::vec3 ab(b - a), ac(c - a);
    piece.length = glm::length(ab);
    piece.u = piece.length > 0 ? ab * (1 / piece.length) : glm::vec3(1, 0, 0);
    const float along = glm::dot(ac, piece.u);
    const glm::vec3 rest = ac - along * piece.u;
    const float height = glm::length(rest);
    if (height > flatPart * piece.length) {
        piece.w = rest * (1 / height);
    } else if (height > flatHeight) {
        // once more, because the rest is mostly rounding
        const glm::vec3 w = rest / height;
        piece.w = glm::normalize(w - glm::dot(w, piece.u) * piece.u);
    } else {
        piece.w = across(piece.u);
    }
    piece.n = glm::cross(piece.u, piece.w);
    const Edge2 left = edgeTo(along, height), right = edgeTo(along - piece.length, height);
    piece.ox = left.x, piece.oy = left.y, piece.olen = left.length;
    piece.ex = right.x, piece.ey = right.y, piece.elen = right.length;
    // the centre of the smallest circle around the piece: of its corners', or the middle of the longest edge
    const float up = height > flatHeight
                         ? std::max(0.f, (along * along + height * height - along * piece.length) / (2 * height))
                         : 0.f;
    piece.sample = piece.origin + 0.5f * piece.length * piece.u + up * piece.w;
    piece.radius = std::sqrt(0.25f * piece.length * piece.length + up * up) + radiusSlack;
    piece.triangle = triangle;
    return piece;
}

}  // namespace

void cutTriangle(const PieceCorners& c, std::uint32_t triangle, double longestEdge, const PieceLimits& limits,
                 std::vector<Piece>& pieces) {
    const glm::dvec3 lower = glm::min(c[0], glm::min(c[1], c[2])), upper = glm::max(c[0], glm::max(c[1], c[2]));
    if (lower.x > limits.upper.x || lower.y > limits.upper.y || lower.z > limits.upper.z || upper.x < limits.lower.x ||
        upper.y < limits.lower.y || upper.z < limits.lower.z)
        return;
    const glm::dvec3 ab = c[1] - c[0], bc = c[2] - c[1], ca = c[0] - c[2];
    const double lengths2[3] = {glm::dot(ab, ab), glm::dot(bc, bc), glm::dot(ca, ca)};
    const int first =
        lengths2[0] >= lengths2[1] ? (lengths2[0] >= lengths2[2] ? 0 : 2) : (lengths2[1] >= lengths2[2] ? 1 : 2);
    if (lengths2[first] <= longestEdge * longestEdge) {
        pieces.push_back(makePiece(c, first, triangle));
        return;
    }
    const auto i = std::size_t(first), j = (i + 1) % 3, k = (i + 2) % 3;
    const glm::dvec3 middle = 0.5 * (c[i] + c[j]);
    cutTriangle({c[i], middle, c[k]}, triangle, longestEdge, limits, pieces);
    cutTriangle({middle, c[j], c[k]}, triangle, longestEdge, limits, pieces);
}

}  // namespace bilayer
