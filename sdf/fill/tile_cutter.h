// SPDX-License-Identifier: Apache-2.0
// Cuts triangles into parts that Algorithm 1 of the paper can sample without gaps. It is a header because most
// triangles of a fine mesh are one part with one sample. A function call for each would cost as much as the cut.
// Tested by tests/sdf/tile_cutter.cpp through makeTiles().
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <utility>

#include <bilayer/sdf/options.h>
#include "sdf/fill/triangle_limits.h"

namespace bilayer::detail {

/// A part of a triangle and its sampling: several rows or, if the part is thin, one row along its longest edge.
struct TilePart {
    TriangleCorners corners;
    int rows;                  ///< n of Algorithm 1; 0 if the part is thin
    int along;                 ///< count of samples of a thin part, see ThinPart
    const glm::dvec3& normal;  ///< of the triangle, outward
    double length;             ///< of the normal
};

/// Sample positions of a thin part. Samples start at `(k + 1/3) / along` of the longest edge and lie half of the way
/// across the part. The offset is one third because the neighbour at the edge traverses it in the opposite direction.
/// Its samples therefore fall between these.
class ThinPart {
  public:
    static constexpr int run = 16;  ///< samples computed together

    /// A run of samples. The first is at `start + min(up, down) * rise`. Each next one adds the steps to `start`, `up`
    /// and `down`.
    struct Run {
        glm::dvec3 start, startStep, rise;  ///< on the edge, and half of the vector to the opposite corner [voxels]
        double up, upStep, down, downStep;
        int count;  ///< samples
    };

    explicit ThinPart(const TilePart& part) : along_(part.along) {
        const TriangleCorners& c = part.corners;
        const std::size_t i = longestEdge(c);
        from_ = c[i];
        edge_ = c[(i + 1) % 3] - from_;
        const glm::dvec3 opposite = c[(i + 2) % 3] - from_;
        // Keeps the opposite corner slightly away from the ends of the edge.
        peak_ = std::clamp(glm::dot(opposite, edge_) / glm::dot(edge_, edge_), 1e-6, 1 - 1e-6);
        rise_ = 0.5 * (opposite - peak_ * edge_);
    }

    /// Each run is computed independently, so that floats resolve positions relative to its first sample.
    Run runFrom(int first) const {
        const double step = 1.0 / double(along_), at = (double(first) + 1.0 / 3.0) * step;
        return {from_ + at * edge_,
                step * edge_,
                rise_,
                at / peak_,
                step / peak_,
                (1 - at) / (1 - peak_),
                -step / (1 - peak_),
                std::min(run, along_ - first)};
    }

    /// Returns the runs that may enter a box: first samples from .first to .second (exclusive), in steps of `run`.
    std::pair<int, int> within(const TriangleLimits& limits) const {
        double low = 0, high = 1;  // fractions of the edge
        for (int axis = 0; axis < 3; ++axis) {
            const double lower = limits.lower[axis] - std::max(rise_[axis], 0.0) - from_[axis],
                         upper = limits.upper[axis] - std::min(rise_[axis], 0.0) - from_[axis];
            if (edge_[axis] == 0) {
                if (lower > 0 || upper < 0) return {0, 0};
                continue;
            }
            const double a = lower / edge_[axis], b = upper / edge_[axis];
            low = std::max(low, std::min(a, b));
            high = std::min(high, std::max(a, b));
        }
        if (low > high) return {0, 0};
        // One more sample at each end allows for rounding.
        const int first = std::max(0, int(low * along_) - 2), end = std::min(along_, int(high * along_) + 2);
        return {first / run * run, end};
    }

    static std::size_t longestEdge(const TriangleCorners& c) {
        std::size_t longest = 0;
        double longest2 = 0;
        for (std::size_t i = 0; i < 3; ++i) {
            const glm::dvec3 edge = c[(i + 1) % 3] - c[i];
            if (const double length2 = glm::dot(edge, edge); length2 > longest2) {
                longest2 = length2;
                longest = i;
            }
        }
        return longest;
    }

  private:
    int along_;
    glm::dvec3 from_, edge_, rise_;
    double peak_;  // projection of the opposite corner onto the edge, as a fraction of it
};

/// Sliver threshold. Algorithm 1 divides every edge into the same count of parts. For a triangle of ordinary shape, a
/// part of the longest edge is at most 2 sqrt(epsilon) long (half a square: exactly 2). A triangle above this factor is
/// a sliver.
inline constexpr double sliverStep = 3.0;

/// Distance between the samples of a thin part, in units of sqrt(epsilon). It is smaller than along the longest edge of
/// half a square, because a thin part has no second row.
inline constexpr double thinStep = 1.6;
/// Maximum count of samples in a part.
inline constexpr double maxAlong = 1 << 30;

/// A triangle with an area up to epsilon gets one sample if its squared longest edge is at most this [voxels^2].
inline double longestOfOneSample2(const DoubleLayerOptions& options) {
    return sliverStep * sliverStep * double(options.epsilon);
}

/// Calls emit(const TilePart&) for the parts of one triangle.
template <class Emit>
class TileCutter {
  public:
    /// @param limits  if not null, parts of a cut triangle are discarded if their box misses the limits
    TileCutter(const DoubleLayerOptions& options, const TriangleLimits* limits, Emit emit)
        : options_(options), epsilon_(double(options.epsilon)), limits_(limits), emit_(emit) {}

