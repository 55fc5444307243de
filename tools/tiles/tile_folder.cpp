// SPDX-License-Identifier: Apache-2.0
#include "tools/tiles/tile_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <stdexcept>
#include <system_error>

#include "sdf/io/input_file.h"
#include "sdf/io/mapped_file.h"
#include "tools/batch/content_hash.h"

namespace bilayer::tools {

using namespace bilayer::detail;

std::string TileFolder::nameOf(const glm::ivec3& tile) {
    return fmt::format("tile_{}_{}_{}", tile.x, tile.y, tile.z);
}

void TileFolder::create() const {
    std::error_code error;
    std::filesystem::create_directories(work(), error);
    if (error) throw std::runtime_error(fmt::format("{}: {}", work().string(), error.message()));
}

void TileFolder::clean() const {
    std::error_code ignored;
    std::filesystem::remove_all(work(), ignored);
}

void writeJson(const std::filesystem::path& path, const Json& json) {
    writeText(path, json.dump(1) + "\n");
}

Json readJson(const std::filesystem::path& path) {
    requireInputFile(path);
    std::ifstream stream(path, std::ios::binary);
    try {
        return Json::parse(stream);
    } catch (const Json::exception& error) {
        throw std::runtime_error(fmt::format("{}: is no JSON ({})", path.string(), error.what()));
    }
}

std::string fileHash(const std::filesystem::path& path) {
    constexpr std::size_t part = 1 << 26;
    const MappedFile file(path, MappedFile::Paging::onDemand);
    std::string hashes = std::to_string(file.bytes().size());
    for (std::size_t at = 0; at < file.bytes().size(); at += part) {
        hashes += hex(contentHash(file.bytes().substr(at, part)));
        file.release();
    }
    return hex(contentHash(hashes));
}

bool isIntact(const TileFolder& folder, const Json& record) {
    if (record.at("file").is_null()) return true;
    const std::filesystem::path path = folder.root() / record.at("file").get<std::string>();
    return std::filesystem::is_regular_file(path) && fileHash(path) == record.at("hash");
}

}  // namespace bilayer::tools
