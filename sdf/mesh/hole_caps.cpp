// SPDX-License-Identifier: Apache-2.0
#include "sdf/mesh/hole_caps.h"

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>

#include "sdf/mesh/topology.h"

namespace bilayer::detail {
namespace {

// The half-edges that have no opposite, as a graph. As many begin at a vertex as end there, so a walk along them always
// returns.
class BoundaryWalk {
  public:
    BoundaryWalk(const Mesh& mesh, Progress* progress) : next_(mesh.points.size() + 1, 0) {
        std::vector<HalfEdge> edges;
        Topology(mesh, progress).forEachEdge([&](std::span<const EdgeUse> uses) {
            int excess = 0;
            for (const EdgeUse& use : uses) excess += use.direction();
            const unsigned low = uses[0].low, high = uses[0].high;
            for (; excess > 0; --excess) edges.push_back({low, high});
            for (; excess < 0; ++excess) edges.push_back({high, low});
        });
        for (const HalfEdge& edge : edges) ++next_[edge.from + 1];
        for (std::size_t i = 1; i < next_.size(); ++i) next_[i] += next_[i - 1];
        ends_.resize(edges.size());
        std::vector<std::size_t> at(next_.begin(), next_.end() - 1);
        for (const HalfEdge& edge : edges) ends_[at[edge.from]++] = edge.to;
        last_ = std::move(at);
    }

    /// Calls visit(loop) with the vertices of each loop, until all half-edges are used once. No vertex is twice in one.
    template <class Visit>
    void forEachLoop(const Visit& visit) {
        constexpr auto none = std::numeric_limits<std::size_t>::max();
        std::vector<std::size_t> place(last_.size(), none);  // of each vertex in the path
        std::vector<unsigned> path;
        for (unsigned start = 0; start < last_.size(); ++start)
            while (next_[start] < last_[start]) {
                path = {start};
                place[start] = 0;
                while (!path.empty()) {
                    const unsigned vertex = path.back();
                    if (next_[vertex] == last_[vertex]) break;
                    const unsigned to = ends_[next_[vertex]++];
                    if (place[to] == none) {
                        place[to] = path.size();
                        path.push_back(to);
                        continue;
                    }
                    std::vector<unsigned> loop(path.begin() + std::ptrdiff_t(place[to]), path.end());
                    path.resize(place[to] + 1);
                    for (std::size_t i = 1; i < loop.size(); ++i) place[loop[i]] = none;
                    visit(std::move(loop));
                }
                place[start] = none;
            }
    }

  private:
    struct HalfEdge {
        unsigned from, to;
    };

    std::vector<std::size_t> next_, last_;  // the range of each vertex's half-edges that are not used yet
    std::vector<unsigned> ends_;
};

void close(std::vector<unsigned> loop, std::vector<glm::uvec3>& caps) {
    while (loop.size() > 2) {
        std::size_t kept = 0;
        const std::size_t n = loop.size();
        const unsigned first = loop[0];
        for (std::size_t i = 0; i < n; i += 2) {
            const unsigned corner = loop[i];
            if (i + 2 <= n) caps.emplace_back(i + 2 < n ? loop[i + 2] : first, loop[i + 1], corner);
            loop[kept++] = corner;
        }
        loop.resize(kept);
    }
}

}  // namespace

std::vector<glm::uvec3> holeCaps(const Mesh& mesh, Progress* progress) {
    std::vector<glm::uvec3> caps;
    BoundaryWalk(mesh, progress).forEachLoop([&](std::vector<unsigned> loop) { close(std::move(loop), caps); });
    return caps;
}

}  // namespace bilayer::detail
