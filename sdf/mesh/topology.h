// Who shares what in a mesh, where vertices count as one if their coordinates are equal: edges with their triangles,
// and sets that grow together. Triangles keep their numbers. All that takes long polls a Progress, unless it is null.
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

/// One triangle's use of an edge.
struct EdgeUse {
    unsigned low, high;      ///< the edge's vertices
    unsigned triangle : 31;  ///< validate() lets no more pass
    bool forward : 1;        ///< the triangle runs it from low to high

    bool sameEdge(const EdgeUse& other) const { return low == other.low && high == other.high; }
    int direction() const { return forward ? 1 : -1; }
};

/// The triangles and edges of a mesh after welding by coordinates (0 and -0 are equal).
struct Topology {
    /// @param progress  kept, for forEachEdge() to poll too
    explicit Topology(const Mesh& mesh, Progress* progress = nullptr);
    /// The same for a mesh that is welded already.
    static Topology ofWelded(const Mesh& mesh);

    std::vector<glm::uvec3> triangles;  ///< as in the mesh, each vertex replaced by the first of equal coordinates
    LargeArray<EdgeUse> edges;          ///< by (low, high, triangle); none of triangles that use a vertex twice
    std::vector<unsigned> original;     ///< a triangle's first triangle with the same three vertices, often itself
    Progress* progress;

    /// Whether a triangle uses no vertex twice.
    bool proper(std::size_t triangle) const;

    /// Whether one of two triangles with the same three vertices runs them the other way.
    bool facesOpposite(std::size_t triangle, std::size_t other) const {
        const glm::uvec3 &s = triangles[triangle], &t = triangles[other];
        const int at = t.x == s.x ? 0 : t.y == s.x ? 1 : 2;
        return t[(at + 1) % 3] != s.y;
    }

    /// Calls visit(std::span<const EdgeUse>) with all uses of each edge that begins in a range of `edges`.
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

  private:
    // `first`: of each vertex, the first one of equal coordinates; none: itself
    Topology(const Mesh& mesh, const LargeArray<unsigned>& first, Progress* progress);
};

/// 64 bits for each vertex that are equal where coordinates are.
std::vector<std::uint64_t> hashVertices(const Mesh& mesh, Progress* progress = nullptr);

/// 64 bits for an edge run from one vertex to another, given the hashes of both. Running it the other way gives the
/// negative, so that the sum (modulo 2^64) over the triangles of a closed and oriented surface is zero; for any other
/// it is zero with a probability of about 2^-63.
inline std::uint64_t hashEdge(std::uint64_t from, std::uint64_t to) {
    // the halves of a 128-bit product, each operand with a constant of its own, so that the order counts
    __extension__ using Wide = unsigned __int128;
    const auto folded = [](std::uint64_t a, std::uint64_t b) {
        const Wide product = Wide(a ^ 0x9e3779b97f4a7c15u) * (b ^ 0xd1b54a32d192ed03u);
        return std::uint64_t(product) ^ std::uint64_t(product >> 64);
    };
    return folded(from, to) - folded(to, from);
}

/// Disjoint sets of the numbers below n, by union-find (R. E. Tarjan, 1975). Each member is either like its set's root
/// or its opposite.
class DisjointSets {
  public:
    explicit DisjointSets(std::size_t n) : parent_(n), opposite_(n, 0) {
        std::iota(parent_.begin(), parent_.end(), 0u);
    }

    unsigned root(unsigned i) { return find(i).root; }
    bool oppositeToRoot(unsigned i) { return find(i).opposite; }

    /// Puts a and b into one set, as opposites or alike; false if they are in one set already and otherwise related.
    bool join(unsigned a, unsigned b, bool opposite = false) {
        const Place pa = find(a), pb = find(b);
        if (pa.root == pb.root) return (pa.opposite != pb.opposite) == opposite;
        // the smaller number becomes the root: the same roots whatever the order of joining
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
            // halve the path on the way
            opposite_[i] ^= opposite_[parent_[i]];
            parent_[i] = parent_[parent_[i]];
            opposite ^= bool(opposite_[i]);
            i = parent_[i];
        }
        return {i, opposite};
    }

    std::vector<unsigned> parent_;
    std::vector<std::uint8_t> opposite_;  // to the parent; a root is not opposite to itself
};

/// Disjoint sets of the numbers below n that all threads may join at the same time (R. J. Anderson, H. Woll, "Wait-free
/// parallel algorithms for the union-find problem", STOC 1991). A root is the smallest number of its set, whatever the
/// order of joining.
class ConcurrentDisjointSets {
  public:
    explicit ConcurrentDisjointSets(std::size_t n);

    unsigned root(unsigned i) {
        for (;;) {
            const unsigned parent = at(i).load(std::memory_order_relaxed);
            if (parent == i) return i;
            const unsigned next = at(parent).load(std::memory_order_relaxed);
            // halve the path on the way; whoever else does so leaves an ancestor, too
            if (next != parent) at(i).store(next, std::memory_order_relaxed);
            i = next;
        }
    }

    /// False if a and b are in one set already.
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

}  // namespace bilayer::detail
