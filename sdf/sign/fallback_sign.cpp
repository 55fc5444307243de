// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/fallback_sign.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_reduce.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <stdexcept>

#include "sdf/base/progress.h"
#include "sdf/sign/closest_side.h"
#include "sdf/sign/sign_choice.h"

namespace bilayer::detail {
namespace {

/// Ray directions. They are mostly along x, so that a ray misses the boxes of most triangles. They are slightly
/// oblique, because many meshes are aligned with the axes.
const glm::dvec3 rayDirections[] = {
    {1, 0.0137, 0.0071}, {-1, 0.0113, -0.0239}, {1, -0.0317, 0.0193}, {-1, -0.0071, 0.0411}};

/// Points that are decided by rays through all triangles. It takes about as long to build the hierarchy, which decides
/// each further point in a moment. Both have the same answer, so it does not matter which thread asks first.
constexpr int pointsByRays = 64;

struct Passes {
    int sum = 0;
    bool clear = true;
};

}  // namespace

bool FallbackSign::isInside(const glm::dvec3& point) {
    if (isPart_)
        throw std::invalid_argument(
            "the normals nearest to a voxel cancel out, and only the whole mesh can decide its side: "
            "build this field in one piece");
    if (asked_) ++*asked_;
    // Isolated: a waiting thread must not take a task that would wait for the same flag.
    std::call_once(looked_, [&] {
        tbb::this_task_arena::isolate([&] {
            closed_ = balanced(mesh_, &progress_);
            beyond_ = 2 * (glm::length(glm::dvec3(bounds(mesh_).size())) + 2 * reach_);
        });
    });
    if (closed_ && byRays_++ < pointsByRays)
        for (const glm::dvec3& direction : rayDirections)
            if (const auto winding = windingByRay(point, beyond_ * direction)) return *winding > 0;
    std::call_once(made_, [&] { tbb::this_task_arena::isolate([&] { winding_.emplace(mesh_, &progress_); }); });
    return (*winding_)(point) > 0.5;
}

// Returns the winding number by the signed crossings of a ray that ends outside; empty if a crossing is too close to an
// edge to decide.
std::optional<int> FallbackSign::windingByRay(const glm::dvec3& point, const glm::dvec3& end) const {
    const auto passesOf = [&](const auto& range, Passes passes) {
        progress_.poll();
        for (std::size_t i = range.begin(); i < range.end() && passes.clear; ++i) {
            const glm::uvec3& t = mesh_.triangles[i];
            const glm::vec3 &a = mesh_.points[t.x], &b = mesh_.points[t.y], &c = mesh_.points[t.z];
            // Quick rejection: the ray passes below or above the triangle's box in y.
            const double lowest = double(std::min({a.y, b.y, c.y})) - point.y,
                         highest = double(std::max({a.y, b.y, c.y})) - point.y;
            if (lowest > std::max(end.y, 0.0) || highest < std::min(end.y, 0.0)) continue;
            const auto crossing =
                segmentCrossing({glm::dvec3(a) - point, glm::dvec3(b) - point, glm::dvec3(c) - point}, end);
            passes.clear = crossing.has_value();
            passes.sum += crossing.value_or(0);
        }
        return passes;
    };
    const auto join = [](const Passes& a, const Passes& b) { return Passes{a.sum + b.sum, a.clear && b.clear}; };
    const Passes passes = tbb::this_task_arena::isolate([&] {
        return tbb::parallel_reduce(tbb::blocked_range<std::size_t>(0, mesh_.triangles.size(), 4096), Passes{},
                                    passesOf, join);
    });
    // The ray ends outside, and a crossing along a normal leaves the solid.
    return passes.clear ? std::optional(passes.sum) : std::nullopt;
}

}  // namespace bilayer::detail
