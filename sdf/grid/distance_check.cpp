// SPDX-License-Identifier: Apache-2.0
#include "sdf/grid/distance_check.h"

#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>
#include <openvdb/tree/LeafManager.h>

#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>

#include <bilayer/sdf/grids.h>
#include "sdf/base/openvdb.h"
#include "sdf/base/quoted_text.h"
#include "sdf/io/vdb/vdb_archive.h"

namespace bilayer::detail {
namespace {

/// Limit of voxel coordinates: sums of a few coordinates still fit in an int.
constexpr std::int32_t maxVoxelCoordinate = 1 << 30;

/// Checks all distances of a grid.
class DistanceCheck {
  public:
    DistanceCheck(const openvdb::FloatGrid& grid, float interiorWidth)
        : grid_(grid),
          exterior_(grid.background()),
          interior_(interiorWidth),
          isOurs_(grid_[metadata::interiorWidth] || grid_[metadata::version]),
          isBand_(isOurs_ && grid_[metadata::errorBound]) {}

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
    [[noreturn]] void refuse(const std::string& why) const {
        throw std::invalid_argument(fmt::format("grid {} {}", quotedWord(grid_.getName()), why));
    }

    [[noreturn]] void refuseInterior(const char* voxel, float distance, const char* range) const {
        refuse(fmt::format("has {} voxel {:g} inside, but '{}' is {:g}: it must be {} that", voxel, -distance,
                           metadata::interiorWidth, interior_, range));
    }

    void check(float distance, bool active) const {
        if (!std::isfinite(distance)) refuse("holds a distance that is no finite number");
        if (active && isBand_ && distance > (1 + halfRounding) * exterior_)
            refuse(fmt::format("has an active voxel {:g} outside, but its background is {:g}: it must be at least that",
                               distance, exterior_));
        if (!isOurs_ || distance >= 0) return;
        const bool deeper = -distance > (1 + halfRounding) * interior_;
        if (!active && (deeper || -distance < (1 - halfRounding) * interior_))
            refuseInterior("an inactive", distance, "equal to");
        if (active && isBand_ && deeper) refuseInterior("an active", distance, "at least");
    }

    void checkTiles() const {
        auto tile = grid_.tree().cbeginValueAll();
        tile.setMaxDepth(openvdb::FloatTree::ValueAllCIter::LEAF_DEPTH - 1);
        for (; tile; ++tile) {
            if (tile.isValueOn())
                refuse(
                    fmt::format("has an active tile of {:g}, but a band is active voxel by voxel: call "
                                "tree().voxelizeActiveTiles(), or bilayer.LevelSet.from_numpy() with its values",
                                *tile));
            check(*tile, false);
        }
    }

    void checkPlaces() const {
        const openvdb::CoordBBox box = grid_.evalActiveVoxelBoundingBox();
        for (int axis = 0; axis < 3; ++axis)
            if (box.min()[axis] < -maxVoxelCoordinate || box.max()[axis] > maxVoxelCoordinate)
                refuse("has voxels farther than 2^30 voxels from its origin");
    }

    const openvdb::FloatGrid& grid_;
    float exterior_, interior_;  // the widths of the band [m]
    bool isOurs_;                // inactive voxels inside hold the width; without an entry, it is that outside
    bool isBand_;                // as build() made it, unlike an extended field: active voxels are within the band
};

}  // namespace

void requireValidDistances(const openvdb::FloatGrid& grid, float interiorWidth) {
    DistanceCheck(grid, interiorWidth).run();
}

}  // namespace bilayer::detail
