// SPDX-License-Identifier: Apache-2.0
// Connectivity of a mesh: edges with their triangles, and disjoint sets. Vertices with equal coordinates count as one.
// Triangles keep their indices. Long operations poll a Progress, unless it is null.
// Tested by tests/sdf/orient.cpp through orient().
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/base/large_array.h"
#include "sdf/base/progress.h"

namespace bilayer::detail {

/// A half-edge: the use of an edge by one triangle.
struct EdgeUse {
    unsigned low, high;      ///< the edge's vertices
    unsigned triangle : 31;  ///< validate() limits the count
    bool forward : 1;        ///< the triangle traverses the edge from `low` to `high`

    bool sameEdge(const EdgeUse& other) const { return low == other.low && high == other.high; }
    int direction() const { return forward ? 1 : -1; }
};

/// The triangles and edges of a mesh after welding by coordinates (0 and -0 are equal).
struct Topology {
    /// @param progress  kept; forEachEdge() polls it too
    explicit Topology(const Mesh& mesh, Progress* progress = nullptr);
    /// Builds the topology of a mesh that is already welded.
    static Topology ofWelded(const Mesh& mesh, Progress* progress = nullptr);

    std::vector<glm::uvec3> triangles;  ///< of the mesh, each vertex replaced by the first of equal coordinates
    LargeArray<EdgeUse> edges;          ///< sorted by (low, high, triangle); without triangles that use a vertex twice
    std::vector<unsigned> original;     ///< a triangle's first triangle with the same three vertices, often itself
    Progress* progress;

    /// Returns whether the three vertices of a triangle differ.
    bool proper(std::size_t triangle) const;

    /// Returns whether two triangles with the same three vertices have opposite orientation.
    bool facesOpposite(std::size_t triangle, std::size_t other) const {
        const glm::uvec3 &s = triangles[triangle], &t = triangles[other];
        const int at = t.x == s.x ? 0 : t.y == s.x ? 1 : 2;
        return t[(at + 1) % 3] != s.y;
    }

    /// Calls visit(std::span<const EdgeUse>) with all uses of each edge whose uses begin in a range of `edges`.
    template <class Visit>
    void forEdges(std::size_t begin, std::size_t end, Visit visit) const {
        while (begin > 0 && begin < end && edges[begin].sameEdge(edges[begin - 1])) ++begin;
        for (std::size_t next = begin; begin < end; begin = next) {
            while (++next < edges.size() && edges[next].sameEdge(edges[begin])) {
            }
            visit(std::span(&edges[begin], next - begin));
        }
    }

    /// Calls visit(std::span<const EdgeUse>) with all uses of each edge.
    template <class Visit>
    void forEachEdge(Visit visit) const {
        std::size_t next = 0;
        for (const std::size_t i : Polled(edges.size(), progress)) {
            if (i < next) continue;
            for (next = i + 1; next < edges.size() && edges[next].sameEdge(edges[i]);) ++next;
            visit(std::span(&edges[i], next - i));
        }
    }

    /// Calls visit(from, to, count) for each edge that is used more often in one direction than in the other, by
    /// `count`.
    template <class Visit>
    void forEachUnbalancedEdge(Visit visit) const {
        forEachEdge([&](std::span<const EdgeUse> uses) {
            int excess = 0;
            for (const EdgeUse& use : uses) excess += use.direction();
            if (excess > 0) visit(uses[0].low, uses[0].high, unsigned(excess));
            if (excess < 0) visit(uses[0].high, uses[0].low, unsigned(-excess));
        });
    }

