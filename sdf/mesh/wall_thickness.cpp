// SPDX-License-Identifier: Apache-2.0
// Highway compiles the part between HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE once for each instruction set. It
// finds the triangles through which a ray may exit, in floats with a margin for rounding. These are then measured in
// double precision, so all instruction sets give the same result.
#include "sdf/mesh/wall_thickness.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "sdf/mesh/wall_thickness.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <glm/geometric.hpp>
#include <limits>

#include "sdf/base/progress.h"
#include "sdf/bvh/ray_slabs.h"
#include "sdf/bvh/tree_lanes.h"

#ifndef BILAYER_SDF_WALLS_ONCE
#define BILAYER_SDF_WALLS_ONCE
namespace bilayer::detail {
namespace {

/// If a ray exits at a more grazing angle than this, it hits an edge region and not a wall (cosine).
constexpr float minFacing = 0.2f;
constexpr float infinite = std::numeric_limits<float>::infinity();

struct Ray {
    glm::vec3 origin, direction;
};

struct Triangle {
    glm::vec3 a, b, c;

    Triangle(const TriangleLeaf& leaf, std::size_t i)
        : a(corner(leaf, 0, i)), b(corner(leaf, 1, i)), c(corner(leaf, 2, i)) {}

    static glm::vec3 corner(const TriangleLeaf& leaf, int corner, std::size_t i) {
        const auto& p = leaf.corners[corner];
        return {p[0][i], p[1][i], p[2][i]};
    }
};

// Returns where a ray exits through the front of a triangle (T. Moeller, B. Trumbore, 1997); infinite if it does not.
float exitThrough(const Ray& ray, const Triangle& t) {
    const glm::dvec3 a(t.a), ab = glm::dvec3(t.b) - a, ac = glm::dvec3(t.c) - a, d(ray.direction),
                             from = glm::dvec3(ray.origin) - a;
    const glm::dvec3 normal = glm::cross(ab, ac);
    const double facing = glm::dot(normal, d);
    if (facing <= double(minFacing) * glm::length(normal)) return infinite;
    const glm::dvec3 side = glm::cross(d, from);
    const double u = glm::dot(ac, side) / facing, v = -glm::dot(ab, side) / facing;
    if (u < 0 || v < 0 || u + v > 1) return infinite;
    const double along = -glm::dot(normal, from) / facing;
    return along > 0 ? float(along) : infinite;
}

}  // namespace
}  // namespace bilayer::detail
#endif

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace {

/// Rounding error of products in floats, relative to the absolute values of their factors; generous.
constexpr float rounding = 2e-6f;
/// Rounding error of the cosine between two unit vectors in floats; generous.
constexpr float roundingOfFacing = 1e-5f;

// A ray's search for its nearest exit.
class ExitSearch {
  public:
    ExitSearch(const TriangleTree& tree, const Ray& ray, float limit)
        : tree_(tree),
          ray_(ray),
          slack_(rounding * tree.largestCoordinate()),
          slabs_(ray.origin, ray.direction, slack_),
          nearest_(limit) {}

    float run() {
        const BoxTree& boxes = tree_.boxes();
        descend(
            boxes, boxes.root(), [&](float entry) { return entry > nearest_; },
            [&](std::uint32_t group, NodeStack& stack) { open(group, stack); },
            [&](std::uint32_t leaf) { return visit(tree_.leaf(leaf)), false; });
        return nearest_;
    }

  private:
    void open(std::uint32_t index, NodeStack& stack) const {
        const BoxGroup& group = tree_.boxes().groups[index];
        RaySlabs::Met met = slabs_.met(group.lower, group.upper, nearest_);
        const OrientedGroup* oriented = tree_.orientedGroup(tree_.boxes().leafCount + index);
        if (met.bits != 0 && oriented) {
            const glm::vec3 direction = oriented->along(ray_.direction);
            const RaySlabs slabs(oriented->along(ray_.origin), direction, slack_);
            met.intersect(slabs.met(oriented->lower, oriented->upper, nearest_));
            met.bits &= facing(*oriented, direction);
        }
        stack.pushChildren(met.bits, met.enters, group.firstChild);
    }

    // Returns a bit for each child that may have a triangle through which the ray exits.
    static unsigned facing(const OrientedGroup& group, const glm::vec3& direction) {
        const Tag tag;
        unsigned bits = 0;
        for (std::size_t lane = 0; lane < treeWidth; lane += hn::Lanes(tag)) {
            const auto load = [&](const std::int8_t* from) {
                const auto bytes = hn::LoadU(hn::Rebind<std::int8_t, Tag>(), from + lane);
                return hn::ConvertTo(tag, hn::PromoteTo(hn::Rebind<std::int32_t, Tag>(), bytes));
            };
            Vec highest = hn::Zero(tag);
            for (int k = 0; k < 3; ++k) {
                const std::int8_t* from = direction[k] > 0 ? group.upperNormal[k] : group.lowerNormal[k];
                highest = hn::Add(highest, hn::Mul(load(from), hn::Set(tag, direction[k])));
            }
            bits |= bitsOf(hn::Gt(highest, hn::Set(tag, (minFacing - roundingOfFacing) * OrientedGroup::normalScale)))
                    << lane;
        }
        return bits;
    }

    void visit(const TriangleLeaf& leaf) {
        const Tag tag;
        const PointLanes d = all(ray_.direction);
        for (std::size_t lane = 0; lane < treeWidth; lane += hn::Lanes(tag)) {
            const auto corner = [&](int i) { return loadLanes(tag, leaf.corners[i], lane); };
            const PointLanes a = corner(0), ab = corner(1) - a, ac = corner(2) - a;
            const Vec ab2 = dot(ab, ab), ac2 = dot(ac, ac), margin = hn::Set(tag, rounding);
            const Vec facing = dot(cross(ab, ac), d);
            const Vec facingMargin = hn::Mul(margin, hn::Sqrt(hn::Mul(ab2, ac2)));
            const Mask faces = hn::Gt(hn::Add(facing, facingMargin), hn::Zero(tag));
            if (hn::AllFalse(tag, faces)) continue;
            const PointLanes from = all(ray_.origin) - a, side = cross(d, from);
            const Vec away = hn::Mul(margin, hn::Sqrt(dot(from, from)));
            const Vec uMargin = hn::Mul(away, hn::Sqrt(ac2)), vMargin = hn::Mul(away, hn::Sqrt(ab2));
            const Vec u = hn::Add(dot(ac, side), uMargin), v = hn::Sub(vMargin, dot(ab, side));
            // both sides of this comparison have the margins of u and v
            const Vec largest =
                hn::Add(hn::Add(facing, facingMargin), hn::Mul(hn::Set(tag, 2.0f), hn::Add(uMargin, vMargin)));
            const Mask within = hn::And(hn::Ge(hn::Min(u, v), hn::Zero(tag)), hn::Le(hn::Add(u, v), largest));
            for (unsigned bits = bitsOf(hn::And(faces, within)); bits != 0; bits &= bits - 1)
                nearest_ =
                    std::min(nearest_, exitThrough(ray_, Triangle(leaf, lane + std::size_t(std::countr_zero(bits)))));
        }
    }

    static PointLanes all(const glm::vec3& p) {
        const Tag tag;
        return {hn::Set(tag, p.x), hn::Set(tag, p.y), hn::Set(tag, p.z)};
    }

    const TriangleTree& tree_;
    const Ray& ray_;
    const float slack_;
    RaySlabs slabs_;
    float nearest_;
};

float nearestExit(const TriangleTree& tree, const Ray& ray, float limit) {
    const float along = ExitSearch(tree, ray, limit).run();
    return along < limit ? along : infinite;
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer::detail {
namespace {
HWY_EXPORT(nearestExit);

float thicknessBehind(const TriangleTree& tree, const Triangle& t, float limit) {
    const glm::dvec3 a(t.a), b(t.b), c(t.c);
    const glm::vec3 normal(0.5 * glm::cross(b - a, c - a));
    const float length = glm::length(normal);
    if (!(length > 0)) return infinite;
    return HWY_DYNAMIC_DISPATCH(nearestExit)(tree, {(t.a + t.b + t.c) / 3.f, -normal / length}, limit);
}

}  // namespace

std::vector<float> wallThickness(const TriangleTree& tree, const WallSearch& search, Progress* progress) {
    std::vector<float> thickness(tree.triangleCount(), infinite);
    const std::size_t leaves = (tree.boxes().leafCount + search.stride - 1) / search.stride;
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, leaves, 64), [&](const auto& range) {
        poll(progress);
        for (std::size_t n = range.begin(); n < range.end(); ++n) {
            const std::size_t leaf = n * search.stride;
            for (std::size_t i = 0; i < tree.leafSize(leaf); ++i)
                thickness[tree.leaf(leaf).triangles[i]] =
                    thicknessBehind(tree, Triangle(tree.leaf(leaf), i), search.limit);
        }
    });
    return thickness;
}

}  // namespace bilayer::detail
#endif  // HWY_ONCE
