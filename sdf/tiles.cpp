// Triangles to tiles: section 3.2, Algorithm 1 and Fig. 2 of the paper.
#include "sdf/tiles.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <numeric>
#include <vector>

namespace bilayer {
namespace {

/// Algorithm 1 divides the longest edge into as many parts as the others. For a triangle of ordinary shape a part is at
/// most 2 sqrt(epsilon) long (half a square: exactly 2); beyond this factor the triangle counts as a sliver.
constexpr double sliverStep = 3.0;

/// Triangles that one task cuts: enough to hide what a task costs, few enough to share out.
constexpr std::size_t grain = 2048;

using Corners = TriangleCorners;

struct Shape {
    double area;         // [voxels^2]
    double longestEdge;  // [voxels]
    int longest;         // the edge from this corner to the next
};

double longestEdge2(const Corners& c) {
    const glm::dvec3 ab = c[1] - c[0], bc = c[2] - c[1], ca = c[0] - c[2];
    return std::max({glm::dot(ab, ab), glm::dot(bc, bc), glm::dot(ca, ca)});
}

Shape shapeOf(const Corners& c) {
    Shape shape{0.5 * glm::length(glm::cross(c[1] - c[0], c[2] - c[0])), 0, 0};
    for (int k = 0; k < 3; ++k) {
        const glm::dvec3 edge = c[(k + 1) % 3] - c[k];
        if (const double length2 = glm::dot(edge, edge); length2 > shape.longestEdge) {
            shape.longestEdge = length2;
            shape.longest = k;
        }
    }
    shape.longestEdge = std::sqrt(shape.longestEdge);
    return shape;
}

// Cuts one triangle into tiles; for each, `emit` gets a function that makes it.
template <class Emit>
class Cutter {
  public:
    // null limits: all pieces are wanted
    Cutter(const DoubleLayerOptions& options, const TileLimits* limits, Emit emit)
        : options_(options), limits_(limits), emit_(emit) {}

    void cut(const Corners& c) {
        normal_ = glm::cross(c[1] - c[0], c[2] - c[0]);
        const double twiceArea2 = glm::dot(normal_, normal_);
        if (!(twiceArea2 > 0)) return;  // no area, no normal, no sample
        // most triangles of a fine mesh end here, before any square root
        const double epsilon = double(options_.epsilon);
        if (twiceArea2 <= 4 * epsilon * epsilon && longestEdge2(c) <= sliverStep * sliverStep * epsilon)
            return emit(c, 1);
        if (options_.subdivision == Subdivision::recursive)
            recurse(c);
        else
            rows(c);
    }

  private:
    // Algorithm 1; where it would leave gaps, on halves or quarters of the triangle.
    void rows(const Corners& c) {
        const Shape shape = shapeOf(c);
        const double n = std::max(1.0, std::ceil(std::sqrt(shape.area / options_.epsilon)));
        if (options_.fillGaps) {
            if (shape.longestEdge > sliverStep * n * std::sqrt(options_.epsilon)) return halve(c, shape, &Cutter::rows);
            if (n > options_.maxSubdivision) return quarter(c, &Cutter::rows);
        }
        emit(c, int(std::min(n, double(options_.maxSubdivision))));
    }

    // Fig. 2: barycentres of parts below epsilon.
    void recurse(const Corners& c) {
        const Shape shape = shapeOf(c);
        if (options_.fillGaps && shape.longestEdge > sliverStep * std::sqrt(options_.epsilon) &&
            shape.area <= options_.epsilon)
            return halve(c, shape, &Cutter::recurse);
        if (shape.area <= options_.epsilon) return emit(c, 1);
        if (shape.area <= 2 * options_.epsilon) return halve(c, shape, &Cutter::recurse);
        quarter(c, &Cutter::recurse);
    }

    using Next = void (Cutter::*)(const Corners&);

    void halve(const Corners& c, const Shape& shape, Next next) {
        const int i = shape.longest, j = (i + 1) % 3, k = (i + 2) % 3;
        const glm::dvec3 middle = 0.5 * (c[i] + c[j]);
        goOn({c[i], middle, c[k]}, next);
        goOn({middle, c[j], c[k]}, next);
    }

    void quarter(const Corners& c, Next next) {
        const glm::dvec3 ab = 0.5 * (c[0] + c[1]), bc = 0.5 * (c[1] + c[2]), ca = 0.5 * (c[2] + c[0]);
        goOn({c[0], ab, ca}, next);
        goOn({ab, c[1], bc}, next);
        goOn({ca, bc, c[2]}, next);
        goOn({ab, bc, ca}, next);
    }

