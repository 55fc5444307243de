#include "sdf/assemble.h"

#include <oneapi/tbb/parallel_reduce.h>
#include <openvdb/tools/Prune.h>
#include <openvdb/tools/SignedFloodFill.h>
#include <openvdb/tree/LeafManager.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "sdf/links.h"

namespace bilayer {
namespace {

using Leaf = openvdb::FloatTree::LeafNodeType;
using TriangleLeaf = openvdb::Int32Tree::LeafNodeType;
using LargeNode = openvdb::FloatTree::RootNodeType::ChildNodeType;
static_assert(Leaf::DIM == blockSide);

std::unique_ptr<TriangleLeaf> triangleLeaf(const std::int32_t* triangles, const Leaf& like) {
    auto leaf = std::make_unique<TriangleLeaf>(openvdb::PartialCreate(), like.origin());
    leaf->buffer().allocate();
    for (openvdb::Index i = 0; i < blockVoxels; ++i) leaf->buffer().data()[i] = like.isValueOn(i) ? triangles[i] : -1;
    leaf->setValueMask(like.getValueMask());
    return leaf;
}

template <class Leaves, class Tree>
void move(Leaves& leaves, Tree& tree) {
    for (auto& some : leaves)
        for (auto& leaf : some) tree.addLeaf(leaf.release());
}

// Pairs of voxels across a face of a block: the block's own are at first + i * rowStep + j * step, the other side's at
// `across` from them.
struct Face {
    openvdb::Coord toNeighbour;
    int first, rowStep, step, across;
};
constexpr int lastLayer = blockSide - 1, xStep = blockSide * blockSide, yStep = blockSide;
const Face forwardFaces[3] = {{{blockSide, 0, 0}, lastLayer* xStep, yStep, 1, -lastLayer* xStep},
                              {{0, blockSide, 0}, lastLayer* yStep, xStep, 1, -lastLayer* yStep},
                              {{0, 0, blockSide}, lastLayer, xStep, yStep, -lastLayer}};

class ConflictCounter {
  public:
    explicit ConflictCounter(const openvdb::FloatGrid& grid) : tree_(grid.tree()), voxel_(float(grid.voxelSize()[0])) {}

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
               atLargeTiles();
    }

  private:
    // The flood of tiles stops at the edges of the tree's largest nodes. So a mesh inside out shows as large tiles that
    // are inside, next to the space outside all nodes.
    std::size_t atLargeTiles() const {
        std::size_t sum = 0;
        for (auto node = tree_.root().cbeginChildOn(); node; ++node)
            for (openvdb::Index n = 0; n < LargeNode::NUM_VALUES; ++n)
                if (node->isChildMaskOff(n) && node->getTable()[n].getValue() < 0)
                    sum += towardsOutside(node->offsetToGlobalCoord(n));
        return sum;
    }

    std::size_t towardsOutside(const openvdb::Coord& tile) const {
        constexpr int side = LargeNode::ChildNodeType::DIM;
        std::size_t sum = 0;
        for (int axis = 0; axis < 3; ++axis)
            for (const int step : {-side, side}) {
                openvdb::Coord next = tile;
                next[axis] += step;
                float value = 0;
                sum += !tree_.probeConstLeaf(next) && !tree_.probeValue(next, value) && value > 0;
            }
        return sum;
    }

    template <class Accessor>
    std::size_t atLeaf(const Leaf& leaf, const Accessor& accessor) const {
        std::size_t sum = 0;
        for (const Face& face : forwardFaces) {
            const openvdb::Coord next = leaf.origin() + face.toNeighbour, previous = leaf.origin() - face.toNeighbour;
            const float* values = leaf.buffer().data();
            if (const Leaf* other = accessor.probeConstLeaf(next))
                sum += between(face, values + face.first, other->buffer().data() + face.first + face.across);
            else
                sum += towards(face, values + face.first, accessor.getValue(next));
            if (!accessor.probeConstLeaf(previous))
                sum += towards(face, values + face.first + face.across, accessor.getValue(previous));
        }
        return sum;
    }

    std::size_t between(const Face& face, const float* a, const float* b) const {
        const float room = voxel_ * (1 + linkSlack);
        std::size_t sum = 0;
        for (int i = 0; i < blockSide; ++i)
            for (int j = 0; j < blockSide; ++j) {
                const float p = a[i * face.rowStep + j * face.step], q = b[i * face.rowStep + j * face.step];
                sum += std::size_t(int((p < 0) != (q < 0)) & int(std::abs(p) + std::abs(q) > room));
            }
        return sum;
    }

    // Empty space is a voxel away from the surface at least.
    std::size_t towards(const Face& face, const float* a, float tile) const {
        std::size_t sum = 0;
        for (int i = 0; i < blockSide; ++i)
            for (int j = 0; j < blockSide; ++j) {
                const float p = a[i * face.rowStep + j * face.step];
                sum += std::size_t(int((p < 0) != (tile < 0)) & int(std::abs(p) > voxel_ * linkSlack));
            }
        return sum;
    }

    const openvdb::FloatTree& tree_;
    float voxel_;
};

}  // namespace

void Assembler::take(const FilledBlocks& blocks) {
    std::vector<std::unique_ptr<Leaf>>& leaves = leaves_.local();
    for (std::size_t b = 0; b < blocks.origins.size(); ++b) {
        const glm::ivec3 o = blocks.origins[b];
        auto leaf = std::make_unique<Leaf>(openvdb::PartialCreate(), openvdb::Coord(o.x, o.y, o.z));
        leaf->buffer().allocate();
        BlockMask active;
        if (!trimToBand(blocks.distances.data() + b * blockVoxels, widths_, leaf->buffer().data(), active)) continue;
        Leaf::NodeMaskType mask;
        for (openvdb::Index word = 0; word < blockSide; ++word) mask.getWord<std::uint64_t>(word) = active[word];
        leaf->setValueMask(mask);
        if (wantTriangles_ && !mask.isOff())
            triangleLeaves_.local().push_back(triangleLeaf(blocks.triangles.data() + b * blockVoxels, *leaf));
        leaves.push_back(std::move(leaf));
    }
}

openvdb::FloatGrid::Ptr Assembler::distances() {
    const float exterior = widths_.exterior * widths_.voxelSize, interior = -widths_.interior * widths_.voxelSize;
    auto grid = openvdb::FloatGrid::create(exterior);
    move(leaves_, grid->tree());
    // leaves carry their signs already: only tiles between them are flooded. Leaves that turn out to hold one far
    // value become tiles too.
    openvdb::tools::signedFloodFillWithValues(grid->tree(), exterior, interior, true, 1, 1);
    openvdb::tools::prune(grid->tree());
    grid->setName("distance");
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    return grid;
}

openvdb::Int32Grid::Ptr Assembler::triangles() {
    if (!wantTriangles_) return nullptr;
    auto grid = openvdb::Int32Grid::create(-1);
    move(triangleLeaves_, grid->tree());
    grid->setName("triangle");
    return grid;
}

std::size_t countConflicts(const openvdb::FloatGrid& grid) {
    return ConflictCounter(grid).count();
}

}  // namespace bilayer
