// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/sign_repair.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_reduce.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>

#include "sdf/base/openvdb.h"
#include "sdf/base/progress.h"
#include "sdf/sign/column_crossings.h"

namespace bilayer::detail {
namespace {

using Leaf = openvdb::FloatTree::LeafNodeType;
constexpr int side = int(Leaf::DIM), columns = side * side;

/// Voxels closer to the surface than this may have either sign [voxels].
constexpr float onSurface = 1e-3f;

/// Up to this many leaves, all columns are compared at once, in milliseconds.
constexpr openvdb::Index32 fewLeaves = 1024;

/// The winding numbers along the columns of a tile, from bottom to top.
class Rise {
  public:
    Rise(float tolerance, float limit) : tolerance_(tolerance), limit_(limit) {}

    /// Compares a leaf, corrects it, and advances to its top.
    /// @param crossings  those between the last leaf's top and this one's
    /// @param asked      the columns to compare
    void repair(Leaf& leaf, std::span<const ColumnCrossing> crossings, std::uint64_t asked, SignRepair& sum) {
        for (const ColumnCrossing& crossing : crossings) {
            const std::int32_t k = std::max(crossing.above - leaf.origin().z(), 0);
            changes_[std::size_t(crossing.column * side + k)] += crossing.sign;
            crossed_ |= std::uint64_t(1) << crossing.column;
        }
        const float* values = leaf.buffer().data();
        for (std::uint64_t rest = asked; rest != 0; rest &= rest - 1) {
            const int column = std::countr_zero(rest);
            const bool crossed = crossed_ >> column & 1;
            const bool isInside = inside_ >> column & 1;
            if (crossed || !allAre(isInside, values + column * side)) repairColumn(leaf, column, crossed, sum);
        }
        crossed_ = 0;
    }

  private:
    static bool allAre(bool inside, const float* values) {
        std::uint32_t differ = 0;
        for (int k = 0; k < side; ++k) differ |= std::bit_cast<std::uint32_t>(values[k]) ^ (inside ? 0x80000000u : 0u);
        return differ >> 31 == 0;
    }

    void repairColumn(Leaf& leaf, int column, bool crossed, SignRepair& sum) {
        std::int32_t& winding = winding_[std::size_t(column)];
        for (int k = 0; k < side; ++k) {
            const int voxel = column * side + k;
            if (crossed) winding += std::exchange(changes_[std::size_t(voxel)], 0);
            float& value = leaf.buffer().data()[voxel];
            if (std::signbit(value) == (winding > 0) || std::abs(value) <= tolerance_) continue;
            if (!leaf.isValueOn(openvdb::Index(voxel))) continue;
            const bool mayFlip = winding >= 0 && std::abs(value) < limit_;
            if (mayFlip) value = -value;
            ++(mayFlip ? sum.repaired : sum.refused);
        }
        const std::uint64_t bit = std::uint64_t(1) << column;
        inside_ = winding > 0 ? inside_ | bit : inside_ & ~bit;
    }

    float tolerance_, limit_;
    std::array<std::int32_t, columns> winding_{};
    std::array<std::int32_t, columns * side> changes_{};  ///< changes of the winding number at the voxels of one leaf
    std::uint64_t inside_ = 0, crossed_ = 0;              ///< one bit per column
};

/// @param fifths  whether to compare only one column in five
SignRepair repairColumns(openvdb::FloatGrid& distance, const Mesh& mesh, float limit, bool fifths, Progress* progress) {
    const double voxelSize = distance.voxelSize()[0];
    const ColumnCrossings columns(leavesOf(distance), mesh, voxelSize, fifths, progress);
    return tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, columns.tiles()), SignRepair(),
        [&](const auto& range, SignRepair sum) {
            ColumnCrossings::OfTile crossings;
            for (std::size_t i = range.begin(); i < range.end(); ++i) {
                poll(progress);
                Rise rise(onSurface * float(voxelSize), limit);
                columns.forEachLeaf(i, crossings, [&](Leaf& leaf, auto found, std::uint64_t asked) {
                    rise.repair(leaf, found, asked, sum);
                });
            }
            return sum;
        },
        [](const SignRepair& a, const SignRepair& b) {
            return SignRepair{a.repaired + b.repaired, a.refused + b.refused};
        });
}

}  // namespace

SignRepair repairSigns(openvdb::FloatGrid& distance, const Mesh& mesh, float limit, Progress* progress) {
    SignRepair some;
    const bool fifths = distance.tree().leafCount() > fewLeaves;
    if (fifths) {
        some = repairColumns(distance, mesh, limit, true, progress);
        if (some.repaired + some.refused == 0) return some;
    }
    const SignRepair rest = repairColumns(distance, mesh, limit, false, progress);
    return {some.repaired + rest.repaired, rest.refused};
}

}  // namespace bilayer::detail
