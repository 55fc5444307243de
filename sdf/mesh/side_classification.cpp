// SPDX-License-Identifier: Apache-2.0
#include "sdf/mesh/side_classification.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_reduce.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <numeric>

#include "sdf/base/progress.h"

namespace bilayer::detail {
namespace {

/// Count of sample points for a whole mesh; shares of its area are then accurate to about 2 %.
constexpr std::size_t samplesOfMesh = 512;
/// Lines through each point, each with two opposite rays; winding numbers are then accurate to about 0.05. In a closed
/// mesh each ray finds the number, unless it hits an edge exactly. A mean of eight rays is accurate in spite of one.
constexpr std::size_t linesPerSample = 32, linesIfClosed = 4;
/// A winding number that differs from 1/2 by less than this is undecided: three times the error.
constexpr double unclear = 0.15;
/// Max distance of surfaces that coincide up to the rounding of coordinates, relative to the max coordinate: half a
/// unit in the last place, on each axis of both.
constexpr double roundingApart = 2.0 * std::numeric_limits<float>::epsilon();

}  // namespace

Sides::Sides(const Mesh& mesh, const TriangleTree& tree, Progress* progress, bool closed)
    : mesh_(mesh),
      tree_(tree),
      progress_(progress),
      samePlace_(roundingApart * double(tree.largestCoordinate())),
      directions_(spreadDirections(closed ? linesIfClosed : linesPerSample)) {}

double Sides::area(unsigned triangle) const {
    const glm::uvec3& t = mesh_.triangles[triangle];
    const glm::dvec3 a = mesh_.points[t.x], b = mesh_.points[t.y], c = mesh_.points[t.z];
    return 0.5 * glm::length(glm::cross(b - a, c - a));
}

Bounding Sides::measure(std::span<const unsigned> triangles, std::size_t samples) const {
    std::vector<double> upTo;
    double sum = 0;
    upTo.reserve(triangles.size());
    for (const std::size_t i : Polled(triangles.size(), progress_)) upTo.push_back(sum += area(triangles[i]));
    if (!(sum > 0)) return {0, 0, 0, 1};
    const Bounding counts = tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, samples), Bounding{},
        [&](const auto& range, Bounding part) {
            for (std::size_t i = range.begin(); i < range.end(); ++i) {
                const double at = sum * (double(i) + 0.5) / double(samples);
                add(triangles[std::size_t(std::upper_bound(upTo.begin(), upTo.end(), at) - upTo.begin())], i, part);
            }
            return part;
        },
        [](const Bounding& a, const Bounding& b) {
            return Bounding{a.solid + b.solid, a.buried + b.buried, a.reversed + b.reversed, a.nothing + b.nothing};
        });
    const double all = double(samples);
    return {counts.solid / all, counts.buried / all, counts.reversed / all, counts.nothing / all};
}

// Coincident triangles, which are copies or belong to another triangulation, add half of their count to the winding
// number on either side. All others add the mean of their crossings.
void Sides::add(unsigned triangle, std::size_t sample, Bounding& sum) const {
    // large triangles get many samples: points of R. Kronecker's sequence, whose first one is off the edges
    double u = std::fmod(0.25 + 0.7548776662466927 * double(sample), 1);
    double v = std::fmod(0.25 + 0.5698402909980532 * double(sample), 1);
    if (u + v > 1) {
        u = 1 - u;
        v = 1 - v;
    }
    const glm::uvec3& t = mesh_.triangles[triangle];
    const glm::dvec3 a = mesh_.points[t.x], b = mesh_.points[t.y], c = mesh_.points[t.z];
    const glm::dvec3 point = a + u * (b - a) + v * (c - a), normal = glm::normalize(glm::cross(b - a, c - a));
    std::vector<Crossing> found;
    double others = 0, here = 0;
    for (const glm::dvec3& direction : directions_) {
        poll(progress_);
        tree_.crossings(point, direction, found);
        const double cosine = glm::dot(normal, direction);
        const int facing = cosine > 0 ? 1 : -1;
        for (const Crossing& crossing : found) {
            if (std::abs(crossing.along * cosine) <= samePlace_)
                here += crossing.sign * facing;
            else
                others += crossing.along > 0 ? crossing.sign : -crossing.sign;
        }
    }
    const double middle = others / double(2 * directions_.size());
    const double half = 0.5 * std::round(here / double(directions_.size()));
    const double before = middle - half, behind = middle + half;
    const auto inside = [](double winding) { return winding > 0.5 + unclear; };
    const auto outside = [](double winding) { return winding < 0.5 - unclear; };
    if (outside(before) && inside(behind))
        ++sum.solid;
    else if (inside(before) && inside(behind))
        ++sum.buried;
    else if (inside(before) && outside(behind))
        ++sum.reversed;
    else
        ++sum.nothing;
}

Bounding bounding(const Mesh& mesh, Progress* progress, bool closed) {
    const TriangleTree tree(mesh, progress);
    std::vector<unsigned> all(mesh.triangles.size());
    std::iota(all.begin(), all.end(), 0u);
    return Sides(mesh, tree, progress, closed).measure(all, samplesOfMesh);
}

}  // namespace bilayer::detail
