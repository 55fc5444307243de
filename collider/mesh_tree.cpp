// The search is branch and bound, nearest box first: N. Roussopoulos, S. Kelley, F. Vincent, "Nearest neighbor
// queries", SIGMOD 1995, 71-79. Highway compiles it once for each instruction set.
#include "collider/mesh_tree.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "collider/mesh_tree.cpp"
#include <hwy/cache_control.h>
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
/// Points that are looked at in turns: enough to hide what memory takes, and few enough for the first cache.
constexpr std::size_t together = 8;
constexpr std::uint32_t noNode = ~0u;
constexpr std::size_t cacheLine = 64;  // [bytes]
/// Points and boxes in the tree's frame are rounded by no more than this part of their size.
constexpr float placeRounding = 5e-7f;

// Asks for memory ahead of its use.
template <class Item>
inline void fetch(const Item& item) {
    for (std::size_t line = 0; line < sizeof(Item); line += cacheLine)
        hwy::Prefetch(reinterpret_cast<const char*>(&item) + line);
}

// One point's way down the tree, node by node.
class Search {
  public:
    void begin(const WideTree& tree, const TurnedGroup* groups, const glm::dvec3& point, float bound,
               const EntryGroup* entry) {
        tree_ = &tree;
        groups_ = groups;
        cell_ = glm::floor(point);
        inCell_ = glm::vec3(point - glm::floor(point));
        const glm::vec3 size = glm::max(glm::abs(cell_), glm::vec3(tree.size));
        slack_ = placeRounding * (size.x + size.y + size.z);
        part_ = MeshTree::noPart;
        waiting_ = 0;
        node_ = tree.root();
        lower(bound * bound);
        if (entry && !open(*entry)) node_ = noNode;
    }

    // Looks at the next node; false when there is none left.
    bool step() {
        if (node_ == noNode) return false;
        if (!tree_->isLeaf(node_)) {
            if (open(groups_[node_ - tree_->leafCount])) return true;
        } else {
            visit(tree_->leaves[node_], node_);
        }
        do {
            if (waiting_ == 0) return false;
            --waiting_;
        } while (gaps_[waiting_] > limit2_);
        node_ = nodes_[waiting_];
        return true;
    }

    void fetchNext() const {
        if (node_ != noNode) fetchNode(node_);
    }

    std::uint32_t part() const { return part_; }

  private:
    // Boxes are rounded, triangles are not.
    void lower(float distance2) {
        best2_ = distance2;
        const float limit = std::sqrt(distance2) + slack_;
        limit2_ = limit * limit * roundUp;
    }

    void fetchNode(std::uint32_t node) const {
        if (tree_->isLeaf(node))
            fetch(tree_->leaves[node]);
        else
            fetch(groups_[node - tree_->leafCount]);
    }

