// SPDX-License-Identifier: Apache-2.0
#include "sdf/grid/assemble.h"

#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_reduce.h>
#include <openvdb/tools/Prune.h>
#include <openvdb/tools/SignedFloodFill.h>
#include <openvdb/tree/LeafManager.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <map>
#include <type_traits>

#include "sdf/base/openvdb.h"
#include "sdf/base/progress.h"
#include "sdf/grid/tile_flood.h"
#include "sdf/leaf/sign_propagation.h"

namespace bilayer::detail {
namespace {

using Leaf = openvdb::FloatTree::LeafNodeType;
using TriangleGridLeaf = openvdb::Int32Tree::LeafNodeType;
using LargeNode = openvdb::FloatTree::RootNodeType::ChildNodeType;
using SmallNode = LargeNode::ChildNodeType;
static_assert(Leaf::DIM == blockSide);

std::unique_ptr<TriangleGridLeaf> triangleLeaf(const std::int32_t* triangles, const Leaf& like) {
    auto leaf = std::make_unique<TriangleGridLeaf>(openvdb::PartialCreate(), like.origin());
    leaf->buffer().allocate();
    for (openvdb::Index i = 0; i < blockVoxels; ++i) leaf->buffer().data()[i] = like.isValueOn(i) ? triangles[i] : -1;
    leaf->setValueMask(like.getValueMask());
    return leaf;
}

constexpr int depthOfLargeTiles = 1;        // in OpenVDB's tree: of tiles as large as a SmallNode
constexpr std::size_t leavesPerPoll = 256;  // takes tens of microseconds

// Gathers the first voxels of all rows of a slice into one byte, one bit per row.
std::uint64_t firstOfRows(std::uint64_t slice) {
    constexpr std::uint64_t everyFirst = 0x0101010101010101ull, gather = 0x0102040810204080ull;
    return ((slice & everyFirst) * gather) >> 56;
}

FaceBits facesOf(const BlockMask& inside) {
    FaceBits faces{};
    faces[0] = inside.front();
    faces[3] = inside.back();
    for (std::size_t x = 0; x < inside.size(); ++x) {
        const std::uint64_t slice = inside[x];
        const auto put = [&](std::size_t face, std::uint64_t row) { faces[face] |= row << (x * blockSide); };
        put(1, slice & 0xff);
        put(4, slice >> 56);
        put(2, firstOfRows(slice));
        put(5, firstOfRows(slice >> (blockSide - 1)));
    }
    return faces;
}

BlockMask insideOf(const Leaf& leaf) {
    BlockMask inside{};
    const float* values = leaf.buffer().data();
    for (std::size_t i = 0; i < std::size_t(blockVoxels); ++i)
        inside[i / 64] |= std::uint64_t(std::signbit(values[i])) << (i % 64);
    return inside;
}

// Returns whether a block lies entirely on one side and has no voxel in the band.
bool isPlain(const BandMasks& masks) {
    return !any(masks.active) && std::all_of(masks.inside.begin(), masks.inside.end(), [&](std::uint64_t word) {
        return word == masks.inside[0] && word + 1 <= 1;
    });
}

BlockMask activeOf(const Leaf& leaf) {
    BlockMask active;
    for (openvdb::Index word = 0; word < blockSide; ++word)
        active[word] = leaf.getValueMask().getWord<std::uint64_t>(word);
    return active;
}

// Pairs of voxels across a face of a block. The block's own voxels are at first + i * rowStep + j * step, their
// partners at an offset of `across`.
struct BlockFace {
    openvdb::Coord toNeighbour;
    int first, rowStep, step, across;
};
constexpr int lastLayer = blockSide - 1, xStep = blockSide * blockSide, yStep = blockSide;
const BlockFace forwardFaces[3] = {{{blockSide, 0, 0}, lastLayer* xStep, yStep, 1, -lastLayer* xStep},
                                   {{0, blockSide, 0}, lastLayer* yStep, xStep, 1, -lastLayer* yStep},
                                   {{0, 0, blockSide}, lastLayer, xStep, yStep, -lastLayer}};

// Compares distances only where the bits of two faces differ, that is, where the surface passes between them.
class ConflictCounter {
  public:
    /// @param part  null: the whole field
    /// @param largeTiles  origins of the tiles of the tree's largest nodes that may be inside
    ConflictCounter(const openvdb::FloatTree& tree, const std::vector<FaceBits>& faces,
                    const std::vector<openvdb::Coord>& largeTiles, float voxelSize, const FieldPart* part)
        : tree_(tree), faces_(faces), largeTiles_(largeTiles), voxel_(voxelSize), part_(part) {}

