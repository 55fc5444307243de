// Fields as NanoVDB grids: one piece of memory each, which code on a GPU reads as it is.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <utility>

#include <bilayer/sdf/level_set.h>

namespace bilayer {

/// An immutable NanoVDB grid without NanoVDB's headers. Copies share memory.
class NanoGrid {
  public:
    NanoGrid(std::shared_ptr<const std::byte> memory, std::size_t size) : memory_(std::move(memory)), size_(size) {}

    /// The whole grid, to be uploaded unchanged; the first byte is aligned to 32, as a copy's must be. A kernel reads
    /// it through `nanovdb::FloatGrid` (`nanovdb::Int32Grid` for triangles) or PNanoVDB.h. Lives as long as a copy of
    /// this.
    std::span<const std::byte> bytes() const { return {memory_.get(), size_}; }

  private:
    std::shared_ptr<const std::byte> memory_;
    std::size_t size_;
};

/// The distances: the values, active states, background, transform and class of the level set's grid, with NanoVDB's
/// statistics. The same bytes for any number of threads. Takes the level set's memory once more while it runs.
NanoGrid toNanoVdb(const LevelSet& levelSet);

/// The index of the nearest triangle at each active voxel; nothing where the level set has no such grid.
std::optional<NanoGrid> trianglesToNanoVdb(const LevelSet& levelSet);

/// Writes the grids "distance" and, where present, "triangle" to a .nvdb file, not compressed: whole or not at all, as
/// writeVdb() does. Throws std::runtime_error that names the file when it cannot be written.
void writeNanoVdb(const std::filesystem::path& path, const LevelSet& levelSet);

}  // namespace bilayer
