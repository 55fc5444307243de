// Branch and bound over pairs of nodes, nearest pair first, as E. Larsen, S. Gottschalk, M. Lin, D. Manocha, "Fast
// distance queries with rectangular swept sphere volumes", ICRA 2000. Boxes replace their swept spheres.
#include "collider/contact/mesh_distance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <optional>

namespace bilayer::detail {

namespace {

/// Pairs that are nearer by less are not looked for [sizes of the meshes]. Boxes are rounded to floats outward.
constexpr double tolerance = 3e-7;
/// Stack size: each of the two trees has at most ten levels, and a level leaves at most seven pending pairs.
constexpr std::size_t maxPending = 160;
/// Rounds of projection from one mesh to the other for a first bound.
constexpr int projections = 4;

// An axis-aligned box.
struct Box {
    glm::dvec3 centre, half;

    double size2() const { return glm::dot(half, half); }
};

double gap2(const Box& a, const Box& b) {
    const glm::dvec3 gap = glm::max(glm::abs(a.centre - b.centre) - (a.half + b.half), glm::dvec3(0));
    return glm::dot(gap, gap);
}

Box boxOf(const TriangleCorners& c) {
    const glm::dvec3 lower = glm::min(c[0], glm::min(c[1], c[2])), upper = glm::max(c[0], glm::max(c[1], c[2]));
    return {0.5 * (lower + upper), 0.5 * (upper - lower)};
}

// A mesh's tree with its boxes and triangles in the common frame.
class MovedTree {
  public:
    MovedTree(const MeshTree& mesh, const Similarity& map)
        : mesh_(mesh),
          map_(map),
          linear_(map.rotation * (map.scale * double(mesh.voxelSize()))),
          shift_(map(glm::dvec3(mesh.tree().base) * double(mesh.voxelSize()))) {
        for (int i = 0; i < 3; ++i) absolute_[i] = glm::abs(linear_[i]);
    }

    const WideTree& tree() const { return mesh_.tree(); }
    std::size_t triangleCount() const { return mesh_.mesh().triangles.size(); }

    Box box() const { return moved(glm::dvec3(0), glm::dvec3(tree().size)); }

    /// Calls visit(node, box) for the children of a node.
    template <class Visit>
    void forChildren(std::uint32_t node, Visit&& visit) const {
        const BoxGroup& group = tree().group(node);
        for (std::uint32_t i = 0; i < treeWidth; ++i) {
            if (!(group.lower[0][i] <= group.upper[0][i])) return;  // the unused slots come last
            visit(group.firstChild + i, moved({group.lower[0][i], group.lower[1][i], group.lower[2][i]},
                                              {group.upper[0][i], group.upper[1][i], group.upper[2][i]}));
        }
    }

    TriangleCorners corners(std::uint32_t triangle) const {
        const Mesh& mesh = mesh_.mesh();
        const glm::uvec3& t = mesh.triangles[triangle];
        return {map_(glm::dvec3(mesh.points[t.x])), map_(glm::dvec3(mesh.points[t.y])),
                map_(glm::dvec3(mesh.points[t.z]))};
    }

    /// The triangle nearest to a point of the common frame, and its closest point.
    std::pair<std::uint32_t, glm::dvec3> nearest(const glm::dvec3& point) const {
        const glm::dvec3 at = mesh_.approached(map_.inverse(point));
        const std::uint32_t triangle = mesh_.nearest(at, std::numeric_limits<float>::infinity());
        if (triangle == noTriangle) return {noTriangle, point};
        return {triangle, map_(at + mesh_.featureOf(triangle, at).way)};
    }

  private:
    Box moved(const glm::dvec3& lower, const glm::dvec3& upper) const {
        return {linear_ * (0.5 * (lower + upper)) + shift_, absolute_ * (0.5 * (upper - lower))};
    }

    const MeshTree& mesh_;
    const Similarity& map_;
    glm::dmat3 linear_, absolute_;  // from the frame of the tree [voxels]
    glm::dvec3 shift_;
};

// The triangles of a leaf. A halved triangle may have several parts in it.
struct LeafTriangles {
    LeafTriangles(const MovedTree& mesh, std::uint32_t leaf) {
        const WideLeaf& all = mesh.tree().leaves[leaf];
        for (const std::uint32_t triangle : all.triangles) {
            const auto end = indices.begin() + count;
            if (std::find(indices.begin(), end, triangle) != end) continue;
            indices[count] = triangle;
            corners[count] = mesh.corners(triangle);
            boxes[count] = boxOf(corners[count]);
            ++count;
        }
    }

