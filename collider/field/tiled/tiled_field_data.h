// SPDX-License-Identifier: Apache-2.0
// The data of a TiledField: the frame of the whole field, and its tiles.
// Tested by tests/tools/tiled_field.cpp through TiledField.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <vector>

#include <bilayer/collider/field.h>
#include <bilayer/sdf/grids.h>
#include "collider/field/tiled/tile_cache.h"
#include "sdf/tiles/tile_manifest.h"

namespace bilayer::detail {

/// A tile's part of the directory, its own box, and its share of the surface blocks.
struct PlacedTile {
    glm::ivec3 first, blocks;         ///< as LayoutTile: the tile's blocks and, as far as there are any, those below
    glm::dvec3 lower, upper;          ///< its own box within that of the field, from the field's first voxel [voxels]
    glm::dvec3 shift;                 ///< of `first` from the field's first voxel [voxels]
    std::size_t surface, surfaceEnd;  ///< range in the list of surface blocks

    bool hasSurface() const { return surface < surfaceEnd; }
};

class TiledFieldData {
  public:
    TiledFieldData(const std::filesystem::path& folder, std::size_t budget, Storage storage);

    const FieldFrame& frame() const { return frame_; }
    std::size_t memoryBytes() const;
    const TileCache& tiles() const { return *cache_; }
    std::size_t tileCount() const { return manifest_.tiles.size(); }
    const glm::ivec3& counts() const { return manifest_.counts; }
    std::size_t tileAt(const glm::ivec3& place) const { return manifest_.at(place); }
    const PlacedTile& placed(std::size_t tile) const { return placed_[tile]; }
    /// Returns the place of the tile that holds a block of the field's box.
    glm::ivec3 placeOf(const glm::ivec3& block) const;

    /// Returns the tile that samples a point; nothing outside the box of the field.
    std::optional<std::size_t> tileOf(const glm::vec3& point) const;
    /// Samples a point with its tile, or outside the box.
    Sample sample(const glm::vec3& point, std::optional<std::size_t> tile) const;
    /// The same with a tile that the caller holds.
    Sample sampleIn(const FieldData& data, std::size_t tile, const glm::vec3& point) const;
    std::shared_ptr<const FieldData> hold(std::size_t tile) const { return cache_->get(tile); }

  private:
    void readSurface();
    void readFrame();
    void placeTiles();
    void requireSizes() const;
    std::size_t bytesOf(std::size_t tile) const;
    std::shared_ptr<const FieldData> read(std::size_t tile) const;
    std::vector<SurfaceBlock> surfaceAround(const PlacedTile& tile) const;

    TileManifest manifest_;
    Storage storage_;
    std::shared_ptr<const Grids> pattern_;    // without voxels: properties that all tiles have
    FieldFrame frame_;                        // of the whole field; it has no directory, which would be too large
    glm::ivec3 first_{0};                     // voxel of the box of all stored blocks
    glm::dvec3 fixedOffset_{0};               // of a point's place, as FieldData::Lanes has it [voxels]
    std::array<std::vector<int>, 3> starts_;  // of tiles along each axis, in blocks from `first_`
    std::vector<SurfaceBlock> surface_;       // of all tiles, one after the other
    std::vector<PlacedTile> placed_;
    std::unique_ptr<TileCache> cache_;
};

}  // namespace bilayer::detail
