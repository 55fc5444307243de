// SPDX-License-Identifier: Apache-2.0
// Highway compiles the part between HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE once for each instruction set. The
// tests omit a pair only when it certainly does not intersect, so all instruction sets lead to the same counts.
#include "sdf/bvh/close_pairs.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "sdf/bvh/close_pairs.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <bit>
#include <optional>

#include "sdf/bvh/rotated_boxes.h"
#include "sdf/bvh/tree_lanes.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace {

using IndexTag = hn::RebindToUnsigned<Tag>;

/// Rounding error of a volume in floats, relative to the sum of the absolute values of its products: eight roundings
/// plus a margin.
constexpr float roundingOfVolume = 1e-6f;
/// Rounding error of a coordinate along an oblique axis in floats, relative to the max coordinate; generous.
constexpr float roundingOfPlaces = 4e-6f;
/// Upper bound on what underflow of products loses.
constexpr float minProduct = 1e-30f, minVolume = 1e-37f;

// One point in all lanes.
inline PointLanes pointAt(const float (&p)[3][treeWidth], std::size_t i) {
    const Tag tag;
    return {hn::Set(tag, p[0][i]), hn::Set(tag, p[1][i]), hn::Set(tag, p[2][i])};
}

struct BoxLanes {
    PointLanes lower, upper;

    explicit BoxLanes(const PointLanes* c)
        : lower{smallest(c[0].x, c[1].x, c[2].x), smallest(c[0].y, c[1].y, c[2].y), smallest(c[0].z, c[1].z, c[2].z)},
          upper{largest(c[0].x, c[1].x, c[2].x), largest(c[0].y, c[1].y, c[2].y), largest(c[0].z, c[1].z, c[2].z)} {}
    BoxLanes(const PointLanes& lower, const PointLanes& upper) : lower(lower), upper(upper) {}

    Mask meet(const BoxLanes& o) const {
        const Mask x = hn::And(hn::Le(lower.x, o.upper.x), hn::Le(o.lower.x, upper.x));
        const Mask y = hn::And(hn::Le(lower.y, o.upper.y), hn::Le(o.lower.y, upper.y));
        const Mask z = hn::And(hn::Le(lower.z, o.upper.z), hn::Le(o.lower.z, upper.z));
        return hn::And(x, hn::And(y, z));
    }

    // Tests whether both boxes lie in one plane across an axis, and thus all triangles in them.
    Mask share(const BoxLanes& o) const {
        const auto flat = [](Vec low, Vec otherLow, Vec high, Vec otherHigh) {
            return hn::Eq(hn::Min(low, otherLow), hn::Max(high, otherHigh));
        };
        return hn::Or(
            flat(lower.x, o.lower.x, upper.x, o.upper.x),
            hn::Or(flat(lower.y, o.lower.y, upper.y, o.upper.y), flat(lower.z, o.lower.z, upper.z, o.upper.z)));
    }

    static Vec smallest(Vec a, Vec b, Vec c) { return hn::Min(a, hn::Min(b, c)); }
    static Vec largest(Vec a, Vec b, Vec c) { return hn::Max(a, hn::Max(b, c)); }
};

// The planes of triangles, and tests for the side on which points certainly lie.
struct Planes {
    PointLanes origin, normal, sizes;  // `sizes`: absolute values of the products in the normal

    explicit Planes(const PointLanes* c) : Planes(c[0], c[1] - c[0], c[2] - c[0]) {}
    // Through a point, along two directions.
    Planes(const PointLanes& origin, const PointLanes& u, const PointLanes& v) : origin(origin) {
        const auto products = [](Vec a, Vec b, Vec c, Vec d, Vec& difference, Vec& size) {
            const Vec first = hn::Mul(a, b), second = hn::Mul(c, d);
            difference = hn::Sub(first, second);
            size = hn::Add(hn::Add(hn::Abs(first), hn::Abs(second)), hn::Set(Tag(), minProduct));
        };
        products(u.y, v.z, u.z, v.y, normal.x, sizes.x);
        products(u.z, v.x, u.x, v.z, normal.y, sizes.y);
        products(u.x, v.y, u.y, v.x, normal.z, sizes.z);
    }

