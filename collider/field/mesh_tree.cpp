// Closest-triangle search by branch and bound, nearest box first: N. Roussopoulos, S. Kelley, F. Vincent, "Nearest
// neighbor queries", SIGMOD 1995, 71-79. Highway compiles it once for each instruction set.
#include "collider/field/mesh_tree.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "collider/field/mesh_tree.cpp"
#include <hwy/cache_control.h>
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
#include <oneapi/tbb/parallel_invoke.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

#include "collider/field/path.h"
#include "sdf/bvh/leaf_measure.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {

namespace {
/// Stack size: eight levels of groups hold 2^27 leaves, with at most seven pending nodes per level.
constexpr std::size_t maxWaiting = 96;
/// Count of searches that are interleaved, and of rounds before each runs to its end: enough to hide memory latency,
/// and few enough for the first-level cache.
constexpr std::size_t together = 16;
constexpr int turns = 3;
constexpr std::size_t cacheLine = 64;  // [bytes]
/// Max rounding of points and boxes in the tree's frame, relative to their size.
constexpr float placeRounding = 5e-7f;

// Prefetches an item.
template <class Item>
inline void fetch(const Item& item) {
    for (std::size_t line = 0; line < sizeof(Item); line += cacheLine)
        hwy::Prefetch(reinterpret_cast<const char*>(&item) + line);
}

// The search for one point.
class Search {
  public:
    void begin(const WideTree& tree, const OrientedGroup* groups, const glm::dvec3& point, float bound) {
        tree_ = &tree;
        groups_ = groups;
        const glm::dvec3 cell = glm::floor(point);
        cell_ = cell;
        inCell_ = glm::vec3(point - cell);
        const float reach = std::min(bound, longestReach);
        best2_ = reach * reach;
        part_ = MeshTree::noPart;
    }

    // Visits all nodes below a node that may contain a nearer triangle.
    void descend(std::uint32_t from) {
        const glm::vec3 size = glm::max(glm::abs(cell_), glm::vec3(tree_->size));
        Waiting waiting;
        waiting.slack = placeRounding * (size.x + size.y + size.z);
        for (std::uint32_t node = from;;) {
            if (tree_->isLeaf(node))
                visit(node);
            else
                open(groups_[node - tree_->leafCount], waiting);
            const float limit = std::sqrt(best2_) + waiting.slack, limit2 = limit * limit * roundUp;
            do {
                if (waiting.count == 0) return;
                --waiting.count;
            } while (waiting.gaps[waiting.count] > limit2);
            node = waiting.nodes[waiting.count];
        }
    }

    // Starts at entries. A key holds the squared gap of a node's box, with the entry and slot in the lowest bits.
    void begin(const WideTree& tree, const OrientedGroup* groups, const glm::dvec3& point, float bound,
               const EntryPlace& place) {
        begin(tree, groups, point, bound);
        entries_ = place.entries;
        places2_ = place.perVoxel * place.perVoxel;
        vectors_ = std::size_t(place.count) * entryVectors;
        for (int i = 0; i < place.count; ++i) measure(entries_[i], place, i);
        key_ = nextKey_ = -1;
        choose();
        choose();
    }

    // Whether an entry's node is left that may contain a nearer triangle.
    bool chosen() const { return isNear(key_); }
    void visitChosen() {
        const std::uint32_t node = nodeOf(key_);
        if (tree_->isLeaf(node))
            visit(node);
        else
            descend(node);
        choose();
    }

    std::uint32_t part() const { return part_; }

  private:
    using Ints = hn::CappedTag<std::int32_t, treeWidth>;
    static constexpr int slotBits = 3, numberBits = 3, keyBits = slotBits + numberBits, placeBits = 3;
    static constexpr std::int32_t noKey = std::numeric_limits<std::int32_t>::max();
    static_assert(BlockEntry::slots == treeWidth - 1 && treeWidth == 1 << slotBits &&
                  BlockEntries::most <= 1 << numberBits && BlockEntries::placesPerUnit == 1 << placeBits);
    static constexpr std::size_t lanes = hn::MaxLanes(Ints()), entryVectors = treeWidth / lanes;

