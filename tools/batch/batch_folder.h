// SPDX-License-Identifier: Apache-2.0
// Where a batch keeps its files.
// Tested by tests/tools/batch.cpp through run().
#pragma once

#include <filesystem>
#include <string>

namespace bilayer::tools {

/// The output folder of a batch. The field of the mesh "a/b.obj" is "a/b.obj.vdb". All else is in ".bilayer": records,
/// locks, thumbnails, and a work folder for each mesh that is being converted.
class BatchFolder {
  public:
    explicit BatchFolder(std::filesystem::path root) : root_(std::move(root)) {}

    /// Creates the folders that do not exist. Throws std::runtime_error that names the folder.
    void create() const;

    std::filesystem::path root() const { return root_; }
    std::filesystem::path records() const { return own() / "records"; }
    std::filesystem::path field(const std::string& name) const { return root_ / (name + ".vdb"); }
    std::filesystem::path lock(const std::string& name) const { return own() / "locks" / key(name); }
    std::filesystem::path work(const std::string& name) const { return own() / "work" / key(name); }
    std::filesystem::path thumbnail(const std::string& name) const;

  private:
    std::filesystem::path own() const { return root_ / ".bilayer"; }
    static std::string key(const std::string& name);

    std::filesystem::path root_;
};

/// Names of files in a work folder.
inline constexpr const char *workField = "field.vdb", *workThumbnail = "thumbnail.png";

}  // namespace bilayer::tools
