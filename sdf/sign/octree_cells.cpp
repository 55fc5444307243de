// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/octree_cells.h"

#include <oneapi/tbb/parallel_sort.h>
#include <openvdb/tools/Prune.h>

#include <algorithm>
#include <array>

#include "sdf/base/morton.h"
#include "sdf/base/openvdb.h"
#include "sdf/base/progress.h"
#include "sdf/leaf/band.h"

namespace bilayer::detail {
namespace {

/// Side of the largest node of an OpenVDB tree [voxels]. Cells aligned to it become the fewest tiles.
constexpr std::int64_t nodeVoxels = 4096;

using Offset = std::array<std::uint32_t, 3>;

Offset offset(const openvdb::Coord& voxel, const openvdb::Coord& base) {
    return {std::uint32_t(voxel.x()) - std::uint32_t(base.x()), std::uint32_t(voxel.y()) - std::uint32_t(base.y()),
            std::uint32_t(voxel.z()) - std::uint32_t(base.z())};
}

openvdb::Coord child(const openvdb::Coord& origin, std::int64_t side, int octant) {
    const auto at = [&](int from, int bit) { return std::int32_t(from + ((octant >> bit) & 1) * side); };
    return {at(origin.x(), 2), at(origin.y(), 1), at(origin.z(), 0)};
}

}  // namespace

OctreeCells::OctreeCells(std::vector<BandLeaf*> leaves, const openvdb::CoordBBox& space, Progress* progress) {
    openvdb::CoordBBox box = space;
    for (const BandLeaf* leaf : leaves) box.expand(leaf->origin());
    for (int axis = 0; axis < 3; ++axis) base_[axis] = std::int32_t(box.min()[axis] & ~(nodeVoxels - 1));
    const auto reaches = [&](int axis) { return box.max()[axis] - std::int64_t(base_[axis]) < side_; };
    for (side_ = nodeVoxels; !(reaches(0) && reaches(1) && reaches(2));) side_ *= 2;
    const auto less = [this](const BandLeaf* a, const BandLeaf* b) {
        return beforeInMortonOrder(offset(a->origin(), base_), offset(b->origin(), base_));
    };
    tbb::parallel_sort(leaves.begin(), leaves.end(), polled(less, progress));
    cut(leaves, base_, side_, progress);
    bricks_.push_back(cells_.size());
}

void OctreeCells::cut(std::span<BandLeaf* const> leaves, const openvdb::Coord& origin, std::int64_t side,
                      Progress* progress) {
    if (side == brickSide) poll(progress);
    if (side == brickSide || (side > brickSide && leaves.empty())) bricks_.push_back(cells_.size());
    if (leaves.empty() || side == BandLeaf::DIM) {
        cells_.push_back({origin, std::int32_t(side), leaves.empty() ? nullptr : leaves.front()});
        return;
    }
    // The leaves are sorted, so each octant has a contiguous run of them.
    for (int octant = 0; octant < 8; ++octant) {
        const openvdb::Coord corner = child(origin, side / 2, octant);
        const Offset from = offset(corner, base_);
        const auto end = std::partition_point(leaves.begin(), leaves.end(), [&](const BandLeaf* leaf) {
            const Offset o = offset(leaf->origin(), base_);
            return std::uint32_t(o[0] - from[0]) < side / 2 && std::uint32_t(o[1] - from[1]) < side / 2 &&
                   std::uint32_t(o[2] - from[2]) < side / 2;
        });
        const std::size_t count = std::size_t(end - leaves.begin());
        cut(leaves.first(count), corner, side / 2, progress);
        leaves = leaves.subspan(count);
    }
}

std::size_t OctreeCells::find(const openvdb::Coord& voxel) const {
    for (int axis = 0; axis < 3; ++axis) {
        const std::int64_t from = std::int64_t(voxel[axis]) - base_[axis];
        if (from < 0 || from >= side_) return none;
    }
    const auto next =
        std::upper_bound(cells_.begin(), cells_.end(), voxel, [this](const openvdb::Coord& at, const OctreeCell& cell) {
            return beforeInMortonOrder(offset(at, base_), offset(cell.origin, base_));
        });
    return std::size_t(next - cells_.begin()) - 1;
}

BlockMask across(const BlockMask& mask, int axis, int side) {
    BlockMask result{};
    if (axis == 0) {
        if (side == 0)
            result[7] = mask[0];
        else
            result[0] = mask[7];
        return result;
    }
    const int step = axis == 1 ? 56 : 7;
    const std::uint64_t lower = axis == 1 ? 0xff : lowestZ;
    for (std::size_t x = 0; x < blockSide; ++x)
        result[x] = side == 0 ? (mask[x] & lower) << step : (mask[x] >> step) & lower;
    return result;
}

BlockMask farther(const float* distances, float limit) {
    BlockMask mask{};
    for (std::size_t x = 0; x < blockSide; ++x)
        for (unsigned i = 0; i < 64; ++i) mask[x] |= std::uint64_t(distances[x * 64 + i] > limit) << i;
    return mask;
}

void signLeaf(BandLeaf& leaf, const BlockMask& inside, const BandWidths& widths) {
    const float exterior = widths.exterior * widths.voxelSize, interior = widths.interior * widths.voxelSize;
    const float exteriorEdge = edgeOfBand(widths.exterior, widths.voxelSize),
                interiorEdge = edgeOfBand(widths.interior, widths.voxelSize);
    float* values = leaf.buffer().data();
    BandLeaf::NodeMaskType active;
    for (std::size_t x = 0; x < blockSide; ++x) {
        std::uint64_t band = 0;
        for (unsigned i = 0; i < 64; ++i) {
            float& value = values[x * 64 + i];
            const bool in = (inside[x] >> i) & 1;
            const bool isInBand = value < (in ? interiorEdge : exteriorEdge);
            band |= std::uint64_t(isInBand) << i;
            if (!isInBand) value = in ? interior : exterior;
            if (in) value = -value;
        }
        active.getWord<std::uint64_t>(openvdb::Index(x)) = band;
    }
    leaf.setValueMask(active);
}

std::vector<BandLeaf*> leavesOf(openvdb::FloatGrid& grid) {
    std::vector<BandLeaf*> leaves;
    leaves.reserve(grid.tree().leafCount());
    grid.tree().getNodes(leaves);
    return leaves;
}

void assemble(openvdb::FloatGrid& grid, const std::vector<openvdb::CoordBBox>& inside, const BandWidths& widths,
              Progress* progress) {
    assemble(grid, inside, widths.exterior * widths.voxelSize, -widths.interior * widths.voxelSize, progress);
}

void assemble(openvdb::FloatGrid& grid, const std::vector<openvdb::CoordBBox>& inside, float exterior, float interior,
              Progress* progress) {
    const auto tree = std::make_shared<openvdb::FloatTree>(exterior);
    openvdb::tree::ValueAccessor<openvdb::FloatTree> access(*tree);
    std::vector<BandLeaf*> leaves;
    grid.tree().stealNodes(leaves);
    for (BandLeaf* leaf : leaves) access.addLeaf(leaf);
    for (const std::size_t i : Polled(inside.size(), progress)) tree->sparseFill(inside[i], interior, false);
    poll(progress);
    openvdb::tools::prune(*tree);
    grid.setTree(tree);
    grid.setGridClass(openvdb::GRID_LEVEL_SET);
}

}  // namespace bilayer::detail
