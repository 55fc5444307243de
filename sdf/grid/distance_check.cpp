// SPDX-License-Identifier: Apache-2.0
#include "sdf/grid/distance_check.h"

#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>
#include <openvdb/tree/LeafManager.h>

#include <cmath>
#include <cstdint>
#include <stdexcept>

#include <bilayer/sdf/grids.h>
#include "sdf/base/openvdb.h"
#include "sdf/io/vdb_archive.h"

namespace bilayer::detail {
namespace {

/// Limit of voxel coordinates: sums of a few coordinates still fit in an int.
constexpr std::int32_t farthestVoxel = 1 << 30;

/// Checks all distances of a level set.
class DistanceCheck {
  public:
    explicit DistanceCheck(const LevelSet& levelSet)
        : grid_(*levelSet.grids().distance),
          interior_(grid_[metadata::interiorWidth] ? (1 - halfRounding) * levelSet.interiorWidth() : 0) {}

    void run() const {
        checkTiles();
        checkPlaces();
        const openvdb::tree::LeafManager<const openvdb::FloatTree> leaves(grid_.tree());
        tbb::parallel_for(leaves.leafRange(), [&](const auto& range) {
            for (auto leaf = range.begin(); leaf; ++leaf)
                for (auto voxel = leaf->cbeginValueAll(); voxel; ++voxel) check(*voxel, voxel.isValueOn());
        });
    }

  private:
    [[noreturn]] void refuse(const char* why) const {
        throw std::invalid_argument(fmt::format("grid '{}' {}", grid_.getName(), why));
    }

    void check(float distance, bool active) const {
        if (!std::isfinite(distance)) refuse("holds a distance that is no finite number");
        if (!active && distance < 0 && distance > -interior_)
            refuse("holds a distance outside its band that 'bilayer:interior_width' counts to it");
    }

    void checkTiles() const {
        auto tile = grid_.tree().cbeginValueAll();
        tile.setMaxDepth(openvdb::FloatTree::ValueAllCIter::LEAF_DEPTH - 1);
        for (; tile; ++tile) {
            if (tile.isValueOn()) refuse("has an active tile: a band is active voxel by voxel");
            check(*tile, false);
        }
    }

    void checkPlaces() const {
        const openvdb::CoordBBox box = grid_.evalActiveVoxelBoundingBox();
        for (int axis = 0; axis < 3; ++axis)
            if (box.min()[axis] < -farthestVoxel || box.max()[axis] > farthestVoxel)
                refuse("has voxels farther than 2^30 voxels from its origin");
    }

    const openvdb::FloatGrid& grid_;
    float interior_;  // minimum distance of inactive inside voxels from the surface [m]
};

}  // namespace

void requireValidDistances(const LevelSet& levelSet) {
    DistanceCheck(levelSet).run();
}

}  // namespace bilayer::detail
