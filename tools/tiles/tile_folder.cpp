// SPDX-License-Identifier: Apache-2.0
#include "tools/tiles/tile_folder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "sdf/io/content_hash.h"
#include "sdf/io/input_file.h"
#include "sdf/tiles/hashed_record.h"
#include "sdf/tiles/tile_manifest.h"

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

void TileFolder::removePlan() const {
    std::filesystem::remove(plan());
    removeFromWork({".sums", ".distances", ".border"});
    removeGrowth();
}

void TileFolder::removeRecords() const {
    removeFromWork({".record"});
}

void TileFolder::removeGrowth() const {
    removeFromWork({".regions", ".by_distance", ".by_triangles", ".improved"});
}

void TileFolder::removeFromWork(std::initializer_list<const char*> extensions) const {
    std::vector<std::filesystem::path> found;
    for (const auto& entry : std::filesystem::directory_iterator(work()))
        if (std::find(extensions.begin(), extensions.end(), entry.path().extension()) != extensions.end())
            found.push_back(entry.path());
    for (const auto& path : found) std::filesystem::remove(path);
}

std::filesystem::path TileFolder::improved(const std::string& growth, std::uint32_t round) const {
    return work() / fmt::format("{}_{}.improved", growth, round);
}

void TileFolder::remove(const glm::ivec3& tile) const {
    for (const auto& path : {record(tile), field(tile), cells(tile)}) std::filesystem::remove(path);
}

bool TileFolder::hasTiles() const {
    const auto holds = [](const std::filesystem::path& folder, auto&& accept) {
        std::error_code ignored;
        for (const auto& entry : std::filesystem::directory_iterator(folder, ignored))
            if (accept(entry.path())) return true;
        return false;
    };
    return holds(root_, [](const auto& path) { return path.filename().string().starts_with("tile_"); }) ||
           holds(work(), [](const auto& path) { return path.extension() == ".record"; });
}

void TileFolder::clean() const {
    std::error_code ignored;
    std::filesystem::remove_all(work(), ignored);
}

FolderLock::FolderLock(const std::filesystem::path& folder)
    : file_(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
    if (file_ < 0 || ::flock(file_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;
    ::close(file_);
    throw std::runtime_error(folder.string() + ": another process builds these tiles: wait until it has ended");
}

FolderLock::~FolderLock() {
    if (file_ >= 0) ::close(file_);
}

void writeManifest(const std::filesystem::path& path, Json manifest) {
    manifest["hash"] = hex(0);
    writeText(path, withHash(manifest.dump(1) + "\n"));
}

Json readJson(const std::filesystem::path& path) {
    requireInputFile(path);
    std::ifstream stream(path, std::ios::binary);
    try {
        return Json::parse(stream);
    } catch (const Json::exception& error) {
        throw std::runtime_error(
            fmt::format("{}: is damaged ({}): remove it, and repeat the command", path.string(), error.what()));
    }
}

void writeRecord(const std::filesystem::path& path, const Json& json) {
    const std::string text = json.dump();
    HashedRecordWriter record;
    record.add(std::vector<char>(text.begin(), text.end()));
    record.write(path);
}

Json readRecord(const std::filesystem::path& path) {
    return Json::parse(HashedRecordReader(path).values<char>());
}

Json readPlanOfKilledRun(const TileFolder& folder) {
    try {
        return readRecord(folder.plan());
    } catch (const std::runtime_error&) {
        throw std::runtime_error(fmt::format("{}: is damaged: remove the folder {}, and repeat the command",
                                             folder.plan().string(), folder.work().string()));
    }
}

std::uint64_t recordBytes(const Json& json) {
    return json.dump().size() + 2 * sizeof(std::uint64_t);  // with its length and its hash
}

bool isIntact(const TileFolder& folder, const Json& record) {
    if (record.at("file").is_null()) return true;
    const auto intact = [&](const char* file, const char* hash) {
        const std::filesystem::path path = folder.root() / record.at(file).get<std::string>();
        return std::filesystem::is_regular_file(path) && fileHash(path) == record.at(hash);
    };
    return intact("file", "hash") && intact("cells", "cellsHash");
}

bool isFinished(const TileFolder& folder, const glm::ivec3& tile) {
    return passes([&] { return isIntact(folder, readRecord(folder.record(tile))); });
}

}  // namespace bilayer::tools