    /// Emits no part for a triangle without area.
    void cut(const TriangleCorners& c) {
        const glm::dvec3 normal = glm::cross(c[1] - c[0], c[2] - c[0]);
        const double length = glm::length(normal);
        if (length > 0) cut(c, normal, length, longestEdge2(c));
    }

    /// The same with precomputed values.
    /// @param normal    outward, of any length above zero
    /// @param longest2  square of the longest edge
    void cut(const TriangleCorners& c, const glm::dvec3& normal, double length, double longest2) {
        normal_ = normal;
        length_ = length;
        const double area = 0.5 * length_;
        if (area <= epsilon_ && longest2 <= longestOfOneSample2(options_)) return emitRows(c, 1);
        if (options_.subdivision == Subdivision::recursive)
            recurse(c, area, longest2);
        else
            rows(c, area, longest2);
    }

  private:
    using Next = void (TileCutter::*)(const TriangleCorners&, double area, double longest2);

    // Algorithm 1. Where it would leave gaps, bisects or quarters the triangle, or emits one row of samples along it.
    void rows(const TriangleCorners& c, double area, double longest2) {
        const double n = std::max(1.0, std::ceil(std::sqrt(area / epsilon_)));
        if (options_.fillGaps) {
            if (longest2 > sliverStep * sliverStep * n * n * epsilon_) {
                // The height above the longest edge is at most the row distance.
                if (4 * area * area <= epsilon_ * longest2) return emitThin(c, longest2);
                return halve(c, area, &TileCutter::rows);
            }
            if (n > options_.maxSubdivision) return quarter(c, area, longest2, &TileCutter::rows);
        }
        emitRows(c, int(std::min(n, double(options_.maxSubdivision))));
    }

    // Fig. 2: one sample at the barycentre of each part below epsilon.
    void recurse(const TriangleCorners& c, double area, double longest2) {
        if (options_.fillGaps && longest2 > sliverStep * sliverStep * epsilon_ && area <= epsilon_)
            return halve(c, area, &TileCutter::recurse);
        if (area <= epsilon_) return emitRows(c, 1);
        if (area <= 2 * epsilon_) return halve(c, area, &TileCutter::recurse);
        quarter(c, area, longest2, &TileCutter::recurse);
    }

    void halve(const TriangleCorners& c, double area, Next next) {
        const std::size_t i = ThinPart::longestEdge(c);
        const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
        const glm::dvec3 middle = 0.5 * (c[i] + c[j]);
        for (const TriangleCorners& half : {TriangleCorners{c[i], middle, c[k]}, TriangleCorners{middle, c[j], c[k]}})
            recurseOn(half, 0.5 * area, longestEdge2(half), next);
    }

    void quarter(const TriangleCorners& c, double area, double longest2, Next next) {
        const glm::dvec3 ab = 0.5 * (c[0] + c[1]), bc = 0.5 * (c[1] + c[2]), ca = 0.5 * (c[2] + c[0]);
        for (const TriangleCorners& part : {TriangleCorners{c[0], ab, ca}, TriangleCorners{ab, c[1], bc},
                                            TriangleCorners{ca, bc, c[2]}, TriangleCorners{ab, bc, ca}})
            recurseOn(part, 0.25 * area, 0.25 * longest2, next);
    }

    void recurseOn(const TriangleCorners& c, double area, double longest2, Next next) {
        if (!limits_ || !misses(c, *limits_)) (this->*next)(c, area, longest2);
    }

    void emitRows(const TriangleCorners& c, int n) { emit_(TilePart{c, n, 0, normal_, length_}); }

    void emitThin(const TriangleCorners& c, double longest2) {
        const double along = std::ceil(std::sqrt(longest2 / (thinStep * thinStep * epsilon_)));
        emit_(TilePart{c, 0, int(std::min(along, maxAlong)), normal_, length_});
    }

    const DoubleLayerOptions& options_;
    double epsilon_;
    const TriangleLimits* limits_;
    Emit emit_;
    glm::dvec3 normal_{0};
    double length_ = 0;
};

}  // namespace bilayer::detail
