// SPDX-License-Identifier: Apache-2.0
// The loops around the holes of a mesh.
// Tested by tests/sdf/closing_triangles.cpp through closingTriangles().
#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

class Progress;

/// The edges that a mesh lacks to be closed, in the direction of the triangles that would close it. Vertices with equal
/// coordinates count as one. As many of these edges begin at a vertex as end there, so they form closed loops.
class BoundaryLoops {
  public:
    using Loop = std::vector<unsigned>;  ///< vertices

    /// @param progress  polled, unless null
    explicit BoundaryLoops(const Mesh& mesh, Progress* progress = nullptr);

    /// Returns the vertices with edges.
    Loop vertices() const;

    /// Takes all edges. A path that returns to one of its own vertices has completed a loop.
    /// @param choose  choose(path, ends) returns the index of the edge to follow, of those that leave the end of the
    ///                path; `ends` has the vertices where they end
    template <class Choose>
    std::vector<Loop> takeLoops(const Choose& choose) {
        std::vector<Loop> loops;
        std::vector<std::size_t> places(ends_.size(), none);  // of vertices on the path
        Loop path;
        const auto follow = [&] {
            Loop& ends = ends_[path.back()];
            const auto next = ends.begin() + std::ptrdiff_t(choose(path, ends));
            const unsigned vertex = *next;
            ends.erase(next);
            return vertex;
        };
        for (unsigned start = 0; start < ends_.size(); ++start)
            for (unsigned vertex = start; !ends_[vertex].empty() || !path.empty(); vertex = follow()) {
                if (places[vertex] != none) {
                    loops.emplace_back(path.begin() + std::ptrdiff_t(places[vertex]), path.end());
                    for (const unsigned v : loops.back()) places[v] = none;
                    path.resize(path.size() - loops.back().size());
                    if (ends_[vertex].empty()) break;
                }
                places[vertex] = path.size();
                path.push_back(vertex);
            }
        return loops;
    }

  private:
    static constexpr std::size_t none = std::numeric_limits<std::size_t>::max();

    std::vector<Loop> ends_;  // of the edges that begin at each vertex
};

}  // namespace bilayer::detail
