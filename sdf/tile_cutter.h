// Cuts triangles into parts that Algorithm 1 of the paper can sample without gaps. A header, because most triangles of
// a fine mesh are one part with one sample, and a call for each would cost as much as the cut.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "sdf/build.h"
#include "sdf/triangle_limits.h"

namespace bilayer {

/// A part of a triangle with the rows of samples that it gets.
struct TilePart {
    TriangleCorners corners;
    int rows;                  ///< n of Algorithm 1
    const glm::dvec3& normal;  ///< of the triangle, outward
    double length;             ///< of the normal
};

/// Algorithm 1 divides the longest edge into as many parts as the others. For a triangle of ordinary shape a part is at
/// most 2 sqrt(epsilon) long (half a square: exactly 2); beyond this factor the triangle counts as a sliver.
inline constexpr double sliverStep = 3.0;

/// A triangle with an area up to epsilon has one sample if the square of its longest edge is at most this [voxels^2].
inline double longestOfOneSample2(const DoubleLayerOptions& options) {
    return sliverStep * sliverStep * double(options.epsilon);
}

/// Calls emit(const TilePart&) for the parts of one triangle.
template <class Emit>
class TileCutter {
  public:
    /// @param limits  not null: of a triangle that is cut, parts whose box misses the limits are left out
    TileCutter(const DoubleLayerOptions& options, const TriangleLimits* limits, Emit emit)
        : options_(options), epsilon_(double(options.epsilon)), limits_(limits), emit_(emit) {}

    /// A triangle without area gives no part.
    void cut(const TriangleCorners& c) {
        const glm::dvec3 normal = glm::cross(c[1] - c[0], c[2] - c[0]);
        const double length = glm::length(normal);
        if (length > 0) cut(c, normal, length, longestEdge2(c));
    }

    /// The same with what is known already.
    /// @param normal    outward, of any length above zero
    /// @param longest2  square of the longest edge
    void cut(const TriangleCorners& c, const glm::dvec3& normal, double length, double longest2) {
        normal_ = normal;
        length_ = length;
        const double area = 0.5 * length_;
        if (area <= epsilon_ && longest2 <= longestOfOneSample2(options_)) return emit(c, 1);
        if (options_.subdivision == Subdivision::recursive)
            recurse(c, area, longest2);
        else
            rows(c, area, longest2);
    }

  private:
    using Next = void (TileCutter::*)(const TriangleCorners&, double area, double longest2);

    static double longestEdge2(const TriangleCorners& c) {
        const glm::dvec3 ab = c[1] - c[0], bc = c[2] - c[1], ca = c[0] - c[2];
        return std::max({glm::dot(ab, ab), glm::dot(bc, bc), glm::dot(ca, ca)});
    }

    // Algorithm 1; where it would leave gaps, on halves or quarters of the triangle.
    void rows(const TriangleCorners& c, double area, double longest2) {
        const double n = std::max(1.0, std::ceil(std::sqrt(area / epsilon_)));
        if (options_.fillGaps) {
            if (longest2 > sliverStep * sliverStep * n * n * epsilon_) return halve(c, area, &TileCutter::rows);
            if (n > options_.maxSubdivision) return quarter(c, area, longest2, &TileCutter::rows);
        }
        emit(c, int(std::min(n, double(options_.maxSubdivision))));
    }

    // Fig. 2: barycentres of parts below epsilon.
    void recurse(const TriangleCorners& c, double area, double longest2) {
        if (options_.fillGaps && longest2 > sliverStep * sliverStep * epsilon_ && area <= epsilon_)
            return halve(c, area, &TileCutter::recurse);
        if (area <= epsilon_) return emit(c, 1);
        if (area <= 2 * epsilon_) return halve(c, area, &TileCutter::recurse);
        quarter(c, area, longest2, &TileCutter::recurse);
    }

    void halve(const TriangleCorners& c, double area, Next next) {
        std::size_t i = 0;
        double longest2 = 0;
        for (std::size_t k = 0; k < 3; ++k) {
            const glm::dvec3 edge = c[(k + 1) % 3] - c[k];
            if (const double length2 = glm::dot(edge, edge); length2 > longest2) {
                longest2 = length2;
                i = k;
            }
        }
        const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
        const glm::dvec3 middle = 0.5 * (c[i] + c[j]);
        for (const TriangleCorners& half : {TriangleCorners{c[i], middle, c[k]}, TriangleCorners{middle, c[j], c[k]}})
            goOn(half, 0.5 * area, longestEdge2(half), next);
    }

    void quarter(const TriangleCorners& c, double area, double longest2, Next next) {
        const glm::dvec3 ab = 0.5 * (c[0] + c[1]), bc = 0.5 * (c[1] + c[2]), ca = 0.5 * (c[2] + c[0]);
        for (const TriangleCorners& part : {TriangleCorners{c[0], ab, ca}, TriangleCorners{ab, c[1], bc},
                                            TriangleCorners{ca, bc, c[2]}, TriangleCorners{ab, bc, ca}})
            goOn(part, 0.25 * area, 0.25 * longest2, next);
    }

    void goOn(const TriangleCorners& c, double area, double longest2, Next next) {
        if (!limits_ || !misses(c, *limits_)) (this->*next)(c, area, longest2);
    }

    void emit(const TriangleCorners& c, int n) { emit_(TilePart{c, n, normal_, length_}); }

    const DoubleLayerOptions& options_;
    double epsilon_;
    const TriangleLimits* limits_;
    Emit emit_;
    glm::dvec3 normal_{0};
    double length_ = 0;
};

}  // namespace bilayer
