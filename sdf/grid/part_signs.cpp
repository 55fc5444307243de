// SPDX-License-Identifier: Apache-2.0
#include "sdf/grid/part_signs.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>
#include <openvdb/tools/Prune.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "sdf/base/openvdb.h"
#include "sdf/base/progress.h"
#include "sdf/sign/column_crossings.h"
#include "sdf/sign/winding_leaves.h"

namespace bilayer::detail {
namespace {

// Returns whether a leaf has no voxel in the band, and all of its voxels lie on one side.
bool isPlain(const BandLeaf& leaf) {
    if (!leaf.getValueMask().isOff()) return false;
    const float* values = leaf.buffer().data();
    return std::all_of(values, values + blockVoxels,
                       [&](float value) { return std::signbit(value) == std::signbit(values[0]); });
}

}  // namespace

void signPartByWinding(openvdb::FloatGrid& grid, const Mesh& mesh, const BandWidths& widths, const FieldPart& part,
                       bool dropPlain, Progress& progress) {
    std::vector<BandLeaf*> leaves = leavesOf(grid);
    const ColumnCrossings columns(leaves, mesh, double(widths.voxelSize), false, &progress, part.own.first.z);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, columns.tiles()), [&](const auto& range) {
        ColumnCrossings::OfTile crossings;
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
            std::optional<ColumnNumbers> numbers;
            columns.forEachLeaf(i, crossings, [&](BandLeaf& leaf, auto found, std::uint64_t) {
                progress.poll();
                if (!numbers) numbers.emplace(*part.signs.below, leaf.origin());
                const std::uint64_t crossed = numbers->enter(leaf, found);
                signClosed(leaf, *numbers, crossed, widths);
            });
        }
    });
    const float exterior = widths.exterior * widths.voxelSize, interior = widths.interior * widths.voxelSize;
    const auto tree = std::make_shared<openvdb::FloatTree>(exterior);
    openvdb::tree::ValueAccessor<openvdb::FloatTree> access(*tree);
    leaves.clear();
    grid.tree().stealNodes(leaves);
    for (BandLeaf* leaf : leaves)
        if (dropPlain && isPlain(*leaf))
            delete leaf;
        else
            access.addLeaf(leaf);
    floodPart(*tree, part, exterior, -interior);
    openvdb::tools::pruneTiles(*tree);
    grid.setTree(tree);
}

ComparedSigns comparePart(openvdb::FloatGrid& grid, const Mesh& mesh, const FieldPart& part, float limit,
                          Progress& progress) {
    const bool correct = part.signs.check == NormalsCheck::correct;
    ComparedLeaves some{{}, grid.voxelSize()[0], *part.signs.below, part.own.first.z};
    ComparedSigns compared;
    for (BandLeaf* leaf : leavesOf(grid)) {
        const openvdb::Coord& o = leaf->origin();
        const bool isOwn = part.own.contains({o.x(), o.y(), o.z()});
        compared.leaves += isOwn && !isPlain(*leaf);
        if (isOwn || correct) some.leaves.push_back(leaf);
    }
    if (!correct) compared.everyFifth = compareSigns(some, mesh, limit, true, false, &progress);
    compared.all = compareSigns(some, mesh, limit, false, correct, &progress);
    return compared;
}

}  // namespace bilayer::detail
