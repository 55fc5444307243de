// SPDX-License-Identifier: Apache-2.0
#include "sdf/mesh/topology.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <numeric>

#include "sdf/base/equal_points.h"
#include "sdf/base/hash.h"
#include "sdf/base/polled_loop.h"

namespace bilayer::detail {
namespace {

/// Vertices, triangles or half-edges per task.
constexpr std::size_t edgesPerTask = 4096;

// Returns the bits of a coordinate; adding zero turns -0 into 0.
std::uint64_t bitsOf(float coordinate) {
    return std::bit_cast<std::uint32_t>(coordinate + 0.0f);
}

// Sorts half-edges into buckets by the lower vertex, then sorts each bucket. This takes linear time, unlike a sort of
// all half-edges. Threads fill a bucket in any order, and the sort makes the result deterministic.
LargeArray<EdgeUse> sortedEdges(const Topology& topology, std::size_t vertices) {
    std::vector<unsigned> ends(vertices + 1, 0);
    const auto forEachUse = [&](auto visit) {
        forAllPolled(topology.triangles.size(), topology.progress, [&](std::size_t i) {
            if (!topology.proper(i)) return;
            for (int k = 0; k < 3; ++k) {
                const unsigned a = topology.triangles[i][k], b = topology.triangles[i][(k + 1) % 3];
                visit(EdgeUse{std::min(a, b), std::max(a, b), unsigned(i), a < b});
            }
        });
    };
    const auto increment = [](unsigned& count) {
        return std::atomic_ref<unsigned>(count).fetch_add(1, std::memory_order_relaxed);
    };
    forEachUse([&](const EdgeUse& use) { increment(ends[use.low + 1]); });
    std::partial_sum(ends.begin(), ends.end(), ends.begin());
    LargeArray<EdgeUse> edges(ends.back());
    // advances each bucket from its begin to its end
    forEachUse([&](const EdgeUse& use) { edges[increment(ends[use.low])] = use; });
    forAllPolled(vertices, topology.progress, [&](std::size_t v) {
        std::sort(edges.data() + (v ? ends[v - 1] : 0), edges.data() + ends[v], [](const EdgeUse& a, const EdgeUse& b) {
            return a.high != b.high ? a.high < b.high : a.triangle < b.triangle;
        });
    });
    return edges;
}

// Finds duplicate triangles. Triangles with the same vertices share all edges, so it suffices to compare the triangles
// of one edge: the edge opposite to the largest vertex.
std::vector<unsigned> originals(const Topology& topology) {
    auto original = vectorOf<unsigned>(topology.triangles.size(), topology.progress);
    std::iota(original.begin(), original.end(), 0u);
    const auto opposite = [&](const EdgeUse& use) {
        const glm::uvec3& t = topology.triangles[use.triangle];
        return t.x ^ t.y ^ t.z ^ use.low ^ use.high;
    };
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, topology.edges.size(), edgesPerTask), [&](const auto& range) {
        poll(topology.progress);
        std::vector<std::pair<unsigned, unsigned>> all;  // opposite vertices, triangles
        topology.forEdges(range.begin(), range.end(), [&](std::span<const EdgeUse> uses) {
            if (uses.size() < 2 || (uses.size() == 2 && opposite(uses[0]) != opposite(uses[1]))) return;
            all.clear();
            for (const EdgeUse& use : uses)
                if (opposite(use) > use.high) all.emplace_back(opposite(use), use.triangle);
            std::sort(all.begin(), all.end());
            for (std::size_t i = 1; i < all.size(); ++i)
                if (all[i].first == all[i - 1].first) original[all[i].second] = original[all[i - 1].second];
        });
    });
    return original;
}

}  // namespace

Topology::Topology(const Mesh& mesh, Progress* asked) : Topology(mesh, firstOfEqual(mesh.points, asked), asked) {}

Topology Topology::ofWelded(const Mesh& mesh, Progress* progress) {
    return Topology(mesh, {}, progress);
}

Topology::Topology(const Mesh& mesh, const LargeArray<unsigned>& first, Progress* asked)
    : triangles(vectorOf<glm::uvec3>(mesh.triangles.size(), asked)), progress(asked) {
    forAllPolled(triangles.size(), progress, [&](std::size_t i) {
        const glm::uvec3& t = mesh.triangles[i];
        triangles[i] = first.size() ? glm::uvec3(first[t.x], first[t.y], first[t.z]) : t;
    });
    edges = sortedEdges(*this, mesh.points.size());
    original = originals(*this);
}

bool Topology::proper(std::size_t triangle) const {
    const glm::uvec3& t = triangles[triangle];
    return t.x != t.y && t.y != t.z && t.z != t.x;
}

ConcurrentDisjointSets::ConcurrentDisjointSets(std::size_t n) : parent_(n) {
    forAllPolled(n, nullptr, [&](std::size_t i) { parent_[i] = unsigned(i); });
}

ConcurrentDisjointSets connectedVertices(const Mesh& mesh) {
    ConcurrentDisjointSets sets(mesh.points.size());
    forAllPolled(mesh.triangles.size(), nullptr, [&](std::size_t i) {
        const glm::uvec3& t = mesh.triangles[i];
        sets.join(t.x, t.y);
        sets.join(t.x, t.z);
    });
    return sets;
}

std::uint64_t hashVertex(const glm::vec3& p) {
    return mixedBits(mixedBits(bitsOf(p.x) | bitsOf(p.y) << 32) + bitsOf(p.z));
}

std::vector<std::uint64_t> hashVertices(const Mesh& mesh, Progress* progress) {
    auto hashes = vectorOf<std::uint64_t>(mesh.points.size(), progress);
    forAllPolled(hashes.size(), progress, [&](std::size_t i) { hashes[i] = hashVertex(mesh.points[i]); });
    return hashes;
}

}  // namespace bilayer::detail
