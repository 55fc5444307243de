// SPDX-License-Identifier: Apache-2.0
// Where a batch keeps its files.
// Tested by tests/tools/batch.cpp through the program.
#pragma once

#include <filesystem>
#include <string>

namespace bilayer::tools {

/// The output folder of a batch. The field of the mesh "a/b.obj" is "a/b.obj.vdb". All else is in ".bilayer": records,
/// thumbnails, a file for locks, and work folders of the processes that convert meshes.
class BatchFolder {
  public:
    explicit BatchFolder(std::filesystem::path root) : root_(std::move(root)) {}

    /// Creates the folders that do not exist. Throws std::runtime_error that names the folder.
    void create() const;

    std::filesystem::path root() const { return root_; }
    std::filesystem::path records() const { return own() / "records"; }
    std::filesystem::path field(const std::string& name) const { return root_ / (name + ".vdb"); }
    std::filesystem::path locks() const { return own() / "lock"; }
    std::filesystem::path work() const { return own() / "work"; }
    std::filesystem::path thumbnail(const std::string& name) const;

  private:
    std::filesystem::path own() const { return root_ / ".bilayer"; }

    std::filesystem::path root_;
};

/// Names of files in a work folder.
inline constexpr const char *workField = "field.vdb", *workThumbnail = "thumbnail.png";

}  // namespace bilayer::tools
