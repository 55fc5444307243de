// SPDX-License-Identifier: Apache-2.0
// The tiles of a field that are in memory: the last ones used, within a budget.
// Tested by tests/tools/tiled_field.cpp through TiledField.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

#include "collider/field/samples/field_data.h"

namespace bilayer::detail {

class TileCache {
  public:
    using Tile = std::shared_ptr<const FieldData>;

    /// @param budget  max memory of kept tiles; a single tile is kept even if it is larger [bytes]
    /// @param sizes   memory of each tile [bytes]
    /// @param read    returns a tile; may throw
    TileCache(std::size_t budget, std::vector<std::size_t> sizes, std::function<Tile(std::size_t)> read);

    /// Returns a tile, which stays in memory as long as the caller holds it. Thread-safe: while one thread reads a
    /// tile, others get kept tiles. Throws what reading throws; a later call reads again.
    Tile get(std::size_t tile);

    std::size_t memoryBytes() const;  ///< of kept tiles [bytes]
    std::size_t reads() const;        ///< count of tiles that were read

  private:
    struct Slot {
        Tile tile;
        std::uint64_t lastUse = 0;
    };

    Tile find(std::size_t tile);
    void makeRoomFor(std::size_t tile);
    void keep(std::size_t tile, const Tile& data);

    std::size_t budget_;
    std::vector<std::size_t> sizes_;
    std::function<Tile(std::size_t)> read_;
    std::mutex reading_;         // held while a tile is read
    mutable std::mutex access_;  // to all below
    std::vector<Slot> slots_;
    std::size_t kept_ = 0, reads_ = 0;
    std::uint64_t uses_ = 0;
};

}  // namespace bilayer::detail