    void sides(const PointLanes& p, Mask& above, Mask& below) const {
        const PointLanes d = p - origin;
        const auto sum = [](Vec a, Vec b, Vec c) { return hn::Add(hn::Add(a, b), c); };
        const Vec volume = sum(hn::Mul(normal.x, d.x), hn::Mul(normal.y, d.y), hn::Mul(normal.z, d.z));
        const Vec size =
            sum(hn::Mul(sizes.x, hn::Abs(d.x)), hn::Mul(sizes.y, hn::Abs(d.y)), hn::Mul(sizes.z, hn::Abs(d.z)));
        const Vec room = hn::Add(hn::Mul(size, hn::Set(Tag(), roundingOfVolume)), hn::Set(Tag(), minVolume));
        above = hn::Gt(volume, room);
        below = hn::Lt(volume, hn::Neg(room));
    }

    // Tests whether a triangle lies on one side, except for corners that it shares.
    Mask separates(const PointLanes* corners, const Mask* shared) const {
        Mask above[3], below[3];
        for (int k = 0; k < 3; ++k) {
            sides(corners[k], above[k], below[k]);
            above[k] = hn::Or(above[k], shared[k]);
            below[k] = hn::Or(below[k], shared[k]);
        }
        return hn::Or(hn::And(above[0], hn::And(above[1], above[2])), hn::And(below[0], hn::And(below[1], below[2])));
    }
};

// Tests whether a plane through an edge of each first triangle, along its normal, has the triangles on two sides,
// except for vertices on that edge. Triangles that lie next to each other in about one plane are separated in this way.
Mask separatedAtEdges(const PointLanes* first, const PointLanes* second, const Mask* shared) {
    const PointLanes normal = Planes(first).normal;
    Mask separated = hn::FirstN(Tag(), 0);
    for (int k = 0; k < 3; ++k) {
        const PointLanes &from = first[k], &to = first[(k + 1) % 3], &opposite = first[(k + 2) % 3];
        const Planes plane(from, to - from, normal);
        Mask inAbove, inBelow;
        plane.sides(opposite, inAbove, inBelow);
        for (int i = 0; i < 3; ++i) {
            Mask above, below;
            plane.sides(second[i], above, below);
            // a shared vertex is on the edge, or certainly on the side of the opposite corner
            inBelow = hn::And(inBelow, hn::Or(above, hn::AndNot(below, shared[i])));
            inAbove = hn::And(inAbove, hn::Or(below, hn::AndNot(above, shared[i])));
        }
        separated = hn::Or(separated, hn::Or(inAbove, inBelow));
    }
    return separated;
}

// The triangles of a leaf, or as many as a vector holds.
struct Lanes {
    PointLanes corners[3];
    BoxLanes boxes;

    Lanes(const TriangleLeaf& leaf, std::size_t lane)
        : corners{loadLanes(Tag(), leaf.corners[0], lane), loadLanes(Tag(), leaf.corners[1], lane),
                  loadLanes(Tag(), leaf.corners[2], lane)},
          boxes(corners) {}
};

// The same lanes with the data for pair tests.
struct Others {
    const Lanes& lanes;
    hn::Vec<IndexTag> vertices[3];
    Planes planes;

    Others(const Mesh& mesh, const TriangleLeaf& leaf, std::size_t lane, const Lanes& lanes)
        : lanes(lanes), planes(lanes.corners) {
        alignas(64) std::uint32_t numbers[3][treeWidth];
        for (std::size_t i = lane; i < lane + hn::Lanes(Tag()); ++i)
            for (int k = 0; k < 3; ++k) numbers[k][i] = mesh.triangles[leaf.triangles[i]][k];
        for (int k = 0; k < 3; ++k) vertices[k] = hn::Load(IndexTag(), numbers[k] + lane);
    }

