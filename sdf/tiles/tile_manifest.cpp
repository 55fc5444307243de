// SPDX-License-Identifier: Apache-2.0
#include "sdf/tiles/tile_manifest.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/vector_relational.hpp>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string_view>

#include "sdf/base/quoted_text.h"
#include "sdf/io/content_hash.h"
#include "sdf/io/input_file.h"
#include "sdf/io/mapped_file.h"

namespace bilayer::detail {
namespace {

using Json = nlohmann::json;

constexpr int maxCoordinate = 1 << 29;  // of voxels, so that sums and differences fit into 32 bits
constexpr std::size_t maxFileName = 255;

int whole(const Json& json) {
    if (!json.is_number_integer() || !(std::abs(json.get<double>()) <= maxCoordinate))
        throw std::runtime_error(
            fmt::format("{} stands where a whole number up to {} belongs", quotedWord(json.dump()), maxCoordinate));
    return json.get<int>();
}

glm::ivec3 triple(const Json& json) {
    return {whole(json.at(0)), whole(json.at(1)), whole(json.at(2))};
}

// A box whose last voxels are included.
BlockBox boxOf(const Json& json) {
    return {triple(json.at("lower")), triple(json.at("upper")) + 1};
}

HashedFile fileOf(const Json& name, const Json& hash, const std::filesystem::path& folder) {
    const auto text = name.get<std::string>();
    const bool isPlain = text != "." && text != ".." && text == std::filesystem::path(text).filename() &&
                         text.size() <= maxFileName &&
                         std::all_of(text.begin(), text.end(), [](char c) { return c >= ' ' && c <= '~'; });
    if (!isPlain || text.empty())
        throw std::runtime_error(fmt::format("{} is no name of a file in its folder", quotedWord(text)));
    return {folder / text, hash.get<std::string>()};
}

TileRecord recordOf(const Json& json, const std::filesystem::path& folder) {
    TileRecord record{.box = boxOf(json), .field{}, .cells{}};
    if (json.at("file").is_null()) {
        const auto side = json.at("side").get<std::string>();
        record.inside = side == "inside";
        if (record.inside || side == "outside") return record;
        throw std::runtime_error(
            fmt::format("the side of a tile is {}, and must be 'inside' or 'outside'", quotedWord(side)));
    }
    record.field = fileOf(json.at("file"), json.at("hash"), folder);
    record.cells = fileOf(json.at("cells"), json.at("cellsHash"), folder);
    record.hasBand = !json.at("band").is_null();
    if (record.hasBand) record.band = boxOf(json.at("band"));
    return record;
}

bool isWithin(const BlockBox& inner, const BlockBox& outer) {
    return glm::all(glm::lessThan(inner.first, inner.end)) && outer.contains(inner.first) &&
           outer.contains(inner.end - 1);
}

// Whether a tile's extent along an axis is of whole blocks, begins where the tile before it ends, and is that of all
// tiles in the same layer.
bool isInLine(const TileManifest& manifest, const glm::ivec3& place, int axis) {
    glm::ivec3 same(0), before = place;
    same[axis] = place[axis];
    --before[axis];
    const BlockBox &box = manifest.tiles[manifest.at(place)].box, &layer = manifest.tiles[manifest.at(same)].box;
    return box.first[axis] == layer.first[axis] && box.end[axis] == layer.end[axis] &&
           box.first[axis] % blockSide == 0 && box.end[axis] % blockSide == 0 &&
           (place[axis] == 0 || box.first[axis] == manifest.tiles[manifest.at(before)].box.end[axis]);
}

void requireBoxes(const TileManifest& manifest, const glm::ivec3& place) {
    const TileRecord& tile = manifest.tiles[manifest.at(place)];
    const auto refuse = [&](const std::string& why) {
        throw std::runtime_error(fmt::format("tile {} {} {}: {}", place.x, place.y, place.z, why));
    };
    if (!isWithin(tile.box, tile.box) || !isInLine(manifest, place, 0) || !isInLine(manifest, place, 1) ||
        !isInLine(manifest, place, 2))
        refuse(
            fmt::format("its box must be of whole blocks of {} voxels, begin where the tile before it ends, and be as "
                        "long as the others of its layer",
                        blockSide));
    if (tile.hasBand && !isWithin(tile.band, tile.box)) refuse("its band must lie in its box");
}

void requireOrder(const TileManifest& manifest) {
    const glm::ivec3& counts = manifest.counts;
    if (glm::any(glm::lessThan(counts, glm::ivec3(1))) ||
        double(counts.x) * counts.y * counts.z != double(manifest.tiles.size()))
        throw std::runtime_error(fmt::format("it has {} tiles, but states {} x {} x {}", manifest.tiles.size(),
                                             counts.x, counts.y, counts.z));
    glm::ivec3 place(0);
    for (place.x = 0; place.x < counts.x; ++place.x)
        for (place.y = 0; place.y < counts.y; ++place.y)
            for (place.z = 0; place.z < counts.z; ++place.z) requireBoxes(manifest, place);
}

}  // namespace

void HashedFile::requireIntact() const {
    if (!std::filesystem::is_regular_file(path) || fileHash(path) != hash)
        throw std::runtime_error(fmt::format(
            "{}: is missing or damaged: repeat `bilayer build --tiles`, which builds it again", path.string()));
}

std::string withHash(std::string text) {
    constexpr std::string_view entry = "\"hash\": \"", end = "\"\n}\n";
    constexpr std::size_t digits = 16;
    if (text.size() < entry.size() + digits + end.size() || !text.ends_with(end)) return text;
    const std::size_t at = text.size() - end.size() - digits;
    if (text.compare(at - entry.size(), entry.size(), entry) != 0) return text;
    text.replace(at, digits, digits, '0');
    return text.replace(at, digits, fmt::format("{:016x}", contentHash(text)));
}

TileManifest readTileManifest(const std::filesystem::path& folder) {
    const std::filesystem::path path = folder / "manifest.json";
    if (!std::filesystem::exists(path))
        throw std::runtime_error(
            fmt::format("{}: no such file; `bilayer build --tiles` writes it when all tiles are there", path.string()));
    requireInputFile(path);
    const auto refuse = [&](const char* why) {
        throw std::runtime_error(fmt::format("{}: is no manifest of tiles ({})", path.string(), oneLine(why)));
    };
    TileManifest manifest;
    try {
        const MappedFile file(path);
        const std::string text(file.bytes());
        if (withHash(text) != text)
            throw std::runtime_error("its bytes have another hash: remove it, and repeat `bilayer build --tiles`");
        const Json json = Json::parse(text);
        manifest.counts = triple(json.at("field").at("tiles"));
        const Json& origin = json.at("mesh").at("origin");
        manifest.origin = {origin.at(0).get<double>(), origin.at(1).get<double>(), origin.at(2).get<double>()};
        for (const Json& tile : json.at("tiles")) manifest.tiles.push_back(recordOf(tile, folder));
        requireOrder(manifest);
    } catch (const Json::exception& error) {
        refuse(error.what());
    } catch (const std::runtime_error& error) {
        refuse(error.what());
    }
    return manifest;
}

}  // namespace bilayer::detail
