// The search is branch and bound, nearest box first: N. Roussopoulos, S. Kelley, F. Vincent, "Nearest neighbor
// queries", SIGMOD 1995, 71-79. Highway compiles it once for each instruction set.
#include "collider/mesh_tree.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "collider/mesh_tree.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

#include "sdf/leaf_measure.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::HWY_NAMESPACE {

/// Eight levels of groups hold 2^27 leaves; of each level seven wait at most.
constexpr std::size_t mostWaiting = 96;
/// Points and boxes in the tree's frame are rounded by no more than this part of their size.
constexpr float placeRounding = 2.4e-7f;

// One point's way down the tree.
class Search {
  public:
    Search(const WideTree& tree, const glm::dvec3& point, float bound)
        : tree_(tree), cell_(glm::floor(point)), inCell_(point - glm::floor(point)), point_(point) {
        const glm::vec3 size = glm::max(glm::abs(point_), glm::vec3(tree.size));
        slack_ = placeRounding * (size.x + size.y + size.z);
        lower(bound * bound);
    }

    std::uint32_t run() {
        std::uint32_t node = tree_.root();
        for (;;) {
            if (tree_.isLeaf(node))
                visit(tree_.leaves[node]);
            else if (open(tree_.group(node), node))
                continue;
            do {
                if (waiting_ == 0) return triangle_;
                --waiting_;
            } while (gaps_[waiting_] > limit2_);
            node = nodes_[waiting_];
        }
    }

  private:
    // Boxes are rounded, triangles are not.
    void lower(float distance2) {
        best2_ = distance2;
        const float limit = std::sqrt(distance2) + slack_;
        limit2_ = limit * limit * roundUp;
    }

    // Puts those children aside that may hold something nearer, and goes on to the nearest of them.
    bool open(const BoxGroup& group, std::uint32_t& node) {
        const Tag tag;
        alignas(64) float gaps[treeWidth];
        unsigned near = 0;
        for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag)) {
            Vec sum = hn::Zero(tag);
            for (int k = 0; k < 3; ++k) {
                const Vec at = hn::Set(tag, point_[k]);
                const Vec gap = hn::Max(hn::Sub(hn::Load(tag, group.lower[k] + i), at),
                                        hn::Sub(at, hn::Load(tag, group.upper[k] + i)));
                sum = hn::Add(sum, square(hn::Max(gap, hn::Zero(tag))));
            }
            hn::Store(sum, tag, gaps + i);
            near |= bitsOf(hn::Le(sum, hn::Set(tag, limit2_))) << i;
        }
        if (near == 0) return false;
        auto nearest = std::size_t(std::countr_zero(near));
        for (unsigned bits = near & (near - 1); bits != 0; bits &= bits - 1) {
            auto other = std::size_t(std::countr_zero(bits));
            if (gaps[other] < gaps[nearest]) std::swap(other, nearest);
            gaps_[waiting_] = gaps[other];
            nodes_[waiting_++] = group.firstChild + std::uint32_t(other);
        }
        node = group.firstChild + std::uint32_t(nearest);
        return true;
    }

    void visit(const WideLeaf& leaf) {
        const Tag tag;
        alignas(64) float distance2[treeWidth];
        for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag)) {
            const auto load = [&](const float* from) { return hn::Load(tag, from + i); };
            // whole voxels first, without rounding
            const auto from = [&](int k) {
                return hn::Add(hn::Sub(hn::Set(tag, cell_[k]), load(leaf.cell[k])),
                               hn::Sub(hn::Set(tag, inCell_[k]), load(leaf.corner[k])));
            };
            hn::Store(measureFromCorner(leaf, load, from(0), from(1), from(2)).distance2, tag, distance2 + i);
        }
        const auto nearest = std::size_t(std::min_element(distance2, distance2 + treeWidth) - distance2);
        if (!(distance2[nearest] <= best2_)) return;
        if (distance2[nearest] == best2_ && triangle_ != noTriangle) return;
        triangle_ = leaf.triangles[nearest];
        lower(distance2[nearest]);
    }

    const WideTree& tree_;
    glm::vec3 cell_, inCell_, point_;
    float slack_ = 0, best2_ = 0, limit2_ = 0;
    std::uint32_t triangle_ = noTriangle;
    std::size_t waiting_ = 0;
    float gaps_[mostWaiting];
    std::uint32_t nodes_[mostWaiting];
};

