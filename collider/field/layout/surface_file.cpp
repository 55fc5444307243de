// SPDX-License-Identifier: Apache-2.0
#include "collider/field/layout/surface_file.h"

#include <fmt/format.h>

#include <fstream>
#include <stdexcept>

#include "sdf/io/atomic_file.h"
#include "sdf/io/input_file.h"

namespace bilayer::detail {

static_assert(sizeof(SurfaceBlock) == 16, "files of blocks have no gaps");

void writeSurfaceBlocks(const std::filesystem::path& path, std::span<const SurfaceBlock> blocks) {
    writeWhole(path, [&](std::ostream& stream) {
        stream.write(reinterpret_cast<const char*>(blocks.data()), std::streamsize(blocks.size_bytes()));
    });
}

void readSurfaceBlocks(const std::filesystem::path& path, std::vector<SurfaceBlock>& blocks) {
    requireInputFile(path);
    const std::size_t bytes = std::filesystem::file_size(path), before = blocks.size();
    blocks.resize(before + bytes / sizeof(SurfaceBlock));
    std::ifstream stream(path, std::ios::binary);
    stream.read(reinterpret_cast<char*>(blocks.data() + before),
                std::streamsize((blocks.size() - before) * sizeof(SurfaceBlock)));
    if (!stream || bytes % sizeof(SurfaceBlock) != 0)
        throw std::runtime_error(fmt::format("{}: cannot be read, or its size is no multiple of {} bytes",
                                             path.string(), sizeof(SurfaceBlock)));
}

}  // namespace bilayer::detail
