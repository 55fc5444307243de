// SPDX-License-Identifier: Apache-2.0
#include <bilayer/sdf/nanovdb.h>

#include <nanovdb/util/GridHandle.h>
#include <nanovdb/util/IO.h>
#include <nanovdb/util/OpenToNanoVDB.h>

#include <ostream>
#include <vector>

#include <bilayer/sdf/grids.h>
#include "sdf/base/openvdb.h"
#include "sdf/io/atomic_file.h"

namespace bilayer {

using namespace detail;

namespace {

constexpr std::align_val_t alignment{NANOVDB_DATA_ALIGNMENT};

// The buffer in which NanoVDB builds a grid, with the interface that its GridHandle requires.
class Buffer {
  public:
    static Buffer create(std::uint64_t size, const Buffer* = nullptr) {
        Buffer buffer;
        buffer.memory_ = {static_cast<std::byte*>(::operator new(size, alignment)),
                          [](std::byte* memory) { ::operator delete(memory, alignment); }};
        buffer.size_ = size;
        return buffer;
    }
    std::uint8_t* data() { return reinterpret_cast<std::uint8_t*>(memory_.get()); }
    const std::uint8_t* data() const { return reinterpret_cast<const std::uint8_t*>(memory_.get()); }
    std::uint64_t size() const { return size_; }
    void clear() { *this = Buffer(); }
    NanoGrid grid() const { return {memory_, size_}; }

  private:
    std::shared_ptr<std::byte> memory_;
    std::uint64_t size_ = 0;
};

using Handle = nanovdb::GridHandle<Buffer>;

// NanoVDB writes to the nodes of the grid that it reads, which other threads may be reading. It therefore gets a copy.
template <class Grid>
Handle convert(const Grid& grid) {
    return nanovdb::openToNanoVDB<Buffer>(*grid.deepCopy());
}

// The same, with the origin in the transform, as in files.
template <class Grid>
Handle convertInWorld(const std::shared_ptr<const Grid>& grid, const LevelSet& levelSet) {
    return convert(*openvdb::gridPtrCast<Grid>(inWorld(grid, levelSet)));
}

}  // namespace

NanoGrid toNanoVdb(const LevelSet& levelSet) {
    return convert(*levelSet.grids().distance).buffer().grid();
}

std::optional<NanoGrid> trianglesToNanoVdb(const LevelSet& levelSet) {
    if (!levelSet.grids().triangle) return std::nullopt;
    return convert(*levelSet.grids().triangle).buffer().grid();
}

void writeNanoVdb(const std::filesystem::path& path, const LevelSet& levelSet) {
    std::vector<Handle> grids;
    grids.push_back(convertInWorld(levelSet.grids().distance, levelSet));
    if (levelSet.grids().triangle) grids.push_back(convertInWorld(levelSet.grids().triangle, levelSet));
    writeWhole(path, [&](std::ostream& stream) { nanovdb::io::writeGrids(stream, grids); });
}

}  // namespace bilayer