    // Returns the lanes of the mask whose triangles may intersect a triangle.
    Mask close(const PointLanes* other, const glm::uvec3& t, Mask mask) const {
        // the corners of each lane, and the corners of the other triangle, that are shared
        Mask mine[3], its[3];
        for (int k = 0; k < 3; ++k) mine[k] = its[k] = hn::FirstN(Tag(), 0);
        for (int i = 0; i < 3; ++i)
            for (int k = 0; k < 3; ++k) {
                const Mask same = hn::RebindMask(Tag(), hn::Eq(vertices[i], hn::Set(IndexTag(), t[k])));
                mine[i] = hn::Or(mine[i], same);
                its[k] = hn::Or(its[k], same);
            }
        const Mask edge = hn::Or(hn::And(mine[0], hn::Or(mine[1], mine[2])), hn::And(mine[1], mine[2]));
        mask = hn::AndNot(hn::Or(edge, Planes(other).separates(lanes.corners, mine)), mask);
        if (hn::AllFalse(Tag(), mask)) return mask;
        mask = hn::AndNot(planes.separates(other, its), mask);
        if (hn::AllFalse(Tag(), mask)) return mask;
        mask = hn::AndNot(separatedAtEdges(lanes.corners, other, its), mask);
        if (hn::AllFalse(Tag(), mask)) return mask;
        return hn::AndNot(separatedAtEdges(other, lanes.corners, mine), mask);
    }
};

// A leaf along the axes of its group.
struct OrientedLeaf {
    const OrientedGroup& group;
    ChildBox box, edges;              // all of the leaf, and the edges opposite to the common vertex
    std::uint32_t vertex = noVertex;  // that all triangles of the leaf share

    OrientedLeaf(const TriangleTree& tree, const OrientedGroup& group, std::size_t place)
        : group(group), box(group.lower, group.upper, place), edges(box) {
        if (const FanGroup* fans = tree.fanGroup(group)) {
            vertex = fans->vertex[place];
            edges = ChildBox(fans->lower, fans->upper, place);
        }
    }
};

class LeafPairs {
  public:
    LeafPairs(const Mesh& mesh, const TriangleTree& tree, std::uint32_t leaf,
              std::vector<std::pair<unsigned, unsigned>>& pairs)
        : mesh_(mesh),
          tree_(tree),
          index_(leaf),
          leaf_(tree.leaf(leaf)),
          room_(roundingOfPlaces * tree.largestCoordinate()),
          pairs_(pairs) {
        if (const OrientedGroup* group = tree.orientedGroup(tree.boxes().leafCount + leaf / treeWidth))
            oriented_.emplace(tree, *group, leaf % treeWidth);
        for (std::size_t lane = 0; lane < treeWidth; lane += hn::Lanes(Tag())) {
            const BoxLanes boxes = Lanes(leaf_, lane).boxes;
            store(boxes.lower, lower_, lane);
            store(boxes.upper, upper_, lane);
        }
    }

    void find() {
        const BoxLanes own = boxAt(tree_.boxes().groups[index_ / treeWidth], index_ % treeWidth);
        descend(tree_.boxes().root(), own);
    }

  private:
    static BoxLanes boxAt(const BoxGroup& group, std::size_t place) {
        return {pointAt(group.lower, place), pointAt(group.upper, place)};
    }

