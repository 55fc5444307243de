// SPDX-License-Identifier: Apache-2.0
// The signs of one tile by flood, from its unsigned distances and the borders of the tiles around it.
//
// A flood may pass through all tiles. Each tile grows it within its own leaves, from the sides of its regions and from
// the arrivals at the borders of its neighbours. When no tile improves its arrivals any more, every voxel has the side
// of a flood through the whole field: the side that reaches it in the fewest steps.
// Tested by tests/sdf/tile_flood_signs.cpp.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <unordered_map>
#include <vector>

#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/options.h>
#include "sdf/base/openvdb.h"
#include "sdf/bvh/winding_number.h"
#include "sdf/grid/field_part.h"
#include "sdf/sign/flood_growth.h"
#include "sdf/tiles/flood_border.h"
#include "sdf/tiles/flood_regions.h"
#include "sdf/tiles/tile_build.h"
#include "sdf/tiles/tiling.h"

namespace bilayer::detail {

/// What a tile has read of a neighbour.
struct FloodNeighbour {
    FloodBorder border;
    RegionSides sides;
    std::vector<BorderArrival> byDistance{}, byTriangles{};  ///< of both growths
};

class FloodTile {
  public:
    /// @param grids    of buildTile(), with unsigned distances and at least one leaf; changed by signedTile()
    /// @param options  with Sign::flood; must outlive this, as the tiling
    FloodTile(std::shared_ptr<Grids> grids, const Tiling& tiling, std::size_t tile, const BuildOptions& options);

    const FloodBorder& border() const { return regions_.border(); }

    /// Gives the regions their sides. Call this before what follows, once.
    void setSides(const RegionSides& sides);

    /// Adds each of the tiles around this one. Throws std::runtime_error if it lacks a block of its border.
    void add(const FloodNeighbour& neighbour);

    /// Grows by distances, then by triangles near the tile. Each returns when the flood reaches the tile's border.
    std::vector<BorderArrival> growByDistance();
    std::vector<BorderArrival> growByTriangles(const WindingNumber& triangles);

    /// Returns the tile with its signs. Call it once, after both growths.
    BuiltTile signedTile();

  private:
    using Distances = std::array<float, blockVoxels>;

    void need(const BlockBox& blocks);
    void addLeaf(const FloodNeighbour& neighbour, const BorderLeaf& leaf, std::uint32_t& number);
    void addArrivals(const std::vector<BorderArrival>& from, std::vector<FloodArrival>& to) const;
    void findNeighbours();
    std::uint32_t numberAt(const glm::ivec3& block);
    std::vector<BorderArrival> arrivals() const;
    openvdb::FloatTree::Ptr signedTree();
    FloodGrowth growth();

    std::shared_ptr<Grids> grids_;
    openvdb::FloatGrid::Ptr distance_;
    const BuildOptions& options_;
    FieldPart part_;
    BlockBox filled_;  // the tile's blocks, and the next layer above them
    std::vector<BandLeaf*> bandLeaves_;
    FloodRegions regions_;
    RegionSides sides_;
    std::vector<FloodLeaf> leaves_;                             // those of the tile, then those of neighbours
    std::deque<Distances> distances_;                           // of neighbours
    std::unordered_map<openvdb::Coord, std::uint32_t> beyond_;  // blocks of neighbours: a leaf, or a side of space
    std::vector<FloodArrival> byDistance_, byTriangles_;        // at neighbours
};

}  // namespace bilayer::detail