    // The boxes of a group that may hold something nearer, bit by bit, and how far they are.
    template <class Group>
    unsigned nearBoxes(const Group& group, const float (&place)[3], float* gaps) const {
        const Tag tag;
        unsigned near = 0;
        for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag)) {
            Vec sum = hn::Zero(tag);
            for (int k = 0; k < 3; ++k) {
                const Vec at = hn::Set(tag, place[k]);
                const Vec gap = hn::Max(hn::Sub(hn::Load(tag, group.lower[k] + i), at),
                                        hn::Sub(at, hn::Load(tag, group.upper[k] + i)));
                sum = hn::Add(sum, square(hn::Max(gap, hn::Zero(tag))));
            }
            hn::Store(sum, tag, gaps + i);
            near |= bitsOf(hn::Le(sum, hn::Set(tag, limit2_))) << i;
        }
        return near;
    }

    // Puts those nodes aside that may hold something nearer, and goes on to the nearest of them.
    template <class NodeOf>
    bool choose(unsigned near, const float* gaps, NodeOf nodeOf) {
        if (near == 0) return false;
        auto nearest = std::size_t(std::countr_zero(near));
        for (unsigned bits = near & (near - 1); bits != 0; bits &= bits - 1) {
            auto other = std::size_t(std::countr_zero(bits));
            if (gaps[other] < gaps[nearest]) std::swap(other, nearest);
            gaps_[waiting_] = gaps[other];
            nodes_[waiting_++] = nodeOf(other);
        }
        node_ = nodeOf(nearest);
        return true;
    }

    bool open(const TurnedGroup& group) {
        alignas(64) float gaps[treeWidth];
        // whole voxels first, without rounding
        const glm::vec3 origin(group.origin[0], group.origin[1], group.origin[2]), from = (cell_ - origin) + inCell_;
        float place[3];
        for (int k = 0; k < 3; ++k)
            place[k] = group.axes[k][0] * from.x + group.axes[k][1] * from.y + group.axes[k][2] * from.z;
        const unsigned near = nearBoxes(group, place, gaps);
        return choose(near, gaps, [&](std::size_t i) { return group.firstChild + std::uint32_t(i); });
    }

    bool open(const EntryGroup& group) {
        alignas(64) float gaps[treeWidth];
        const glm::vec3 from = cell_ + inCell_;
        const unsigned near = nearBoxes(group, {from.x, from.y, from.z}, gaps);
        return choose(near, gaps, [&](std::size_t i) { return group.nodes[i]; });
    }

    void visit(const WideLeaf& leaf, std::uint32_t index) {
        const Tag tag;
        alignas(64) float distance2[treeWidth];
        Vec least = hn::Set(tag, best2_);
        for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag)) {
            const auto load = [&](const float* from) { return hn::Load(tag, from + i); };
            // whole voxels first, without rounding
            const auto from = [&](int k) {
                return hn::Add(hn::Sub(hn::Set(tag, cell_[k]), load(leaf.cell[k])),
                               hn::Sub(hn::Set(tag, inCell_[k]), load(leaf.corner[k])));
            };
            const Vec measured = measureFromCorner(leaf, load, from(0), from(1), from(2)).distance2;
            hn::Store(measured, tag, distance2 + i);
            least = hn::Min(least, measured);
        }
        const float nearest = hn::GetLane(hn::MinOfLanes(tag, least));
        if (nearest == best2_ && part_ != MeshTree::noPart) return;
        unsigned found = 0;
        for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag))
            found |= bitsOf(hn::Eq(hn::Load(tag, distance2 + i), hn::Set(tag, nearest))) << i;
        if (found == 0) return;
        part_ = index * treeWidth + std::uint32_t(std::countr_zero(found));
        lower(nearest);
    }

    const WideTree* tree_;
    const TurnedGroup* groups_;
    glm::vec3 cell_, inCell_;
    float slack_, best2_, limit2_;
    std::uint32_t part_, node_;
    std::size_t waiting_;
    float gaps_[mostWaiting];
    std::uint32_t nodes_[mostWaiting];
};

std::uint32_t searchNearest(const WideTree& tree, const TurnedGroup* groups, const glm::dvec3& point, float bound,
                            const EntryGroup* entry) {
    Search search;
    search.begin(tree, groups, point, bound, entry);
    while (search.step()) {
    }
    return search.part();
}

