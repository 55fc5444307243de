// SPDX-License-Identifier: Apache-2.0
#include "collider/field/tiled/tile_cache.h"

#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <utility>

namespace bilayer::detail {

TileCache::TileCache(std::size_t budget, std::vector<std::size_t> sizes, std::function<Tile(std::size_t)> read)
    : budget_(budget), sizes_(std::move(sizes)), read_(std::move(read)), slots_(sizes_.size()) {}

TileCache::Tile TileCache::get(std::size_t tile) {
    if (Tile found = find(tile)) return found;
    const std::lock_guard one(reading_);
    if (Tile found = find(tile)) return found;  // another thread has read it
    makeRoomFor(tile);
    // Reading waits for tasks. Isolated, it takes no other task meanwhile, which might wait for this lock.
    Tile data = tbb::this_task_arena::isolate([&] { return read_(tile); });
    keep(tile, data);
    return data;
}

std::size_t TileCache::memoryBytes() const {
    const std::lock_guard lock(access_);
    return kept_;
}

std::size_t TileCache::reads() const {
    const std::lock_guard lock(access_);
    return reads_;
}

TileCache::Tile TileCache::find(std::size_t tile) {
    const std::lock_guard lock(access_);
    Slot& slot = slots_[tile];
    slot.lastUse = ++uses_;
    return slot.tile;
}

void TileCache::makeRoomFor(std::size_t tile) {
    const std::lock_guard lock(access_);
    while (kept_ > 0 && kept_ + sizes_[tile] > budget_) {
        const auto oldest = std::min_element(slots_.begin(), slots_.end(), [](const Slot& a, const Slot& b) {
            return bool(a.tile) != bool(b.tile) ? bool(a.tile) : a.lastUse < b.lastUse;
        });
        oldest->tile.reset();
        kept_ -= sizes_[std::size_t(oldest - slots_.begin())];
    }
}

void TileCache::keep(std::size_t tile, const Tile& data) {
    const std::lock_guard lock(access_);
    slots_[tile].tile = data;
    kept_ += sizes_[tile];
    ++reads_;
}

}  // namespace bilayer::detail
