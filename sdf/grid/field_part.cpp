// SPDX-License-Identifier: Apache-2.0
#include "sdf/grid/field_part.h"

#include <openvdb/tools/Prune.h>
#include <openvdb/tree/LeafManager.h>

#include <cmath>

#include "sdf/base/openvdb.h"

namespace bilayer::detail {
namespace {

using Leaf = openvdb::FloatTree::LeafNodeType;
using Accessor = openvdb::tree::ValueAccessor<const openvdb::FloatTree>;
constexpr int leafLevel = 1;  // of tiles as large as a leaf

BlockBox filledWithin(const FieldPart& part) {
    return part.filled().within(part.lattice);
}

template <class Visit>
void forEachBlock(const BlockBox& box, Visit visit) {
    for (int x = box.first.x; x < box.end.x; x += blockSide)
        for (int y = box.first.y; y < box.end.y; y += blockSide)
            for (int z = box.first.z; z < box.end.z; z += blockSide) visit(openvdb::Coord(x, y, z));
}

// Sets the tiles of all blocks of a box that are no leaves and are inside.
class BoxFlood {
  public:
    BoxFlood(openvdb::FloatTree& tree, float interior) : tree_(tree), interior_(interior) {}

    // The sign of a block is that of the block before it along z, else along y, else along x. It is the sign of the
    // first leaf for all blocks before that leaf.
    void run(const BlockBox& box, bool insideAtFirst) {
        bool x = insideAtFirst;
        for (glm::ivec3 at = box.first; at.x < box.end.x; at.x += blockSide) {
            at.y = box.first.y;
            bool y = x;
            for (; at.y < box.end.y; at.y += blockSide) {
                at.z = box.first.z;
                bool z = y;
                for (; at.z < box.end.z; at.z += blockSide) {
                    z = fill(coordOf(at), z);
                    if (at.z == box.first.z) y = z;
                }
                if (at.y == box.first.y) x = y;
            }
        }
    }

  private:
    // Returns whether the last voxel of a block is inside.
    bool fill(const openvdb::Coord& block, bool inside) {
        if (const Leaf* leaf = tree_.probeConstLeaf(block)) return std::signbit(leaf->getLastValue());
        if (inside) tree_.addTile(leafLevel, block, interior_, false);
        return inside;
    }

    openvdb::tree::ValueAccessor<openvdb::FloatTree> tree_;
    float interior_;
};

// Adds the sides of the voxels on a face of a block.
void addFace(const Accessor& values, const openvdb::Coord& block, int face, VoxelSides& sides) {
    const int axis = face % 3, layer = face < 3 ? 0 : blockSide - 1;
    const Leaf* leaf = values.probeConstLeaf(block);
    const auto add = [&](float value) { (std::signbit(value) ? sides.inside : sides.outside) = true; };
    if (!leaf) return add(values.getValue(block));
    for (int i = 0; i < blockSide; ++i)
        for (int j = 0; j < blockSide; ++j) {
            openvdb::Coord at;
            at[axis] = layer;
            at[(axis + 1) % 3] = i;
            at[(axis + 2) % 3] = j;
            add(leaf->getValue(block + at));
        }
}

// Visits the blocks of a box that are not in its lower part `own`, some of them twice.
template <class Visit>
void forEachBlockAbove(const BlockBox& box, const BlockBox& own, Visit visit) {
    for (int axis = 0; axis < 3; ++axis) {
        BlockBox above = box;
        above.first[axis] = own.end[axis];
        forEachBlock(above, visit);
    }
}

// Returns a copy of a leaf above a box. Only its voxels next to the box keep their values.
Leaf* firstVoxelsOf(const Leaf& leaf, const BlockBox& box, float exterior) {
    auto* first = new Leaf(leaf);
    for (openvdb::Index i = 0; i < Leaf::SIZE; ++i) {
        const openvdb::Coord at = Leaf::offsetToLocalCoord(i);
        for (int axis = 0; axis < 3; ++axis)
            if (leaf.origin()[axis] >= box.end[axis] && at[axis] > 0) first->setValueOff(i, exterior);
    }
    return first;
}

}  // namespace

BlockBox FieldPart::filled() const {
    BlockBox box = own;
    for (int axis = 0; axis < 3; ++axis)
        if (box.end[axis] < unbounded) box.end[axis] += blockSide;
    return box;
}

void floodPart(openvdb::FloatTree& tree, const FieldPart& part, float exterior, float interior) {
    tree.root().setBackground(exterior, /*updateChildNodes=*/false);
    const BlockBox box = filledWithin(part);
    // the first leaf in the order of the flood, which is that of coordinates and not that of the tree
    const Leaf* first = nullptr;
    for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf)
        if (!first || leaf->origin() < first->origin()) first = &*leaf;
    if (first) BoxFlood(tree, interior).run(box, std::signbit(first->getFirstValue()));
}

FaceSides faceSides(const openvdb::FloatTree& tree, const FieldPart& part) {
    const Accessor values(tree);
    FaceSides all;
    const BlockBox box = part.own.within(part.lattice);
    for (int face = 0; face < 6; ++face) {
        BlockBox layer = box;
        const int axis = face % 3;
        if (face < 3)
            layer.end[axis] = layer.first[axis] + blockSide;
        else
            layer.first[axis] = layer.end[axis] - blockSide;
        forEachBlock(layer, [&](const openvdb::Coord& block) { addFace(values, block, face, all[std::size_t(face)]); });
    }
    return all;
}

openvdb::FloatTree::Ptr borderOf(const openvdb::FloatTree& tree, const FieldPart& part) {
    const BlockBox box = filledWithin(part), own = part.own.within(part.lattice);
    const float exterior = tree.background();
    const Accessor values(tree);
    const auto border = std::make_shared<openvdb::FloatTree>(exterior);
    openvdb::tree::ValueAccessor<openvdb::FloatTree> blocks(*border);
    forEachBlockAbove(box, own, [&](const openvdb::Coord& block) {
        const Leaf* leaf = values.probeConstLeaf(block);
        if (leaf)
            blocks.addLeaf(firstVoxelsOf(*leaf, own, exterior));
        else if (values.getValue(block) != exterior)
            blocks.addTile(leafLevel, block, values.getValue(block), false);
    });
    return border;
}

void trimToPart(openvdb::FloatTree& tree, const FieldPart& part) {
    const BlockBox box = filledWithin(part), own = part.own.within(part.lattice);
    const float exterior = tree.background();
    openvdb::tree::ValueAccessor<openvdb::FloatTree> blocks(tree);
    forEachBlockAbove(box, own, [&](const openvdb::Coord& block) {
        if (blocks.probeConstLeaf(block) || blocks.getValue(block) != exterior)
            blocks.addTile(leafLevel, block, exterior, false);
    });
    openvdb::tools::pruneTiles(tree);
}

void renumber(openvdb::Int32Tree& tree, const FieldPart& part) {
    for (auto leaf = tree.beginLeaf(); leaf; ++leaf)
        for (auto voxel = leaf->beginValueOn(); voxel; ++voxel)
            if (*voxel >= 0) voxel.setValue(std::int32_t(part.triangles[std::size_t(*voxel)]));
}

void keepActive(openvdb::Int32Tree& triangles, const openvdb::FloatTree& distances) {
    triangles.topologyIntersection(distances);
    openvdb::tree::LeafManager<openvdb::Int32Tree> leaves(triangles);
    leaves.foreach ([&](auto& leaf, std::size_t) {
        for (auto voxel = leaf.beginValueOff(); voxel; ++voxel) voxel.setValue(triangles.background());
    });
}

}  // namespace bilayer::detail