// Many points, some at a time: while memory comes for one, another is looked at.
void searchAll(const WideTree& tree, const TurnedGroup* groups, const glm::dvec3* points, const float* bounds,
               const EntryGroup* const* entries, std::uint32_t* parts, std::size_t count) {
    Search searches[together];
    std::size_t answers[together], running = 0, next = 0;
    const auto begin = [&](std::size_t slot) {
        answers[slot] = next;
        searches[slot].begin(tree, groups, points[next], bounds[next], entries[next]);
        searches[slot].fetchNext();
        ++next;
    };
    while (running < together && next < count) begin(running++);
    while (running > 0)
        for (std::size_t slot = 0; slot < running;) {
            if (searches[slot].step()) {
                searches[slot++].fetchNext();
                continue;
            }
            parts[answers[slot]] = searches[slot].part();
            if (next < count) {
                begin(slot++);
            } else if (slot != --running) {
                searches[slot] = searches[running];
                answers[slot] = answers[running];
            }
        }
}

}  // namespace bilayer::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer {
namespace {

HWY_EXPORT(searchNearest);
HWY_EXPORT(searchAll);

/// Thinner than this a triangle has no normal to trust [voxels].
constexpr double thinnest = 1e-7;
/// A height below this part of the longest edge leaves no foot on the plane that is better than the edges.
constexpr double flatness = 1e-10;
/// As many sizes of the mesh away all its triangles are equally far, to a millionth: points beyond may come as near.
constexpr double farthest = 1e6;
/// So far from all edges a point lies over a triangle, whatever single precision made of these; and so near it is as
/// exact by them as by the corners [voxels].
constexpr double wellInside = 1e-5, near = 16;
/// Points that are taken together; their places fit into the first cache.
constexpr std::size_t batch = 64;

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
      tree_(makeWideTree(mesh_, voxelSize, nullptr, TreeOrder::split)),
      groups_(makeTurnedGroups(tree_)),
      normals_(mesh_, thinnest * double(voxelSize)) {}

// In the tree's frame; noNode is found for a negative bound.
void MeshTree::place(const glm::dvec3& point, glm::dvec3& local, float& bound) const noexcept {
    local = point * perMetre_ - glm::dvec3(tree_.base);
    const glm::dvec3 size(tree_.size);
    const double far = farthest * (size.x + size.y + size.z), away = glm::distance(local, 0.5 * size);
    const bool beyond = away > far;
    if (!std::isfinite(away) || !(bound >= 0) || (beyond && double(bound) < away - far)) {
        local = glm::dvec3(0);
        bound = -1;
    } else if (beyond) {
        local = 0.5 * size + (far / away) * (local - 0.5 * size);
        bound = std::numeric_limits<float>::infinity();
    }
}

std::uint32_t MeshTree::nearestPart(const glm::dvec3& point, float bound, const EntryGroup* entry) const noexcept {
    glm::dvec3 local;
    place(point, local, bound);
    return bound < 0 ? noPart : HWY_DYNAMIC_DISPATCH(searchNearest)(tree_, groups_.data(), local, bound, entry);
}

std::uint32_t MeshTree::nearest(const glm::dvec3& point, float bound) const noexcept {
    const std::uint32_t part = nearestPart(point, bound);
    return part == noPart ? noTriangle : triangleOf(part);
}

void MeshTree::nearestParts(std::span<const glm::dvec3> points, std::span<const float> bounds,
                            std::span<const EntryGroup* const> entries, std::span<std::uint32_t> parts) const noexcept {
    std::array<glm::dvec3, batch> places;
    std::array<float, batch> limits;
    std::array<std::uint32_t, batch> found;
    std::array<std::size_t, batch> numbers;
    std::array<const EntryGroup*, batch> begins;
    for (std::size_t begin = 0; begin < points.size(); begin += batch) {
        std::size_t count = 0;
        for (std::size_t i = begin; i < std::min(points.size(), begin + batch); ++i) {
            parts[i] = noPart;
            limits[count] = bounds[i];
            place(points[i], places[count], limits[count]);
            numbers[count] = i;
            begins[count] = entries[i];
            count += limits[count] >= 0;
        }
        HWY_DYNAMIC_DISPATCH(searchAll)
        (tree_, groups_.data(), places.data(), limits.data(), begins.data(), found.data(), count);
        for (std::size_t i = 0; i < count; ++i) parts[numbers[i]] = found[i];
    }
}

NearestFeature MeshTree::featureOfPart(std::uint32_t part, const glm::dvec3& point) const noexcept {
    const WideLeaf& leaf = tree_.leaves[part / treeWidth];
    const std::uint32_t i = part % treeWidth, triangle = leaf.triangles[i];
    const auto vectorOf = [i](const float(&v)[3][treeWidth]) { return glm::dvec3(v[0][i], v[1][i], v[2][i]); };
    const glm::dvec3 from = point * perMetre_ - glm::dvec3(tree_.base) - vectorOf(leaf.cell) - vectorOf(leaf.corner);
    const glm::dvec3 along = vectorOf(leaf.along), normal = vectorOf(leaf.normal);
    const double x = glm::dot(from, along), y = glm::dot(from, glm::cross(normal, along)), z = glm::dot(from, normal);
    const double besideBC = double(leaf.directionBC[0][i]) * y -
                            double(leaf.directionBC[1][i]) * (x - double(leaf.lengthAB[i])),
                 besideAC = double(leaf.directionAC[1][i]) * x - double(leaf.directionAC[0][i]) * y;
    const bool over = std::min({y, besideBC, besideAC}) > wellInside && std::abs(z) < near;
    if (!over || normals_.isFlat(triangle)) return featureOf(triangle, point);
    return {.triangle = triangle, .way = (-z * double(voxelSize_)) * normal, .normal = normal};
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
           tree_.leafCount * sizeof(WideLeaf) + tree_.groupCount * (sizeof(BoxGroup) + sizeof(TurnedGroup)) +
           normals_.memoryBytes();
}

}  // namespace bilayer
#endif  // HWY_ONCE
