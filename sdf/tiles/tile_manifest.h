// SPDX-License-Identifier: Apache-2.0
// What the manifest of a field in tiles states of them.
// Tested by tests/tools/tiled_field.cpp through TiledField.
#pragma once

#include <filesystem>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// A file of a tile, and the hash that its bytes must have.
struct HashedFile {
    std::filesystem::path path;
    std::string hash;

    /// Throws std::runtime_error that names the file if it is missing or has other bytes.
    void requireIntact() const;
};

/// A tile as the manifest describes it.
struct TileRecord {
    BlockBox box;
    HashedFile field;      ///< the .vdb file; without a path if the tile has no leaf
    HashedFile cells;      ///< the surface blocks; without a path if the tile has no leaf
    bool inside = false;   ///< of a tile without leaves
    BlockBox band{};       ///< the smallest box of its voxels in the band; its sides are whole voxels
    bool hasBand = false;  ///< the tile has voxels in the band
};

/// The tiles of a field, numbered with z fastest.
struct TileManifest {
    glm::ivec3 counts{0};
    glm::dvec3 origin{0};  ///< LevelSet::origin() [m]
    std::vector<TileRecord> tiles;

    std::size_t at(const glm::ivec3& tile) const {
        return (std::size_t(tile.x) * std::size_t(counts.y) + std::size_t(tile.y)) * std::size_t(counts.z) +
               std::size_t(tile.z);
    }
};

/// Returns the text of a manifest with the hash of the text, in which the digits of the hash are zeros, in its last
/// entry, "hash". A text without this entry is returned as it is.
std::string withHash(std::string text);

/// Reads manifest.json of a folder. Its hash must be right; one that was made by hand needs none. Throws
/// std::runtime_error that names the file if it is missing or damaged.
TileManifest readTileManifest(const std::filesystem::path& folder);

}  // namespace bilayer::detail