    std::array<std::uint32_t, treeWidth> indices;
    std::array<TriangleCorners, treeWidth> corners;
    std::array<Box, treeWidth> boxes;
    std::ptrdiff_t count = 0;
};

class PairSearch {
  public:
    PairSearch(const MeshTree& a, const MeshTree& b, const Similarity& aToB, double maxDistance)
        : a_(a, aToB), b_(b, identity_), boxA_(a_.box()), boxB_(b_.box()) {
        room_ = tolerance * std::sqrt(std::max(boxA_.size2(), boxB_.size2()));
        best_.distance = maxDistance;
        setLimit();
    }

    void startFrom(const TriangleIndices& start) {
        if (start.a < a_.triangleCount() && start.b < b_.triangleCount()) measure(start.a, start.b);
    }

    void startByProjection() {
        glm::dvec3 at = boxA_.centre;
        for (int i = 0; i < projections; ++i) {
            const auto [triangleB, onB] = b_.nearest(at);
            const auto [triangleA, onA] = a_.nearest(onB);
            if (triangleA == noTriangle || triangleB == noTriangle) return;
            const double before = best_.distance;
            measure(triangleA, triangleB);
            if (i > 0 && !(best_.distance < before)) return;
            at = onA;
        }
    }

    const MeshDistance& run() {
        push(a_.tree().root(), boxA_, b_.tree().root(), boxB_);
        while (pending_ > 0) {
            const NodePair pair = stack_[--pending_];
            if (!(pair.gap2 < limit2_)) continue;
            const bool leafA = a_.tree().isLeaf(pair.a), leafB = b_.tree().isLeaf(pair.b);
            if (leafA && leafB)
                measureLeaves(pair.a, pair.b, pair.boxB);
            else
                open(pair, leafB || (!leafA && pair.boxA.size2() >= pair.boxB.size2()));
        }
        return best_;
    }

  private:
    struct NodePair {
        double gap2;
        std::uint32_t a, b;
        Box boxA, boxB;
    };

    void push(std::uint32_t a, const Box& boxA, std::uint32_t b, const Box& boxB) {
        const double gap = gap2(boxA, boxB);
        if (gap < limit2_) stack_[pending_++] = {gap, a, b, boxA, boxB};
    }

    // Replaces one node of a pair by its children, the nearest last.
    void open(const NodePair& pair, bool opensA) {
        const std::size_t first = pending_;
        if (opensA)
            a_.forChildren(pair.a, [&](std::uint32_t node, const Box& box) { push(node, box, pair.b, pair.boxB); });
        else
            b_.forChildren(pair.b, [&](std::uint32_t node, const Box& box) { push(pair.a, pair.boxA, node, box); });
        std::sort(stack_.begin() + std::ptrdiff_t(first), stack_.begin() + std::ptrdiff_t(pending_),
                  [](const NodePair& p, const NodePair& q) { return p.gap2 > q.gap2; });
    }

    void measureLeaves(std::uint32_t a, std::uint32_t b, const Box& boxB) {
        const LeafTriangles ofA(a_, a), ofB(b_, b);
        for (std::size_t i = 0; i < std::size_t(ofA.count); ++i) {
            if (!(gap2(ofA.boxes[i], boxB) < limit2_)) continue;
            for (std::size_t k = 0; k < std::size_t(ofB.count); ++k)
                if (gap2(ofA.boxes[i], ofB.boxes[k]) < limit2_)
                    measure(ofA.indices[i], ofA.corners[i], ofB.indices[k], ofB.corners[k]);
        }
    }

    void measure(std::uint32_t a, std::uint32_t b) { measure(a, a_.corners(a), b, b_.corners(b)); }

    void measure(std::uint32_t a, const TriangleCorners& cornersA, std::uint32_t b, const TriangleCorners& cornersB) {
        const TrianglePair pair = closestPoints(cornersA, cornersB);
        if (!(pair.distance2 <= best_.distance * best_.distance)) return;
        best_ = {a, b, pair.a, pair.b, std::sqrt(pair.distance2)};
        setLimit();
    }

    void setLimit() {
        const double limit = std::max(best_.distance - room_, 0.0);
        limit2_ = limit * limit;
    }

    const Similarity identity_;
    MovedTree a_, b_;
    Box boxA_, boxB_;
    double room_, limit2_;
    MeshDistance best_;
    std::size_t pending_ = 0;
    std::array<NodePair, maxPending> stack_;
};

}  // namespace

MeshDistance distanceBetween(const MeshTree& a, const MeshTree& b, const Similarity& aToB, double maxDistance,
                             const TriangleIndices& start) {
    PairSearch search(a, b, aToB, maxDistance);
    if (start.a != noTriangle)
        search.startFrom(start);
    else
        search.startByProjection();
    return search.run();
}

}  // namespace bilayer::detail
