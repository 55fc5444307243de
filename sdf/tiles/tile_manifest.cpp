// SPDX-License-Identifier: Apache-2.0
#include "sdf/tiles/tile_manifest.h"

#include <fmt/format.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "sdf/io/content_hash.h"
#include "sdf/io/input_file.h"

namespace bilayer::detail {
namespace {

using Json = nlohmann::json;

glm::ivec3 triple(const Json& json) {
    return {json.at(0).get<int>(), json.at(1).get<int>(), json.at(2).get<int>()};
}

// A box whose last voxels are included.
BlockBox boxOf(const Json& json) {
    return {triple(json.at("lower")), triple(json.at("upper")) + 1};
}

TileRecord recordOf(const Json& json, const std::filesystem::path& folder) {
    TileRecord record{.box = boxOf(json), .field{}, .cells{}};
    if (json.at("file").is_null()) {
        record.inside = json.at("side").get<std::string>() == "inside";
        return record;
    }
    record.field = {folder / json.at("file").get<std::string>(), json.at("hash").get<std::string>()};
    record.cells = {folder / json.at("cells").get<std::string>(), json.at("cellsHash").get<std::string>()};
    record.hasBand = !json.at("band").is_null();
    if (record.hasBand) record.band = boxOf(json.at("band"));
    return record;
}

}  // namespace

void HashedFile::requireIntact() const {
    if (!std::filesystem::is_regular_file(path) || fileHash(path) != hash)
        throw std::runtime_error(fmt::format(
            "{}: is missing or damaged: repeat `bilayer build --tiles`, which builds it again", path.string()));
}

TileManifest readTileManifest(const std::filesystem::path& folder) {
    const std::filesystem::path path = folder / "manifest.json";
    if (!std::filesystem::exists(path))
        throw std::runtime_error(
            fmt::format("{}: no such file; `bilayer build --tiles` writes it when all tiles are there", path.string()));
    requireInputFile(path);
    TileManifest manifest;
    try {
        std::ifstream stream(path, std::ios::binary);
        const Json json = Json::parse(stream);
        manifest.counts = triple(json.at("field").at("tiles"));
        const Json& origin = json.at("mesh").at("origin");
        manifest.origin = {origin.at(0).get<double>(), origin.at(1).get<double>(), origin.at(2).get<double>()};
        for (const Json& tile : json.at("tiles")) manifest.tiles.push_back(recordOf(tile, folder));
    } catch (const Json::exception& error) {
        throw std::runtime_error(fmt::format("{}: is no manifest ({})", path.string(), error.what()));
    }
    const glm::dvec3 counts(manifest.counts);
    if (!(counts.x * counts.y * counts.z == double(manifest.tiles.size())) || manifest.tiles.empty())
        throw std::runtime_error(fmt::format("{}: has {} tiles, but states {} x {} x {}", path.string(),
                                             manifest.tiles.size(), counts.x, counts.y, counts.z));
    return manifest;
}

}  // namespace bilayer::detail