    void goOn(const Corners& c, Next next) {
        if (!limits_ || !misses(c, *limits_)) (this->*next)(c);
    }

    static bool misses(const Corners& c, const TileLimits& limits) {
        const glm::dvec3 lower = glm::min(c[0], glm::min(c[1], c[2])), upper = glm::max(c[0], glm::max(c[1], c[2]));
        return glm::any(glm::greaterThan(lower, limits.upper)) || glm::any(glm::lessThan(upper, limits.lower));
    }

    void emit(const Corners& c, int n) {
        emit_([&] { return tile(c, n); });
    }

    Tile tile(const Corners& c, int n) const {
        const double part = 1.0 / double(n);
        const glm::dvec3 s1 = (c[1] - c[0]) * part, s2 = (c[2] - c[1]) * part, s3 = (c[2] - c[0]) * part;
        const glm::dvec3 first = c[0] + (s1 + s3) / 3.0;
        const glm::ivec3 base(std::lrint(first.x), std::lrint(first.y), std::lrint(first.z));
        return {base,
                glm::vec3(first - glm::dvec3(base)),
                glm::vec3(s1),
                glm::vec3(s2),
                glm::vec3(double(options_.delta) / glm::length(normal_) * normal_),
                n};
    }

    const DoubleLayerOptions& options_;
    const TileLimits* limits_;
    Emit emit_;
    glm::dvec3 normal_{0};  // of the whole triangle, twice its area long
};

}  // namespace

void cutTriangle(const TriangleCorners& corners, const DoubleLayerOptions& options, const TileLimits& limits,
                 std::vector<Tile>& tiles) {
    Cutter(options, &limits, [&](const auto& makeTile) { tiles.push_back(makeTile()); }).cut(corners);
}

Tiles makeTiles(const Mesh& mesh, const BuildOptions& options) {
    const double voxels = 1.0 / double(options.voxelSize);
    const auto corners = [&](std::size_t triangle) {
        const glm::uvec3 t = mesh.triangles[triangle];
        return Corners{glm::dvec3(mesh.points[t.x]) * voxels, glm::dvec3(mesh.points[t.y]) * voxels,
                       glm::dvec3(mesh.points[t.z]) * voxels};
    };
    // a run of triangles is a task's; all runs are cut twice, first to count their tiles, then to put them in their
    // place
    const std::size_t runs = (mesh.triangles.size() + grain - 1) / grain;
    const auto cutRun = [&](std::size_t run, auto emit) {
        std::int32_t triangle = 0;
        Cutter cutter(options.doubleLayer, nullptr, [&](const auto& makeTile) { emit(triangle, makeTile); });
        const std::size_t end = std::min(mesh.triangles.size(), (run + 1) * grain);
        for (std::size_t t = run * grain; t < end; ++t) {
            triangle = std::int32_t(t);
            cutter.cut(corners(t));
        }
    };
    std::vector<std::size_t> begins(runs + 1, 0);
    tbb::parallel_for(std::size_t(0), runs, [&](std::size_t run) {
        std::size_t count = 0;
        cutRun(run, [&](std::int32_t, const auto&) { ++count; });
        begins[run + 1] = count;
    });
    std::partial_sum(begins.begin(), begins.end(), begins.begin());
    Tiles all;
    const Bounds box = bounds(mesh);
    all.lower = glm::ivec3(glm::floor(glm::dvec3(box.lower) * voxels));
    all.upper = glm::ivec3(glm::ceil(glm::dvec3(box.upper) * voxels));
    all.tileMemory = std::make_unique_for_overwrite<Tile[]>(begins[runs]);
    all.triangleMemory = std::make_unique_for_overwrite<std::int32_t[]>(begins[runs]);
    all.tiles = {all.tileMemory.get(), begins[runs]};
    all.triangles = {all.triangleMemory.get(), begins[runs]};
    tbb::parallel_for(std::size_t(0), runs, [&](std::size_t run) {
        std::size_t at = begins[run];
        cutRun(run, [&](std::int32_t triangle, const auto& makeTile) {
            all.tileMemory[at] = makeTile();
            all.triangleMemory[at++] = triangle;
        });
    });
    return all;
}

}  // namespace bilayer