  private:
    // `first`: for each vertex, the first one of equal coordinates; empty: each vertex itself
    Topology(const Mesh& mesh, const LargeArray<unsigned>& first, Progress* progress);
};

/// Returns a 64-bit hash of a vertex. 0 and -0 are equal.
std::uint64_t hashVertex(const glm::vec3& point);

/// Returns a 64-bit hash for each vertex. Equal coordinates have equal hashes.
std::vector<std::uint64_t> hashVertices(const Mesh& mesh, Progress* progress = nullptr);

/// Returns a 64-bit hash of a half-edge from the hashes of its vertices. The opposite half-edge has the negated hash.
/// The sum (modulo 2^64) over the triangles of a closed and oriented surface is therefore zero. For any other surface
/// it is zero with a probability of about 2^-63.
inline std::uint64_t hashEdge(std::uint64_t from, std::uint64_t to) {
    // fold the halves of a 128-bit product; each operand has its own constant, so that the order matters
    __extension__ using Wide = unsigned __int128;
    const auto folded = [](std::uint64_t a, std::uint64_t b) {
        const Wide product = Wide(a ^ 0x9e3779b97f4a7c15u) * (b ^ 0xd1b54a32d192ed03u);
        return std::uint64_t(product) ^ std::uint64_t(product >> 64);
    };
    return folded(from, to) - folded(to, from);
}

/// Disjoint sets of the numbers below n, by union-find (R. E. Tarjan, 1975). Each member has the same or the opposite
/// sign as the root of its set.
class DisjointSets {
  public:
    explicit DisjointSets(std::size_t n) : parent_(n), opposite_(n, 0) {
        std::iota(parent_.begin(), parent_.end(), 0u);
    }

    unsigned root(unsigned i) { return find(i).root; }
    bool oppositeToRoot(unsigned i) { return find(i).opposite; }

    /// Joins the sets of a and b with equal or opposite signs. Returns false if they already share a set with the other
    /// relation.
    bool join(unsigned a, unsigned b, bool opposite = false) {
        const Place pa = find(a), pb = find(b);
        if (pa.root == pb.root) return (pa.opposite != pb.opposite) == opposite;
        // the smaller number becomes the root, so that roots do not depend on the order of joining
        const auto [low, high] = pa.root < pb.root ? std::pair(pa, pb) : std::pair(pb, pa);
        parent_[high.root] = low.root;
        opposite_[high.root] = (low.opposite != high.opposite) != opposite;
        return true;
    }

  private:
    struct Place {
        unsigned root;
        bool opposite;
    };

    Place find(unsigned i) {
        bool opposite = false;
        while (parent_[i] != i) {
            // path halving
            opposite_[i] ^= opposite_[parent_[i]];
            parent_[i] = parent_[parent_[i]];
            opposite ^= bool(opposite_[i]);
            i = parent_[i];
        }
        return {i, opposite};
    }

    std::vector<unsigned> parent_;
    std::vector<std::uint8_t> opposite_;  // relative to the parent; a root is never opposite to itself
};

/// Disjoint sets of the numbers below n that all threads may join concurrently (R. J. Anderson, H. Woll, "Wait-free
/// parallel algorithms for the union-find problem", STOC 1991). The root of a set is its smallest number, whatever the
/// order of joining.
class ConcurrentDisjointSets {
  public:
    explicit ConcurrentDisjointSets(std::size_t n);

    unsigned root(unsigned i) {
        for (;;) {
            const unsigned parent = at(i).load(std::memory_order_relaxed);
            if (parent == i) return i;
            const unsigned next = at(parent).load(std::memory_order_relaxed);
            // path halving; concurrent writers also store an ancestor
            if (next != parent) at(i).store(next, std::memory_order_relaxed);
            i = next;
        }
    }

    /// Returns false if a and b are already in one set.
    bool join(unsigned a, unsigned b) {
        for (;;) {
            a = root(a);
            b = root(b);
            if (a == b) return false;
            if (a < b) std::swap(a, b);
            unsigned expected = a;
            if (at(a).compare_exchange_strong(expected, b, std::memory_order_relaxed)) return true;
        }
    }

  private:
    std::atomic_ref<unsigned> at(unsigned i) { return std::atomic_ref<unsigned>(parent_[i]); }

    LargeArray<unsigned> parent_;
};

/// The connected components of a mesh, as sets of its vertices. Vertices are connected by triangles that share indices.
ConcurrentDisjointSets connectedVertices(const Mesh& mesh);

}  // namespace bilayer::detail
