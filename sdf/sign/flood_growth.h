// SPDX-License-Identifier: Apache-2.0
// Propagates the sides of a flood from the voxels where its ball fits to those nearer to the surface, in steps over all
// leaves. The leaves may be those of a whole field, or those of a tile with leaves of its neighbours around them.
// Tested by tests/sdf/flood.cpp through signByFlood().
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "sdf/base/openvdb.h"
#include "sdf/bvh/winding_number.h"
#include "sdf/leaf/band.h"

namespace bilayer::detail {

class Progress;

/// A voxel of a leaf near the surface, and the step in which a flood reaches it, counted from 1.
struct FloodArrival {
    std::uint32_t leaf;  ///< its number
    std::uint32_t step;
    std::uint16_t voxel;
    bool inside;
};

/// A leaf of unsigned distances, and the sides of its voxels as far as a flood has found them.
struct FloodLeaf {
    /// Entries of `around` for blocks that are no leaves.
    static constexpr std::uint32_t outsideSpace = std::numeric_limits<std::uint32_t>::max(),
                                   insideSpace = outsideSpace - 1;

    openvdb::Coord origin;
    const float* distances = nullptr;  ///< [m]
    BlockMask known{}, inside{};
    std::array<std::uint32_t, 27> around{};  ///< the leaves around this one, with z fastest; itself in the middle
    BlockMask watched{};                     ///< the voxels whose arrivals are recorded
    std::vector<FloodArrival> arrivals{};    ///< of the last growth
    BlockMask fresh{};                       ///< known since the last step
    bool isFresh = false;                    ///< any voxel is
    BlockMask outsideNext{}, insideNext{};
};

/// Returns the distance that voxels must have for a ball of diameter `gapVoxels` to fit: links between two such voxels
/// keep gapVoxels / 2 from the surface along their whole length [m].
float freeDistance(float gapVoxels, float voxelSize);

/// Returns the connected sets of the voxels of a leaf whose distance exceeds `free`.
std::vector<BlockMask> freeParts(const float* distances, float free);

/// Returns whether two masks have a voxel in common.
bool meet(const BlockMask& a, const BlockMask& b);

/// Grows known sides in a leaf by one voxel a step, over links to all 26 neighbours. Outside wins a tie.
class FloodGrowth {
  public:
    /// @param leaves      with known sides where the ball fits. The first `own` of them grow; the others, of
    ///                    neighbouring tiles, have no `around` and change by the arrivals that are given.
    /// @param background  the distance of space [m]
    FloodGrowth(std::vector<FloodLeaf>& leaves, std::size_t own, float background, float voxelSize, Progress* progress)
        : leaves_(leaves), own_(own), background_(background), voxelSize_(voxelSize), progress_(progress) {}

    /// Grows over links that no surface can cross, because the distances at both ends leave it no room.
    void growByDistance(std::vector<FloodArrival> given = {});

    /// Grows over links that no triangle meets.
    void growByTriangles(const WindingNumber& triangles, std::vector<FloodArrival> given = {});

    /// Voxels that neither side reached are enclosed and inside, unless they lie on the surface.
    void settle();

  private:
    struct Neighbour;

    template <class Passes>
    void grow(const Passes& passes, std::vector<FloodArrival> given);
    template <class Passes>
    void findNext(std::size_t leaf, bool first, const Passes& passes);
    bool mayGrow(const FloodLeaf& leaf, bool first) const;
    Neighbour neighbour(const FloodLeaf& leaf, const openvdb::Coord& local, bool first) const;
    bool step(std::uint32_t number);

    std::vector<FloodLeaf>& leaves_;
    std::size_t own_;
    float background_, voxelSize_;  // [m]
    Progress* progress_;
};

}  // namespace bilayer::detail