    void descend(std::uint32_t node, const BoxLanes& own) {
        const BoxGroup& group = tree_.boxes().group(node);
        for (std::size_t lane = 0; lane < treeWidth; lane += hn::Lanes(Tag())) {
            const BoxLanes boxes(loadLanes(Tag(), group.lower, lane), loadLanes(Tag(), group.upper, lane));
            unsigned bits = bitsOf(hn::AndNot(boxes.share(own), boxes.meet(own)));
            if (bits != 0 && oriented_)
                if (const OrientedGroup* other = tree_.orientedGroup(node)) bits &= inOriented(*other, lane);
            for (; bits != 0; bits &= bits - 1) {
                const std::size_t place = lane + std::size_t(std::countr_zero(bits));
                const std::uint32_t child = group.firstChild + std::uint32_t(place);
                if (!tree_.boxes().isLeaf(child))
                    descend(child, own);
                else if (child >= index_)
                    meet(child, boxAt(group, place), own);
            }
        }
    }

    static void store(const PointLanes& points, float (&to)[3][treeWidth], std::size_t lane) {
        hn::Store(points.x, Tag(), to[0] + lane);
        hn::Store(points.y, Tag(), to[1] + lane);
        hn::Store(points.z, Tag(), to[2] + lane);
    }

    // Returns a bit for each child of a group, from a lane on, whose triangles may meet those of the leaf.
    unsigned inOriented(const OrientedGroup& group, std::size_t lane) const {
        const Rotation rotation(oriented_->group, group, room_);
        const unsigned bits = reached(group, lane) & rotation.met(oriented_->box, group.lower, group.upper, lane);
        const FanGroup* fans = tree_.fanGroup(group);
        if (bits == 0 || oriented_->vertex == noVertex || !fans) return bits;
        unsigned sameFan = 0;
        for (std::size_t i = 0; lane + i < treeWidth; ++i)
            sameFan |= unsigned(fans->vertex[lane + i] == oriented_->vertex) << i;
        return bits & (~sameFan | rotation.met(oriented_->edges, group.lower, group.upper, lane) |
                       rotation.met(oriented_->box, fans->lower, fans->upper, lane));
    }

    // Returns the lanes whose triangles meet the leaf's box along its own axes.
    Mask alongAxes(const Lanes& lanes) const {
        const Tag tag;
        Mask meets = hn::FirstN(tag, treeWidth);
        if (!oriented_) return meets;
        const ChildBox& box = oriented_->box;
        for (int k = 0; k < 3; ++k) {
            const PointLanes axis = axisLanes(oriented_->group, k);
            const Vec a = dot(lanes.corners[0], axis), b = dot(lanes.corners[1], axis), c = dot(lanes.corners[2], axis);
            meets = hn::And(meets, hn::And(hn::Le(BoxLanes::smallest(a, b, c), hn::Set(tag, box.upper[k] + room_)),
                                           hn::Ge(BoxLanes::largest(a, b, c), hn::Set(tag, box.lower[k] - room_))));
        }
        return meets;
    }

    static PointLanes axisLanes(const OrientedGroup& group, int k) {
        const Tag tag;
        return {hn::Set(tag, group.axes[k][0]), hn::Set(tag, group.axes[k][1]), hn::Set(tag, group.axes[k][2])};
    }

