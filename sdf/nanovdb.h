// SPDX-License-Identifier: Apache-2.0
// Fields as NanoVDB grids: contiguous memory that GPU code reads without conversion.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <utility>

#include <bilayer/sdf/level_set.h>

namespace bilayer {

/// An immutable NanoVDB grid; this header does not include NanoVDB's. Copies share memory.
class NanoGrid {
  public:
    /// From the bytes of a grid, aligned to 32 bytes, and their count.
    NanoGrid(std::shared_ptr<const std::byte> memory, std::size_t size) : memory_(std::move(memory)), size_(size) {}

    /// The whole grid, for upload without changes. The first byte is aligned to 32 bytes; copies of the bytes need the
    /// same alignment. A kernel reads them through `nanovdb::FloatGrid` (`nanovdb::Int32Grid` for triangles) or
    /// PNanoVDB.h. The span is valid as long as any copy of this object exists.
    std::span<const std::byte> bytes() const { return {memory_.get(), size_}; }

  private:
    std::shared_ptr<const std::byte> memory_;
    std::size_t size_;
};

/// Converts the distances: values, active states, background, transform and class of the level set's grid, with
/// NanoVDB's statistics. The bytes do not depend on the thread count. Temporarily needs as much memory again as the
/// level set.
NanoGrid toNanoVdb(const LevelSet& levelSet);

/// Converts the index of the nearest triangle at each active voxel; empty if the level set has no such grid.
std::optional<NanoGrid> trianglesToNanoVdb(const LevelSet& levelSet);

/// Writes the grids "distance" and, if present, "triangle" to an uncompressed .nvdb file. An error leaves no partial
/// file, as with writeVdb(). Throws std::runtime_error that names the file if it cannot be written.
void writeNanoVdb(const std::filesystem::path& path, const LevelSet& levelSet);

}  // namespace bilayer
