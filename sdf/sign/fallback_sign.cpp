#include "sdf/sign/fallback_sign.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_reduce.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <glm/geometric.hpp>

#include "sdf/base/progress.h"
#include "sdf/sign/closest_side.h"
#include "sdf/sign/sign_choice.h"

namespace bilayer::detail {
namespace {

/// Ways of rays, mostly along x, so that the box of most triangles misses them; aslant, because meshes like to lie
/// along the axes.
const glm::dvec3 ways[] = {{1, 0.0137, 0.0071}, {-1, 0.0113, -0.0239}, {1, -0.0317, 0.0193}, {-1, -0.0071, 0.0411}};

struct Passes {
    int sum = 0;
    bool clear = true;
};

}  // namespace

bool FallbackSign::isInside(const glm::dvec3& point) {
    if (asked_) ++*asked_;
    // isolated: a thread that waits must not be given a task that would wait for it too
    std::call_once(looked_, [&] {
        tbb::this_task_arena::isolate([&] {
            closed_ = balanced(mesh_, &progress_);
            beyond_ = 2 * (glm::length(glm::dvec3(bounds(mesh_).size())) + 2 * reach_);
        });
    });
    if (closed_)
        for (const glm::dvec3& way : ways)
            if (const auto winding = windingByRay(point, beyond_ * way)) return *winding > 0;
    std::call_once(made_, [&] { tbb::this_task_arena::isolate([&] { winding_.emplace(mesh_, &progress_); }); });
    return (*winding_)(point) > 0.5;
}

// The winding number by the signed passes of a ray that ends outside; nothing if one of them is too close to tell.
std::optional<int> FallbackSign::windingByRay(const glm::dvec3& point, const glm::dvec3& way) const {
    const auto passesOf = [&](const auto& range, Passes passes) {
        progress_.poll();
        for (std::size_t i = range.begin(); i < range.end() && passes.clear; ++i) {
            const glm::uvec3& t = mesh_.triangles[i];
            const glm::vec3 &a = mesh_.points[t.x], &b = mesh_.points[t.y], &c = mesh_.points[t.z];
            // the ray may pass below or above the box of the triangle in y, which is told without products
            const double lowest = double(std::min({a.y, b.y, c.y})) - point.y,
                         highest = double(std::max({a.y, b.y, c.y})) - point.y;
            if (lowest > std::max(way.y, 0.0) || highest < std::min(way.y, 0.0)) continue;
            const auto turn = passing({glm::dvec3(a) - point, glm::dvec3(b) - point, glm::dvec3(c) - point}, way);
            passes.clear = turn.has_value();
            passes.sum += turn.value_or(0);
        }
        return passes;
    };
    const auto join = [](const Passes& a, const Passes& b) { return Passes{a.sum + b.sum, a.clear && b.clear}; };
    const Passes passes = tbb::this_task_arena::isolate([&] {
        return tbb::parallel_reduce(tbb::blocked_range<std::size_t>(0, mesh_.triangles.size(), 4096), Passes{},
                                    passesOf, join);
    });
    // the ray ends outside, and a pass along a normal leaves the solid
    return passes.clear ? std::optional(passes.sum) : std::nullopt;
}

}  // namespace bilayer::detail
