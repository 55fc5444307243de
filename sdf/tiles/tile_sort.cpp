// SPDX-License-Identifier: Apache-2.0
#include "sdf/tiles/tile_sort.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <glm/geometric.hpp>
#include <stdexcept>

#include "sdf/base/hash.h"
#include "sdf/fill/triangle_limits.h"
#include "sdf/io/input_file.h"
#include "sdf/tiles/hashed_record.h"

namespace bilayer::detail {
namespace {

constexpr std::size_t bufferBytes = 64 << 20;               // of all tiles together
constexpr std::size_t minBuffer = 64, maxBuffer = 1 << 14;  // of a tile [triangles]

/// Returns the area of the parts of a triangle that meet a box. Parts have edges of at most `edge`.
double areaWithin(const TriangleCorners& c, const TriangleLimits& limits, double edge) {
    if (misses(c, limits)) return 0;
    std::size_t longest = 0;
    const auto length = [&](std::size_t i) { return glm::distance(c[i], c[(i + 1) % 3]); };
    for (const std::size_t i : {1u, 2u})
        if (length(i) > length(longest)) longest = i;
    if (length(longest) <= edge) return 0.5 * glm::length(glm::cross(c[1] - c[0], c[2] - c[0]));
    const glm::dvec3 &a = c[longest], &b = c[(longest + 1) % 3], &p = c[(longest + 2) % 3];
    const glm::dvec3 middle = 0.5 * (a + b);
    return areaWithin({a, middle, p}, limits, edge) + areaWithin({middle, b, p}, limits, edge);
}

/// Returns a hash that is continued by a triangle.
std::uint64_t hashWith(std::uint64_t hash, const TileTriangle& triangle) {
    std::uint64_t words[sizeof triangle / sizeof(std::uint64_t)];
    static_assert(sizeof words == sizeof triangle);
    std::memcpy(words, &triangle, sizeof words);
    for (const std::uint64_t word : words) hash = mixedHash(hash, word);
    return hash;
}

/// The file of one tile. It is open only while its buffer is written: there may be more tiles than open files.
class TileFile {
  public:
    void add(const TileTriangle& triangle, std::size_t room, const std::filesystem::path& path) {
        buffer_.push_back(triangle);
        if (buffer_.size() >= room) flush(path);
    }

    void flush(const std::filesystem::path& path) {
        if (buffer_.empty()) return;
        std::ofstream stream(path, std::ios::binary | (isNew_ ? std::ios::trunc : std::ios::app));
        stream.write(reinterpret_cast<const char*>(buffer_.data()),
                     std::streamsize(buffer_.size() * sizeof(TileTriangle)));
        stream.close();
        if (!stream) throw std::runtime_error(fmt::format("{}: cannot be written (is the disk full?)", path.string()));
        isNew_ = false;
        buffer_.clear();
    }

  private:
    std::vector<TileTriangle> buffer_;
    bool isNew_ = true;
};

}  // namespace

std::vector<TileLoad> sortTriangles(const TriangleSource& source, Tiling& tiling, float voxelSize,
                                    const std::function<std::filesystem::path(std::size_t)>& fileOf) {
    const double voxelsPerUnit = 1.0 / double(voxelSize);
    const std::size_t room = std::clamp(bufferBytes / sizeof(TileTriangle) / tiling.size(), minBuffer, maxBuffer);
    std::vector<TileLoad> loads(tiling.size());
    std::vector<TileFile> files(tiling.size());
    source.forEach([&](std::span<const TileTriangle> batch) {
        for (const TileTriangle& t : batch) {
            const auto at = [&](int k) { return glm::dvec3(t.corners[k]) * voxelsPerUnit; };
            const TriangleCorners corners{at(0), at(1), at(2)};
            tiling.forEachTileOf(corners, [&](std::size_t tile) {
                ++loads[tile].triangles;
                loads[tile].hash = hashWith(loads[tile].hash, t);
                loads[tile].area += areaWithin(corners, tiling.limits(tile), double(tiling.brickSide()));
                files[tile].add(t, room, fileOf(tile));
            });
        }
    });
    for (std::size_t tile = 0; tile < files.size(); ++tile) files[tile].flush(fileOf(tile));
    return loads;
}

std::vector<TileTriangle> readTileTriangles(const std::filesystem::path& path, const TileLoad& load) {
    std::vector<TileTriangle> triangles(load.triangles);
    if (load.triangles == 0) return triangles;
    requireInputFile(path);
    const std::uint64_t size = load.triangles * sizeof(TileTriangle);
    std::ifstream stream(path, std::ios::binary);
    stream.read(reinterpret_cast<char*>(triangles.data()), std::streamsize(size));
    std::uint64_t hash = 0;
    for (const TileTriangle& triangle : triangles) hash = hashWith(hash, triangle);
    if (!stream || std::filesystem::file_size(path) != size || hash != load.hash)
        throw std::runtime_error(
            fmt::format("{}: is damaged: repeat the command, which writes it again", path.string()));
    return triangles;
}

bool hasTileTriangles(const std::filesystem::path& path, const TileLoad& load) {
    return passes([&] {
        readTileTriangles(path, load);
        return true;
    });
}

}  // namespace bilayer::detail
