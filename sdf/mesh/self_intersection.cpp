// SPDX-License-Identifier: Apache-2.0
#include "sdf/mesh/self_intersection.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_reduce.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "sdf/base/plane_side.h"
#include "sdf/bvh/close_pairs.h"

namespace bilayer::detail {
namespace {

// The intersection of a triangle with the plane of another: none (at most a point, or the whole triangle), one of its
// edges, or a segment with the triangle on both sides.
enum class PlaneCut { none, edge, through };

// Finds intersecting triangles by the signs of volumes of their corners: P. Guigue, O. Devillers, "Fast and robust
// triangle-triangle overlap test using orientation predicates", Journal of Graphics Tools 8 (2003) 25-42.
class PairTest {
  public:
    PairTest(const Mesh& mesh, const Topology& topology) : mesh_(mesh), topology_(topology) {}

    bool intersects(unsigned first, unsigned second) const {
        const glm::uvec3 &a = mesh_.triangles[first], &b = mesh_.triangles[second];
        if (shared(a, b) > 1) return false;
        const glm::ivec3 aSides = sides(b, a);
        const PlaneCut aCut = cutOf(aSides);
        if (aCut == PlaneCut::none) return false;
        const glm::ivec3 bSides = sides(a, b);
        const PlaneCut bCut = cutOf(bSides);
        if (bCut == PlaneCut::none || (aCut == PlaneCut::edge && bCut == PlaneCut::edge) ||
            !overlap(a, aSides, b, bSides))
            return false;
        return (aCut == PlaneCut::through || continues(a, aSides, b)) &&
               (bCut == PlaneCut::through || continues(b, bSides, a));
    }

  private:
    static int shared(const glm::uvec3& a, const glm::uvec3& b) {
        int count = 0;
        for (int i = 0; i < 3; ++i)
            for (int k = 0; k < 3; ++k) count += a[i] == b[k];
        return count;
    }

    static PlaneCut cutOf(const glm::ivec3& s) {
        if (std::min({s.x, s.y, s.z}) < 0 && std::max({s.x, s.y, s.z}) > 0) return PlaneCut::through;
        return std::abs(s.x) + std::abs(s.y) + std::abs(s.z) == 1 ? PlaneCut::edge : PlaneCut::none;
    }

    // Returns the side of one triangle's plane on which each vertex of another lies.
    glm::ivec3 sides(const glm::uvec3& plane, const glm::uvec3& t) const {
        return {side(plane, t.x), side(plane, t.y), side(plane, t.z)};
    }
    int side(const glm::uvec3& plane, unsigned vertex) const { return side(plane.x, plane.y, plane.z, vertex); }

    // Returns the corner that is alone on its side of a plane; others may lie in the plane.
    static int alone(const glm::ivec3& s) {
        int k = 0;
        while (s[k] == 0 || s[k] * s[(k + 1) % 3] > 0 || s[k] * s[(k + 2) % 3] > 0) ++k;
        return k;
    }

    // Returns whether the two segments, each of one triangle in the other's plane, have more than a point in common.
    bool overlap(const glm::uvec3& a, const glm::ivec3& aSides, const glm::uvec3& b, const glm::ivec3& bSides) const {
        const int i = alone(aSides), k = alone(bSides);
        unsigned a1 = a[(i + 1) % 3], a2 = a[(i + 2) % 3], b1 = b[(k + 1) % 3], b2 = b[(k + 2) % 3];
        if (aSides[i] < 0) std::swap(b1, b2);
        if (bSides[k] < 0) std::swap(a1, a2);
        return side(a[i], a1, b[k], b1) < 0 && side(a[i], a2, b2, b[k]) < 0;
    }

    // Returns whether the surface continues beyond a plane across a triangle's edge that lies in the plane.
    bool continues(const glm::uvec3& t, const glm::ivec3& sides, const glm::uvec3& plane) const {
        const int off = alone(sides);
        const auto [low, high] = std::minmax({t[(off + 1) % 3], t[(off + 2) % 3]});
        const auto before = [](const EdgeUse& use, const std::pair<unsigned, unsigned>& edge) {
            return std::pair(use.low, use.high) < edge;
        };
        const std::span<const EdgeUse> edges(topology_.edges.data(), topology_.edges.size());
        for (auto use = std::lower_bound(edges.begin(), edges.end(), std::pair(low, high), before);
             use != edges.end() && use->low == low && use->high == high; ++use) {
            const glm::uvec3& other = mesh_.triangles[use->triangle];
            const unsigned third = other.x ^ other.y ^ other.z ^ low ^ high;  // the corner that is not on the edge
            if (side(plane, third) == -sides[off]) return true;
        }
        return false;
    }

    // Returns the sign of the volume of four vertices; 0 if a vertex occurs twice.
    int side(unsigned a, unsigned b, unsigned c, unsigned d) const {
        if (a == c || b == c || d == a || d == b || d == c) return 0;
        return planeSide(mesh_.points[a], mesh_.points[b], mesh_.points[c], mesh_.points[d]);
    }

    const Mesh& mesh_;
    const Topology& topology_;
};

}  // namespace

std::size_t countIntersectingPairs(const Mesh& welded, const Topology& topology, const TriangleTree& tree,
                                   Progress* progress) {
    const PairTest pairs(welded, topology);
    return tbb::parallel_reduce(
        tbb::blocked_range<std::uint32_t>(0, tree.boxes().leafCount, 64), std::size_t(0),
        [&](const auto& range, std::size_t count) {
            poll(progress);
            std::vector<std::pair<unsigned, unsigned>> close;
            for (std::uint32_t leaf = range.begin(); leaf < range.end(); ++leaf) {
                findClosePairs(welded, tree, leaf, close);
                for (const auto& [a, b] : close) count += pairs.intersects(std::min(a, b), std::max(a, b));
            }
            return count;
        },
        std::plus<>());
}

}  // namespace bilayer::detail
