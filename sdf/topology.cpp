#include "sdf/topology.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <tuple>

#include "sdf/equal_points.h"

namespace bilayer {
namespace {

/// Vertices that are worth a task.
constexpr std::size_t grain = 4096;

// Spreads every bit of a word over all of it: the finalizer of S. Vigna's and G. Steele's SplitMix64.
std::uint64_t mixed(std::uint64_t word) {
    word = (word ^ (word >> 30)) * 0xbf58476d1ce4e5b9u;
    word = (word ^ (word >> 27)) * 0x94d049bb133111ebu;
    return word ^ (word >> 31);
}

// The bits of a coordinate; adding zero makes -0 into 0.
std::uint64_t bitsOf(float coordinate) {
    return std::bit_cast<std::uint32_t>(coordinate + 0.0f);
}

std::uint64_t hashOf(const glm::vec3& p) {
    return mixed(mixed(bitsOf(p.x) | bitsOf(p.y) << 32) + bitsOf(p.z));
}

// Buckets by the lower vertex, then a small sort in each: linear, where a sort of all edges is not.
std::vector<EdgeUse> sortedEdges(const Topology& topology, std::size_t vertices) {
    std::vector<unsigned> begins(vertices + 1, 0);
    const auto forEachUse = [&](auto visit) {
        for (const unsigned i : Polled(topology.triangles.size(), topology.progress)) {
            if (!topology.proper(i)) continue;
            for (int k = 0; k < 3; ++k) {
                const unsigned a = topology.triangles[i][k], b = topology.triangles[i][(k + 1) % 3];
                visit(EdgeUse{std::min(a, b), std::max(a, b), i, a < b});
            }
        }
    };
    forEachUse([&](const EdgeUse& use) { ++begins[use.low + 1]; });
    std::partial_sum(begins.begin(), begins.end(), begins.begin());
    auto edges = vectorOf<EdgeUse>(begins.back(), topology.progress);
    std::vector<unsigned> next(begins.begin(), begins.end() - 1);
    forEachUse([&](const EdgeUse& use) { edges[next[use.low]++] = use; });
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, vertices, grain), [&](const auto& range) {
        poll(topology.progress);
        for (std::size_t v = range.begin(); v < range.end(); ++v)
            std::sort(edges.begin() + begins[v], edges.begin() + begins[v + 1], [](const EdgeUse& a, const EdgeUse& b) {
                return std::tie(a.high, a.triangle) < std::tie(b.high, b.triangle);
            });
    });
    return edges;
}

// Triangles with the same vertices share all edges, so the uses of one edge are enough to find them: by the vertex that
// is not on it.
std::vector<unsigned> originals(const Topology& topology) {
    std::vector<unsigned> original(topology.triangles.size());
    std::iota(original.begin(), original.end(), 0u);
    const auto opposite = [&](const EdgeUse& use) {
        const glm::uvec3& t = topology.triangles[use.triangle];
        return t.x ^ t.y ^ t.z ^ use.low ^ use.high;
    };
    std::vector<std::pair<unsigned, unsigned>> all;  // opposite vertices, triangles
    topology.forEachEdge([&](std::span<const EdgeUse> uses) {
        if (uses.size() < 2 || (uses.size() == 2 && opposite(uses[0]) != opposite(uses[1]))) return;
        all.clear();
        for (const EdgeUse& use : uses) all.emplace_back(opposite(use), use.triangle);
        std::sort(all.begin(), all.end());
        for (std::size_t i = 1; i < all.size(); ++i)
            if (all[i].first == all[i - 1].first) original[all[i].second] = original[all[i - 1].second];
    });
    return original;
}

}  // namespace

Topology::Topology(const Mesh& mesh, Progress* asked)
    : triangles(vectorOf<glm::uvec3>(mesh.triangles.size(), asked)), progress(asked) {
    const LargeArray<unsigned> first = firstOfEqual(mesh.points, progress);
    for (const std::size_t i : Polled(triangles.size(), progress))
        for (int k = 0; k < 3; ++k) triangles[i][k] = first[mesh.triangles[i][k]];
    edges = sortedEdges(*this, mesh.points.size());
    original = originals(*this);
}

bool Topology::proper(std::size_t triangle) const {
    const glm::uvec3& t = triangles[triangle];
    return t.x != t.y && t.y != t.z && t.z != t.x;
}

std::vector<std::uint64_t> hashVertices(const Mesh& mesh, Progress* progress) {
    auto hashes = vectorOf<std::uint64_t>(mesh.points.size(), progress);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, hashes.size(), grain), [&](const auto& range) {
        poll(progress);
        for (std::size_t i = range.begin(); i < range.end(); ++i) hashes[i] = hashOf(mesh.points[i]);
    });
    return hashes;
}

}  // namespace bilayer