    std::size_t count() const {
        const openvdb::tree::LeafManager<const openvdb::FloatTree> leaves(tree_);
        return tbb::parallel_reduce(
                   tbb::blocked_range<std::size_t>(0, leaves.leafCount(), 64), std::size_t(0),
                   [&](const auto& range, std::size_t sum) {
                       const openvdb::tree::ValueAccessor<const openvdb::FloatTree> accessor(tree_);
                       for (std::size_t i = range.begin(); i < range.end(); ++i)
                           sum += atLeaf(leaves.leaf(i), accessor);
                       return sum;
                   },
                   std::plus<>()) +
               (part_ ? atOuterFaces() : atLargeTiles());
    }

  private:
    // The flood fill of tiles stops at the borders of the tree's largest nodes. An inside-out mesh therefore shows
    // large inside tiles next to the space outside of all nodes.
    std::size_t atLargeTiles() const {
        std::size_t sum = 0;
        for (const openvdb::Coord& tile : largeTiles_)
            if (tree_.getValueDepth(tile) <= depthOfLargeTiles && tree_.getValue(tile) < 0) sum += towardsOutside(tile);
        return sum;
    }

    // An inside-out mesh shows inside voxels where the lattice of all parts ends.
    std::size_t atOuterFaces() const {
        const FaceSides sides = faceSides(tree_, *part_);
        std::size_t sum = 0;
        for (int face = 0; face < 6; ++face) {
            const int end = face < 3 ? -part_->own.first[face] : part_->own.end[face - 3];
            sum += end >= unbounded && sides[std::size_t(face)].inside;
        }
        return sum;
    }

    // Returns whether the pairs with this lower block are counted.
    bool counts(const openvdb::Coord& lower) const {
        return !part_ || part_->own.contains({lower.x(), lower.y(), lower.z()});
    }

    std::size_t towardsOutside(const openvdb::Coord& tile) const {
        constexpr int side = SmallNode::DIM;
        std::size_t sum = 0;
        for (int axis = 0; axis < 3; ++axis)
            for (const int step : {-side, side}) {
                openvdb::Coord next = tile;
                next[axis] += step;
                // a finer neighbour may start outside, because there are leaves in between
                sum += tree_.getValueDepth(next) <= depthOfLargeTiles && tree_.getValue(next) > 0;
            }
        return sum;
    }

    template <class Accessor>
    std::size_t atLeaf(const Leaf& leaf, const Accessor& accessor) const {
        std::size_t sum = 0;
        const float* values = leaf.buffer().data();
        const FaceBits& bits = faces_[leaf.transientData()];
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const BlockFace& face = forwardFaces[axis];
            const openvdb::Coord next = leaf.origin() + face.toNeighbour, previous = leaf.origin() - face.toNeighbour;
            const Leaf* other = accessor.probeConstLeaf(next);
            if (!counts(leaf.origin())) {
                // a neighbouring part counts them
            } else if (other)
                sum += between(face, bits[axis + 3] ^ faces_[other->transientData()][axis], values + face.first,
                               other->buffer().data() + face.first + face.across);
            else
                sum += towards(face, bits[axis + 3], values + face.first, accessor.getValue(next));
            if (counts(previous) && !accessor.probeConstLeaf(previous))
                sum += towards(face, bits[axis], values + face.first + face.across, accessor.getValue(previous));
        }
        return sum;
    }

    static int place(const BlockFace& face, int bit) {
        return bit / blockSide * face.rowStep + bit % blockSide * face.step;
    }