std::uint32_t searchNearest(const WideTree& tree, const glm::dvec3& point, float bound) {
    return Search(tree, point, bound).run();
}

}  // namespace bilayer::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer {
namespace {

HWY_EXPORT(searchNearest);

/// Thinner than this a triangle has no normal to trust [voxels].
constexpr double thinnest = 1e-7;
/// A height below this part of the longest edge leaves no foot on the plane that is better than the edges.
constexpr double flatness = 1e-10;
/// As many sizes of the mesh away all its triangles are equally far, to a millionth: points beyond may come as near.
constexpr double farthest = 1e6;

// A place on an edge, seen from the point that is asked for.
struct OnEdge {
    glm::dvec3 way;
    double way2;
    int corner;  // an end, or -1 between them
};

OnEdge closestOnEdge(const std::array<glm::dvec3, 3>& c, int from) {
    const int to = (from + 1) % 3;
    const glm::dvec3 &a = c[std::size_t(from)], &b = c[std::size_t(to)], ab = b - a;
    const double length2 = glm::dot(ab, ab), along = -glm::dot(a, ab);
    if (!(along > 0)) return {a, glm::dot(a, a), from};
    if (along >= length2) return {b, glm::dot(b, b), to};
    const double t = along / length2;
    // from the nearer end, so that both triangles of an edge find the same point whichever way they run it
    const glm::dvec3 way = t <= 0.5 ? a + t * ab : b - (1 - t) * ab;
    return {way, glm::dot(way, way), -1};
}

}  // namespace

MeshTree::MeshTree(Mesh mesh, float voxelSize)
    : mesh_((validate(mesh), std::move(mesh))),
      voxelSize_(voxelSize),
      perMetre_(1 / double(voxelSize)),
      tree_(makeWideTree(mesh_, voxelSize)),
      normals_(mesh_, thinnest * double(voxelSize)) {}

std::uint32_t MeshTree::nearest(const glm::dvec3& point, float bound) const noexcept {
    glm::dvec3 local = point * perMetre_ - glm::dvec3(tree_.base);
    const glm::dvec3 size(tree_.size);
    const double far = farthest * (size.x + size.y + size.z), away = glm::distance(local, 0.5 * size);
    if (!std::isfinite(away) || !(bound >= 0)) return noTriangle;
    if (away > far) {
        if (double(bound) < away - far) return noTriangle;
        local = 0.5 * size + (far / away) * (local - 0.5 * size);
        bound = std::numeric_limits<float>::infinity();
    }
    return HWY_DYNAMIC_DISPATCH(searchNearest)(tree_, local, bound);
}

NearestFeature MeshTree::featureOf(std::uint32_t triangle, const glm::dvec3& point) const noexcept {
    const glm::uvec3& t = mesh_.triangles[triangle];
    const std::array<glm::dvec3, 3> c{glm::dvec3(mesh_.points[t.x]) - point, glm::dvec3(mesh_.points[t.y]) - point,
                                      glm::dvec3(mesh_.points[t.z]) - point};
    const std::array<glm::dvec3, 3> edges{c[1] - c[0], c[2] - c[1], c[0] - c[2]};
    const glm::dvec3 n = glm::cross(edges[0], edges[1]);
    const double n2 = glm::dot(n, n);
    const double longest2 =
        std::max({glm::dot(edges[0], edges[0]), glm::dot(edges[1], edges[1]), glm::dot(edges[2], edges[2])});
    NearestFeature found{.triangle = triangle};
    const auto inside = [&](std::size_t i) { return glm::dot(glm::cross(c[i], edges[i]), n) >= 0; };
    if (n2 > flatness * flatness * longest2 * longest2 && inside(0) && inside(1) && inside(2)) {
        found.way = (glm::dot(c[0], n) / n2) * n;
        if (!normals_.isFlat(triangle)) found.normal = n / std::sqrt(n2);
        return found;
    }
    OnEdge best = closestOnEdge(c, 0);
    int edge = 0;
    for (int i = 1; i < 3; ++i) {
        const OnEdge other = closestOnEdge(c, i);
        if (other.way2 < best.way2) best = other, edge = i;
    }
    found.way = best.way;
    found.feature = best.corner < 0 ? Feature::edge : Feature::vertex;
    found.index = std::uint8_t(best.corner < 0 ? edge : best.corner);
    found.normal = best.corner < 0 ? normals_.ofEdge(triangle, edge) : normals_.ofVertex(t[best.corner]);
    return found;
}

std::size_t MeshTree::memoryBytes() const {
    return mesh_.points.size() * sizeof(glm::vec3) + mesh_.triangles.size() * sizeof(glm::uvec3) +
           tree_.leafCount * sizeof(WideLeaf) + tree_.groupCount * sizeof(BoxGroup) + normals_.memoryBytes();
}

}  // namespace bilayer
#endif  // HWY_ONCE