    // The last lane has no slot; the bytes loaded there belong to other members.
    void measure(const BlockEntry& entry, const EntryPlace& place, int number) {
        const Ints tag;
        const auto bytes = [&](const std::uint8_t* from) {
            return hn::ShiftLeft<placeBits>(hn::PromoteTo(tag, hn::LoadU(hn::Rebind<std::uint8_t, Ints>(), from)));
        };
        for (std::size_t i = 0; i < treeWidth; i += lanes) {
            auto sum = hn::Zero(tag);
            for (std::size_t k = 0; k < 3; ++k) {
                const auto at = hn::Set(tag, place.place[k]);
                const auto gap =
                    hn::Max(hn::Max(hn::Sub(bytes(entry.lower[k] + i), at), hn::Sub(at, bytes(entry.upper[k] + i))),
                            hn::Zero(tag));
                sum = hn::Add(sum, hn::Mul(gap, gap));
            }
            const auto slot = hn::Iota(tag, std::int32_t(i)), last = hn::Set(tag, BlockEntry::slots);
            const auto key = hn::Or(hn::ShiftLeft<keyBits>(sum), hn::Or(slot, hn::Set(tag, number << slotBits)));
            hn::Store(hn::IfThenElse(hn::Eq(slot, last), hn::Set(tag, noKey), key), tag,
                      keys_ + std::size_t(number) * treeWidth + i);
        }
    }

    std::uint32_t nodeOf(std::int32_t key) const {
        return entries_[key >> slotBits & ((1 << numberBits) - 1)].node(key & ((1 << slotBits) - 1));
    }

    struct Waiting {
        float slack;  // boxes are rounded, triangles are not
        std::size_t count = 0;
        float gaps[maxWaiting];
        std::uint32_t nodes[maxWaiting];
    };

    bool isNear(std::int32_t key) const { return key <= (std::int32_t(best2_ * places2_) + 1) << keyBits; }

    // Takes the next smallest key, and prefetches the node of the one after it.
    void choose() {
        key_ = nextKey_;
        const Ints tag;
        const auto last = hn::Set(tag, nextKey_), none = hn::Set(tag, noKey);
        auto least = none;
        for (std::size_t i = 0; i < vectors_; ++i) {
            const auto keys = hn::Load(tag, keys_ + i * lanes);
            const auto left = hn::IfThenElse(hn::Eq(keys, last), none, keys);
            hn::Store(left, tag, keys_ + i * lanes);
            least = hn::Min(least, left);
        }
        nextKey_ = hn::GetLane(hn::MinOfLanes(tag, least));
        if (!isNear(nextKey_)) return;
        const std::uint32_t node = nodeOf(nextKey_);
        if (tree_->isLeaf(node))
            fetch(tree_->leaves[node]);
        else
            fetch(groups_[node - tree_->leafCount]);
    }