    std::size_t between(const BlockFace& face, std::uint64_t differ, const float* a, const float* b) const {
        const float room = voxel_ * (1 + linkSlack);
        std::size_t sum = 0;
        for (; differ; differ &= differ - 1) {
            const int i = place(face, std::countr_zero(differ));
            sum += std::abs(a[i]) + std::abs(b[i]) > room;
        }
        return sum;
    }

    // Empty space is at least one voxel away from the surface, or the band width if that is less.
    std::size_t towards(const BlockFace& face, std::uint64_t inside, const float* a, float tile) const {
        const float room = voxel_ * (1 + linkSlack) - std::min(std::abs(tile), voxel_);
        std::size_t sum = 0;
        for (std::uint64_t differ = tile < 0 ? ~inside : inside; differ; differ &= differ - 1)
            sum += std::abs(a[place(face, std::countr_zero(differ))]) > room;
        return sum;
    }

    const openvdb::FloatTree& tree_;
    const std::vector<FaceBits>& faces_;
    const std::vector<openvdb::Coord>& largeTiles_;
    float voxel_;
    const FieldPart* part_;
};

}  // namespace

void Assembler::take(const FilledBlocks& blocks) {
    std::vector<Collected>& leaves = leaves_.local();
    BandMasks masks;
    for (std::size_t b = 0; b < blocks.origins.size(); ++b) {
        const glm::ivec3 o = blocks.origins[b];
        auto leaf = std::make_unique<Leaf>(openvdb::PartialCreate(), coordOf(o));
        leaf->buffer().allocate();
        if (!trimToBand(blocks.distances.data() + b * blockVoxels, widths_, leaf->buffer().data(), masks)) continue;
        const bool plain = isPlain(masks);
        if (plain && plain_ == Plain::drop) continue;
        Leaf::NodeMaskType mask;
        for (openvdb::Index word = 0; word < blockSide; ++word) mask.getWord<std::uint64_t>(word) = masks.active[word];
        leaf->setValueMask(mask);
        if (wantTriangles_ && !mask.isOff() && (!part_ || part_->own.contains(o)))
            triangleLeaves_.local().push_back(triangleLeaf(blocks.triangles.data() + b * blockVoxels, *leaf));
        leaves.push_back({std::move(leaf), facesOf(masks.inside), plain});
    }
}

void Assembler::copy(const Grids& from, const std::function<bool(const openvdb::Coord&)>& keep) {
    const auto forEachKept = [&](const auto& tree, auto visit) {
        const openvdb::tree::LeafManager<std::remove_reference_t<decltype(tree)>> leaves(tree);
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, leaves.leafCount(), 64), [&](const auto& range) {
            progress_.poll();
            for (std::size_t i = range.begin(); i < range.end(); ++i)
                if (keep(leaves.leaf(i).origin())) visit(leaves.leaf(i));
        });
    };
    forEachKept(from.distance->tree(), [&](const Leaf& leaf) {
        const BlockMask inside = insideOf(leaf);
        leaves_.local().push_back({std::make_unique<Leaf>(leaf), facesOf(inside), isPlain({activeOf(leaf), inside})});
    });
    if (wantTriangles_)
        forEachKept(from.triangle->tree(), [&](const TriangleGridLeaf& leaf) {
            triangleLeaves_.local().push_back(std::make_unique<TriangleGridLeaf>(leaf));
        });
}

// The leaves below each node of the next level.
struct Assembler::Branch {
    std::vector<Collected*> leaves;
    std::size_t firstFaces = 0;
    std::unique_ptr<SmallNode> owned{};  // until the tree takes it over
    SmallNode* node = nullptr;
    std::vector<const Leaf*> plain{};
};

