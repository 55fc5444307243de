// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/sign_repair.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_reduce.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <span>

#include "sdf/base/openvdb.h"
#include "sdf/base/progress.h"
#include "sdf/sign/column_crossings.h"

namespace bilayer::detail {
namespace {

using Leaf = openvdb::FloatTree::LeafNodeType;
constexpr int leafSide = int(Leaf::DIM);

/// Voxels closer to the surface than this may have either sign [voxels].
constexpr float onSurface = 1e-3f;

/// Compares the signs of a tile's leaves with the winding numbers along its columns, from bottom to top.
class TileRepair {
  public:
    TileRepair(float tolerance, float limit, bool correct) : tolerance_(tolerance), limit_(limit), correct_(correct) {}

    /// Begins with winding numbers that are not zero, at the tile's first leaf.
    void begin(const ColumnSums& below, const openvdb::Coord& first) {
        if (!begun_) numbers_ = {below, first};
        begun_ = true;
    }

    /// Compares the next leaf, and corrects it.
    /// @param crossings  those between the last leaf's top and this one's
    /// @param asked      the columns to compare
    void repair(Leaf& leaf, std::span<const ColumnCrossing> crossings, std::uint64_t asked, SignRepair& sum) {
        const std::uint64_t crossed = numbers_.enter(leaf, crossings);
        for (std::uint64_t rest = asked; rest != 0; rest &= rest - 1) {
            const auto column = std::size_t(std::countr_zero(rest));
            const std::int32_t below = numbers_.below(column);
            const auto repairOne = [&](int k, std::int32_t winding) {
                repairVoxel(leaf, unsigned(column) * leafSide + unsigned(k), winding, sum);
            };
            if (crossed >> column & 1)
                numbers_.climb(column, repairOne);
            else if (!allAre(below > 0, leaf.buffer().data() + column * leafSide))
                for (int k = 0; k < leafSide; ++k) repairOne(k, below);
        }
    }

  private:
    static bool allAre(bool inside, const float* values) {
        std::uint32_t differ = 0;
        for (int k = 0; k < leafSide; ++k)
            differ |= std::bit_cast<std::uint32_t>(values[k]) ^ (inside ? 0x80000000u : 0u);
        return differ >> 31 == 0;
    }

    void repairVoxel(Leaf& leaf, unsigned voxel, std::int32_t winding, SignRepair& sum) const {
        float& value = leaf.buffer().data()[voxel];
        if (std::signbit(value) == (winding > 0) || std::abs(value) <= tolerance_) return;
        if (!leaf.isValueOn(openvdb::Index(voxel))) return;
        const bool mayFlip = winding >= 0 && std::abs(value) < limit_;
        if (mayFlip && correct_) value = -value;
        ++(mayFlip ? sum.repaired : sum.refused);
    }

    float tolerance_, limit_;
    bool correct_;
    bool begun_ = false;
    ColumnNumbers numbers_;
};

/// @param begin  called as begin(tile, leaf) before each leaf
template <class Begin>
SignRepair repairColumns(const ColumnCrossings& columns, const TileRepair& fresh, Progress* progress,
                         const Begin& begin) {
    return tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, columns.tiles()), SignRepair(),
        [&](const auto& range, SignRepair sum) {
            ColumnCrossings::OfTile crossings;
            for (std::size_t i = range.begin(); i < range.end(); ++i) {
                poll(progress);
                TileRepair tile = fresh;
                columns.forEachLeaf(i, crossings, [&](Leaf& leaf, auto found, std::uint64_t asked) {
                    begin(tile, leaf);
                    tile.repair(leaf, found, asked, sum);
                });
            }
            return sum;
        },
        [](SignRepair a, const SignRepair& b) { return a += b; });
}

/// @param everyFifthColumn  whether to compare only one column in five
SignRepair repairColumns(openvdb::FloatGrid& distance, const Mesh& mesh, float limit, bool everyFifthColumn,
                         Progress* progress) {
    const double voxelSize = distance.voxelSize()[0];
    const ColumnCrossings columns(leavesOf(distance), mesh, voxelSize, everyFifthColumn, progress);
    return repairColumns(columns, TileRepair(onSurface * float(voxelSize), limit, true), progress,
                         [](const TileRepair&, const Leaf&) {});
}

}  // namespace

SignRepair repairSigns(openvdb::FloatGrid& distance, const Mesh& mesh, float limit, Progress* progress) {
    SignRepair some;
    const bool everyFifthColumn = distance.tree().leafCount() > fewLeaves;
    if (everyFifthColumn) {
        some = repairColumns(distance, mesh, limit, true, progress);
        if (some.repaired + some.refused == 0) return some;
    }
    const SignRepair rest = repairColumns(distance, mesh, limit, false, progress);
    return {some.repaired + rest.repaired, rest.refused};
}

SignRepair compareSigns(const ComparedLeaves& compared, const Mesh& mesh, float limit, bool everyFifthColumn,
                        bool correct, Progress* progress) {
    const ColumnCrossings columns(compared.leaves, mesh, compared.voxelSize, everyFifthColumn, progress,
                                  compared.lowest);
    return repairColumns(columns, TileRepair(onSurface * float(compared.voxelSize), limit, correct), progress,
                         [&](TileRepair& tile, const Leaf& leaf) { tile.begin(compared.below, leaf.origin()); });
}

}  // namespace bilayer::detail