    // Pushes the nodes of a group that may contain a nearer triangle, the nearest of them last.
    void open(const OrientedGroup& group, Waiting& waiting) {
        alignas(64) float gaps[treeWidth];
        // whole voxels first, without rounding
        const glm::vec3 origin(group.origin[0], group.origin[1], group.origin[2]), from = (cell_ - origin) + inCell_;
        const float limit = std::sqrt(best2_) + waiting.slack, limit2 = limit * limit * roundUp;
        const Tag tag;
        unsigned near = 0;
        for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag)) {
            Vec sum = hn::Zero(tag);
            for (int k = 0; k < 3; ++k) {
                const float(&axis)[3] = group.axes[k];
                const Vec at = hn::Set(tag, axis[0] * from.x + axis[1] * from.y + axis[2] * from.z);
                const Vec gap = hn::Max(hn::Sub(hn::Load(tag, group.lower[k] + i), at),
                                        hn::Sub(at, hn::Load(tag, group.upper[k] + i)));
                sum = hn::Add(sum, square(hn::Max(gap, hn::Zero(tag))));
            }
            hn::Store(sum, tag, gaps + i);
            near |= bitsOf(hn::Le(sum, hn::Set(tag, limit2))) << i;
        }
        if (near == 0) return;
        auto nearest = std::size_t(std::countr_zero(near));
        const auto put = [&](std::size_t i) {
            waiting.gaps[waiting.count] = gaps[i];
            waiting.nodes[waiting.count++] = group.firstChild + std::uint32_t(i);
        };
        for (unsigned bits = near & (near - 1); bits != 0; bits &= bits - 1) {
            auto other = std::size_t(std::countr_zero(bits));
            if (gaps[other] < gaps[nearest]) std::swap(other, nearest);
            put(other);
        }
        put(nearest);
    }

    // Branchless: the nearer triangles cannot be predicted.
    void visit(std::uint32_t index) {
        const WideLeaf& leaf = tree_->leaves[index];
        const Tag tag;
        alignas(64) float distance2[treeWidth];
        Vec least = hn::Set(tag, std::numeric_limits<float>::infinity());
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
        const Vec nearest = hn::MinOfLanes(tag, least);
        unsigned found = 0;
        for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag))
            found |= bitsOf(hn::Eq(hn::Load(tag, distance2 + i), nearest)) << i;
        const float nearest2 = hn::GetLane(nearest);
        // the bound itself is included
        const bool nearer = part_ == MeshTree::noPart ? nearest2 <= best2_ : nearest2 < best2_;
        part_ = nearer ? index * treeWidth + std::uint32_t(std::countr_zero(found)) : part_;
        best2_ = nearer ? nearest2 : best2_;
    }

    const WideTree* tree_;
    const OrientedGroup* groups_;
    const BlockEntry* entries_;
    std::size_t vectors_;  // of keys
    glm::vec3 cell_, inCell_;
    float best2_, places2_;
    std::uint32_t part_;
    std::int32_t key_, nextKey_;
    alignas(64) std::int32_t keys_[BlockEntries::most * treeWidth];
};

std::uint32_t searchAll(const WideTree& tree, const OrientedGroup* groups, const glm::dvec3& point, float bound) {
    Search search;
    search.begin(tree, groups, point, bound);
    search.descend(tree.root());
    return search.part();
}

std::uint32_t searchEntry(const WideTree& tree, const OrientedGroup* groups, const glm::dvec3& point, float bound,
                          const EntryPlace& place) {
    Search search;
    search.begin(tree, groups, point, bound, place);
    while (search.chosen()) search.visitChosen();
    return search.part();
}