std::vector<Assembler::Branch> Assembler::branches() {
    std::vector<Branch> all;
    std::map<openvdb::Coord, std::size_t> places;
    std::size_t place = 0;
    openvdb::Coord last;
    for (auto& some : leaves_)
        for (Collected& one : some) {
            // consecutive leaves are mostly below the same node
            const openvdb::Coord origin = one.leaf->origin() & ~(SmallNode::DIM - 1);
            if (all.empty() || origin != last) {
                place = places.try_emplace(origin, all.size()).first->second;
                if (place == all.size()) all.emplace_back();
                last = origin;
            }
            all[place].leaves.push_back(&one);
        }
    for (std::size_t i = 1; i < all.size(); ++i) all[i].firstFaces = all[i - 1].firstFaces + all[i - 1].leaves.size();
    return all;
}

void Assembler::grow(Branch& branch, float background) {
    branch.owned = std::make_unique<SmallNode>(branch.leaves.front()->leaf->origin(), background);
    branch.node = branch.owned.get();
    std::size_t faces = branch.firstFaces;
    for (Collected* one : branch.leaves) {
        if (one->plain) branch.plain.push_back(one->leaf.get());
        one->leaf->setTransientData(openvdb::Index32(faces));
        faces_[faces++] = one->faces;
        branch.node->addLeaf(one->leaf.release());
    }
}

openvdb::FloatGrid::Ptr Assembler::distances() {
    return distances(widths_.exterior * widths_.voxelSize, -widths_.interior * widths_.voxelSize);
}

openvdb::FloatGrid::Ptr Assembler::distances(float exterior, float interior) {
    auto grid = openvdb::FloatGrid::create(exterior);
    std::vector<Branch> branches = this->branches();
    if (!branches.empty()) faces_.resize(branches.back().firstFaces + branches.back().leaves.size());
    const auto forEachBranch = [&](auto visit) {
        tbb::parallel_for(std::size_t(0), branches.size(), [&](std::size_t i) {
            progress_.poll();
            visit(branches[i]);
        });
    };
    forEachBranch([&](Branch& branch) { grow(branch, exterior); });
    for (Branch& branch : branches) {
        const openvdb::Coord origin = branch.node->origin();
        if (!grid->tree().probeNode<LargeNode>(origin)) grid->tree().root().addChild(new LargeNode(origin, exterior));
        grid->tree().probeNode<LargeNode>(origin)->addChild(branch.owned.release());
    }
    if (part_) {
        floodPart(grid->tree(), *part_, exterior, interior);
    } else {
        // leaves already have signs, so only tiles between them are flooded; uniform leaves beyond the band become
        // tiles too
        forEachBranch([&](Branch& branch) { floodTiles(*branch.node, interior, [](openvdb::Index) {}); });
        for (auto node = grid->tree().root().beginChildOn(); node; ++node)
            floodTiles(*node, interior, [&](openvdb::Index n) { largeTiles_.push_back(node->offsetToGlobalCoord(n)); });
        openvdb::tools::SignedFloodFillOp<openvdb::FloatTree>(exterior, interior)(grid->tree().root());
        for (const Branch& branch : branches)
            if (branch.plain.size() == branch.leaves.size()) largeTiles_.push_back(branch.node->origin());
        forEachBranch([](Branch& branch) {
            for (const Leaf* leaf : branch.plain) {
                const float value = leaf->getFirstValue();  // remove the leaf before its tile is added
                branch.node->addTile(1, leaf->origin(), value, false);
            }
        });
    }
    openvdb::tools::pruneTiles(grid->tree());
    grid->setName("distance");
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    return grid;
}

openvdb::Int32Grid::Ptr Assembler::triangles() {
    if (!wantTriangles_) return nullptr;
    auto grid = openvdb::Int32Grid::create(-1);
    std::size_t added = 0;
    for (auto& some : triangleLeaves_)
        for (auto& leaf : some) {
            if (added++ % leavesPerPoll == 0) progress_.poll();
            grid->tree().addLeaf(leaf.release());
        }
    grid->setName("triangle");
    return grid;
}

std::size_t Assembler::conflicts(const openvdb::FloatGrid& distances) const {
    return ConflictCounter(distances.tree(), faces_, largeTiles_, float(distances.voxelSize()[0]), part_).count();
}

}  // namespace bilayer::detail
