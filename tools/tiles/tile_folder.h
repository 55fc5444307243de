// SPDX-License-Identifier: Apache-2.0
// Where the tiles of a field are kept: a .vdb and a .cells file for each tile, manifest.json when all are there, and a
// folder `work` while some are missing.
//
// Tested by tests/tools/tiles.cpp through the program.
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/vec3.hpp>
#include <initializer_list>
#include <string>

#include "tools/output.h"

namespace bilayer::tools {

class TileFolder {
  public:
    explicit TileFolder(std::filesystem::path root) : root_(std::move(root)) {}

    std::filesystem::path manifest() const { return root_ / "manifest.json"; }
    std::filesystem::path field(const glm::ivec3& tile) const { return root_ / (nameOf(tile) + ".vdb"); }

    /// The surface blocks of a tile, which distance bounds in other tiles depend on.
    std::filesystem::path cells(const glm::ivec3& tile) const { return root_ / (nameOf(tile) + ".cells"); }

    /// What a build has planned: the mesh, the options and the tiles. It is there when all triangles are sorted.
    std::filesystem::path plan() const { return work() / "all.plan"; }
    /// The triangles of a tile.
    std::filesystem::path triangles(const glm::ivec3& tile) const { return work() / (nameOf(tile) + ".triangles"); }
    /// The sums of a tile's columns.
    std::filesystem::path sums(const glm::ivec3& tile) const { return work() / (nameOf(tile) + ".sums"); }
    /// The unsigned distances of a tile, its border, and when a flood reaches it: by distances, and by triangles.
    std::filesystem::path distances(const glm::ivec3& tile) const { return work() / (nameOf(tile) + ".distances"); }
    std::filesystem::path border(const glm::ivec3& tile) const { return work() / (nameOf(tile) + ".border"); }
    std::filesystem::path byDistance(const glm::ivec3& tile) const { return work() / (nameOf(tile) + ".by_distance"); }
    std::filesystem::path byTriangles(const glm::ivec3& tile) const {
        return work() / (nameOf(tile) + ".by_triangles");
    }
    /// The sides of the regions of a flood in all tiles.
    std::filesystem::path regions() const { return work() / "all.regions"; }
    /// It is there if a growth of a flood has improved any tile in a round.
    std::filesystem::path improved(const std::string& growth, std::uint32_t round) const;
    /// What is known of a finished tile.
    std::filesystem::path record(const glm::ivec3& tile) const { return work() / (nameOf(tile) + ".record"); }

    /// Creates the folders that do not exist. Throws std::runtime_error that names the folder.
    void create() const;
    /// Removes the plan, then what tiles of earlier signs have exchanged.
    void removePlan() const;
    /// Removes the records of all tiles, which are then built anew.
    void removeRecords() const;
    /// Removes what depends on the sides of a flood's regions.
    void removeGrowth() const;
    /// Removes the files of a tile and its record.
    void remove(const glm::ivec3& tile) const;
    /// Returns whether there is any tile, or the record of one.
    bool hasTiles() const;
    /// Removes the folder `work`.
    void clean() const;

    const std::filesystem::path& root() const { return root_; }
    std::filesystem::path work() const { return root_ / "work"; }

  private:
    void removeFromWork(std::initializer_list<const char*> extensions) const;
    static std::string nameOf(const glm::ivec3& tile);

    std::filesystem::path root_;
};

/// The lock of a folder, which ends with this object and with the process. Some network file systems have no locks for
/// folders; nothing is locked there.
class FolderLock {
  public:
    /// Throws std::runtime_error that names the folder if another process has its lock.
    explicit FolderLock(const std::filesystem::path& folder);
    ~FolderLock();
    FolderLock(const FolderLock&) = delete;
    FolderLock& operator=(const FolderLock&) = delete;

  private:
    int file_;
};

/// Writes a manifest with its hash, whole or not at all. Throws std::runtime_error that names the file.
void writeManifest(const std::filesystem::path& path, Json manifest);

/// Throws std::runtime_error that names the file if it cannot be read or is no JSON.
Json readJson(const std::filesystem::path& path);

/// The same for a file in `work`, which has a hash of its bytes.
void writeRecord(const std::filesystem::path& path, const Json& json);

/// Throws std::runtime_error that names the file if it cannot be read or is damaged.
Json readRecord(const std::filesystem::path& path);

/// Returns the plan that a killed run has left. Throws std::runtime_error that says what to do if it is damaged.
Json readPlanOfKilledRun(const TileFolder& folder);

/// The size of the file that writeRecord() makes [bytes].
std::uint64_t recordBytes(const Json& json);

/// Returns whether the files of a tile are there with the bytes that its record states. A tile without leaves has no
/// file.
bool isIntact(const TileFolder& folder, const Json& record);

/// Returns whether the record of a tile is there and intact, and the files that it states.
bool isFinished(const TileFolder& folder, const glm::ivec3& tile);

}  // namespace bilayer::tools