    // Returns a bit for each oriented box of a group, from a lane on, that the leaf's corners reach.
    unsigned reached(const OrientedGroup& group, std::size_t lane) const {
        const Tag tag;
        Mask meets = hn::FirstN(tag, treeWidth);
        const Vec room = hn::Set(tag, room_);
        for (int k = 0; k < 3; ++k) {
            const PointLanes axis = axisLanes(group, k);
            Vec low = dot(loadLanes(tag, leaf_.corners[0], 0), axis), high = low;
            for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag))
                for (const auto& corner : leaf_.corners) {
                    const Vec at = dot(loadLanes(tag, corner, i), axis);
                    low = hn::Min(low, at);
                    high = hn::Max(high, at);
                }
            low = hn::Sub(hn::MinOfLanes(tag, low), room);
            high = hn::Add(hn::MaxOfLanes(tag, high), room);
            meets = hn::And(meets, hn::And(hn::Le(hn::Load(tag, group.lower[k] + lane), high),
                                           hn::Ge(hn::Load(tag, group.upper[k] + lane), low)));
        }
        return bitsOf(meets);
    }

    // Returns the triangles of the leaf whose boxes overlap a box.
    unsigned inBox(const BoxLanes& box) const {
        unsigned all = 0;
        for (std::size_t lane = 0; lane < treeWidth; lane += hn::Lanes(Tag()))
            all |= bitsOf(BoxLanes(loadLanes(Tag(), lower_, lane), loadLanes(Tag(), upper_, lane)).meet(box)) << lane;
        return all & ((1u << tree_.leafSize(index_)) - 1);
    }

    void meet(std::uint32_t other, const BoxLanes& box, const BoxLanes& own) {
        const unsigned mine = inBox(box);
        if (mine == 0) return;
        const TriangleLeaf& leaf = tree_.leaf(other);
        const Tag tag;
        const std::size_t count = tree_.leafSize(other);
        for (std::size_t lane = 0; lane < count; lane += hn::Lanes(tag)) {
            const Lanes lanes(leaf, lane);
            const Mask inBoxes = hn::And(hn::FirstN(tag, count - lane), lanes.boxes.meet(own));
            if (hn::AllFalse(tag, inBoxes)) continue;
            const Mask near = hn::And(inBoxes, alongAxes(lanes));
            if (hn::AllFalse(tag, near)) continue;
            const Others others(mesh_, leaf, lane, lanes);
            for (unsigned bits = mine; bits != 0; bits &= bits - 1)
                take(others, leaf, lane, std::size_t(std::countr_zero(bits)), near, other == index_);
        }
    }

    void take(const Others& others, const TriangleLeaf& leaf, std::size_t lane, std::size_t i, Mask near, bool same) {
        const BoxLanes box(pointAt(lower_, i), pointAt(upper_, i)), &boxes = others.lanes.boxes;
        Mask mask = hn::AndNot(boxes.share(box), hn::And(near, boxes.meet(box)));
        if (hn::AllFalse(Tag(), mask)) return;
        const PointLanes corners[3] = {pointAt(leaf_.corners[0], i), pointAt(leaf_.corners[1], i),
                                       pointAt(leaf_.corners[2], i)};
        mask = others.close(corners, mesh_.triangles[leaf_.triangles[i]], mask);
        for (unsigned bits = bitsOf(mask); bits != 0; bits &= bits - 1) {
            const std::size_t k = lane + std::size_t(std::countr_zero(bits));
            // within its own leaf, a triangle is paired with later ones only
            if (!same || k > i) pairs_.emplace_back(leaf_.triangles[i], leaf.triangles[k]);
        }
    }

    const Mesh& mesh_;
    const TriangleTree& tree_;
    const std::uint32_t index_;
    const TriangleLeaf& leaf_;
    const float room_;                                             // margin along axes [m]
    std::optional<OrientedLeaf> oriented_;                         // nothing if the tree has no oriented boxes
    alignas(64) float lower_[3][treeWidth], upper_[3][treeWidth];  // boxes of the leaf's triangles
    std::vector<std::pair<unsigned, unsigned>>& pairs_;
};

void findPairs(const Mesh& mesh, const TriangleTree& tree, std::uint32_t leaf,
               std::vector<std::pair<unsigned, unsigned>>& pairs) {
    LeafPairs(mesh, tree, leaf, pairs).find();
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer::detail {
HWY_EXPORT(findPairs);

void findClosePairs(const Mesh& welded, const TriangleTree& tree, std::uint32_t leaf,
                    std::vector<std::pair<unsigned, unsigned>>& pairs) {
    pairs.clear();
    HWY_DYNAMIC_DISPATCH(findPairs)(welded, tree, leaf, pairs);
}

}  // namespace bilayer::detail
#endif  // HWY_ONCE