// Interleaves the searches of several points, so that prefetches are well ahead of their use.
void searchEntries(const WideTree& tree, const OrientedGroup* groups, double perMetre,
                   std::span<const glm::vec3> points, float bound, std::span<const EntryPlace> places,
                   std::span<std::uint32_t> parts) {
    Search searches[together];
    for (std::size_t first = 0; first < points.size(); first += together) {
        const std::size_t count = std::min(together, points.size() - first);
        for (std::size_t i = 0; i < count; ++i) {
            const glm::dvec3 local = glm::dvec3(points[first + i]) * perMetre - glm::dvec3(tree.base);
            searches[i].begin(tree, groups, local, bound, places[first + i]);
        }
        for (int turn = 0; turn < turns; ++turn)
            for (std::size_t i = 0; i < count; ++i)
                if (searches[i].chosen()) searches[i].visitChosen();
        for (std::size_t i = 0; i < count; ++i) {
            while (searches[i].chosen()) searches[i].visitChosen();
            parts[first + i] = searches[i].part();
        }
    }
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer::detail {
namespace {

HWY_EXPORT(searchAll);
HWY_EXPORT(searchEntry);
HWY_EXPORT(searchEntries);

/// Longer triangles are halved: around shorter ones single precision is accurate to 2e-6 [voxels].
constexpr double longestEdge = 16;
/// Thinner triangles have no reliable normal [voxels].
constexpr double thinnest = 1e-7;
/// Min height relative to the longest edge. Flatter triangles use their edges, which are at least as accurate as the
/// projection onto the plane.
constexpr double flatness = 1e-10;
/// Points farther from the mesh than `farthest` are replaced by points of the same direction at `farEnough` [mesh
/// sizes]. There, single precision is off by a thousandth of a size, and the change of direction to off-centre features
/// by half as much. Both are less than a millionth of the distance of points beyond `farthest`.
constexpr double farthest = 4000, farEnough = 1000;
/// The accuracy of distances: places closer than this count as one. A point projects into a triangle if it is this far
/// from all edges, despite single-precision rounding [voxels].
constexpr double samePlace = 1e-5;
/// Up to this distance, single precision is as accurate as the vertices [voxels].
constexpr double near = 16;
/// Max rounding of a point in floats, relative to its largest coordinate.
constexpr double pointRounding = 1.2e-7;
/// A shorter mean of normals has cancelled out, or is unknown.
constexpr double minMean = 1e-6;

// A place on an edge, relative to the query point.
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
    // from the nearer end: both triangles of an edge find the same point, whatever its direction in them
    const glm::dvec3 way = t <= 0.5 ? a + t * ab : b - (1 - t) * ab;
    return {way, glm::dot(way, way), -1};
}

}  // namespace

MeshTree::MeshTree(std::shared_ptr<const Mesh> mesh, float voxelSize)
    : mesh_((validate(*mesh), std::move(mesh))), voxelSize_(voxelSize), perMetre_(1 / double(voxelSize)) {
    const auto makeTree = [&] {
        tree_ = makeWideTree(*mesh_, voxelSize_, nullptr, {TreeOrder::split, longestEdge});
        groups_ = makeTurnedGroups(tree_);
    };
    tbb::parallel_invoke(makeTree, [&] { normals_ = FeatureNormals(*mesh_, thinnest * double(voxelSize_)); });
}

std::pair<glm::dvec3, glm::dvec3> MeshTree::box() const noexcept {
    const double voxel = voxelSize_;
    const glm::dvec3 base(tree_.base), size(tree_.size);
    return {(base - 1.0) * voxel, (base + size + 1.0) * voxel};
}

bool MeshTree::mayEnclose(const glm::dvec3& point) const noexcept {
    const auto [lower, upper] = box();
    return point == glm::clamp(point, lower, upper);
}

glm::dvec3 MeshTree::approached(const glm::dvec3& point) const noexcept {
    const auto [lower, upper] = box();
    return detail::approached(point, lower, upper, farthest, farEnough);
}

std::uint32_t MeshTree::nearestPart(const glm::dvec3& point, float bound) const noexcept {
    const glm::dvec3 from = approached(point);
    const double closer = glm::distance(point, from);
    if (!std::isfinite(closer) || !(double(bound) >= closer * perMetre_)) return noPart;
    const float left = from == point ? bound : std::numeric_limits<float>::infinity();
    return HWY_DYNAMIC_DISPATCH(searchAll)(tree_, groups_.data(), toTree(from), left);
}

std::uint32_t MeshTree::nearest(const glm::dvec3& point, float bound) const noexcept {
    const std::uint32_t part = nearestPart(point, bound);
    return part == noPart ? noTriangle : triangleOf(part);
}

std::uint32_t MeshTree::nearestPart(const glm::dvec3& point, float bound, const EntryPlace& place) const noexcept {
    return HWY_DYNAMIC_DISPATCH(searchEntry)(tree_, groups_.data(), toTree(point), bound, place);
}

void MeshTree::nearestParts(std::span<const glm::vec3> points, float bound, std::span<const EntryPlace> places,
                            std::span<std::uint32_t> parts) const noexcept {
    HWY_DYNAMIC_DISPATCH(searchEntries)(tree_, groups_.data(), perMetre_, points, bound, places, parts);
}

NearestFeature MeshTree::featureOfPart(std::uint32_t part, const glm::dvec3& point) const noexcept {
    const WideLeaf& leaf = tree_.leaves[part / treeWidth];
    const std::uint32_t i = part % treeWidth, triangle = leaf.triangles[i];
    const auto vectorOf = [i](const float(&v)[3][treeWidth]) { return glm::dvec3(v[0][i], v[1][i], v[2][i]); };
    const glm::dvec3 from = toTree(point) - vectorOf(leaf.cell) - vectorOf(leaf.corner);
    const glm::dvec3 along = vectorOf(leaf.along), normal = vectorOf(leaf.normal);
    const double x = glm::dot(from, along), y = glm::dot(from, glm::cross(normal, along)), z = glm::dot(from, normal);
    const double besideBC = double(leaf.directionBC[0][i]) * y -
                            double(leaf.directionBC[1][i]) * (x - double(leaf.lengthAB[i])),
                 besideAC = double(leaf.directionAC[1][i]) * x - double(leaf.directionAC[0][i]) * y;
    const double room = roomAt(point) * perMetre_;
    const bool over = std::min({y, besideBC, besideAC}) > room && std::abs(z) < near;
    if (!over || normals_.isFlat(triangle)) return featureOf(triangle, point);
    return {.triangle = triangle,
            .way = (-z * double(voxelSize_)) * normal,
            .normal = normal,
            .isOnSurface = std::abs(z) <= room};
}

// The distance from a feature up to which a point counts as on it [m].
double MeshTree::roomAt(const glm::dvec3& point) const noexcept {
    const double largest = std::max({std::abs(point.x), std::abs(point.y), std::abs(point.z)});
    return std::max(samePlace * double(voxelSize_), pointRounding * largest);
}

// Selects the vertex or edge of a triangle that a point on its surface lies on, if any. Keeps the normal if that of the
// feature is unknown.
void MeshTree::toSmallest(NearestFeature& found, const std::array<glm::dvec3, 3>& c, double room) const noexcept {
    const auto set = [&](Feature feature, std::size_t index, const glm::dvec3& normal) {
        found.feature = feature;
        found.index = std::uint8_t(index);
        if (glm::length(normal) > minMean) found.normal = normal;
    };
    const glm::uvec3& t = mesh_->triangles[found.triangle];
    for (int k = 0; k < 3; ++k)
        if (glm::length(c[std::size_t(k)]) <= room)
            return set(Feature::vertex, std::size_t(k), normals_.ofVertex(t[k]));
    for (int k = 0; k < 3; ++k)
        if (closestOnEdge(c, k).way2 <= room * room)
            return set(Feature::edge, std::size_t(k), normals_.ofEdge(found.triangle, k));
}

NearestFeature MeshTree::featureOf(std::uint32_t triangle, const glm::dvec3& point) const noexcept {
    const glm::uvec3& t = mesh_->triangles[triangle];
    const std::array<glm::dvec3, 3> c{glm::dvec3(mesh_->points[t.x]) - point, glm::dvec3(mesh_->points[t.y]) - point,
                                      glm::dvec3(mesh_->points[t.z]) - point};
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
    } else {
        toEdge(found, c);
    }
    const double room = roomAt(point);
    found.isOnSurface = glm::length(found.way) <= room;
    if (found.isOnSurface) toSmallest(found, c, room);
    return found;
}

// Selects the closest edge or vertex of a triangle.
void MeshTree::toEdge(NearestFeature& found, const std::array<glm::dvec3, 3>& c) const noexcept {
    OnEdge best = closestOnEdge(c, 0);
    int edge = 0;
    for (int i = 1; i < 3; ++i) {
        const OnEdge other = closestOnEdge(c, i);
        if (other.way2 < best.way2) best = other, edge = i;
    }
    found.way = best.way;
    found.feature = best.corner < 0 ? Feature::edge : Feature::vertex;
    found.index = std::uint8_t(best.corner < 0 ? edge : best.corner);
    found.normal = best.corner < 0 ? normals_.ofEdge(found.triangle, edge)
                                   : normals_.ofVertex(mesh_->triangles[found.triangle][best.corner]);
}

std::size_t MeshTree::memoryBytes() const {
    return mesh_->points.size() * sizeof(glm::vec3) + mesh_->triangles.size() * sizeof(glm::uvec3) +
           tree_.leafCount * sizeof(WideLeaf) + tree_.groupCount * (sizeof(BoxGroup) + sizeof(OrientedGroup)) +
           normals_.memoryBytes();
}

}  // namespace bilayer::detail
#endif  // HWY_ONCE
