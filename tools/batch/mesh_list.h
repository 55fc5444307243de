// SPDX-License-Identifier: Apache-2.0
// The meshes of a batch.
// Tested by tests/tools/batch.cpp through the program.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tools/batch/shard.h"

namespace bilayer::tools {

/// A mesh file and its name in the library: a relative path with '/', which decides its shard and its output.
struct BatchMesh {
    std::filesystem::path file;
    std::string name;
};

/// Returns the mesh files in a folder and its subfolders, by their extensions, with names relative to it. Links to
/// files are followed, links to folders are not. Throws std::runtime_error that names a folder that cannot be read.
std::vector<BatchMesh> meshesInTree(const std::filesystem::path& folder);

/// Returns the files that a text file lists, one a line; "-" is standard input. Empty lines are skipped. Throws
/// std::runtime_error if it cannot be read.
std::vector<std::filesystem::path> pathsInList(const std::filesystem::path& list);

/// Returns files with their paths as names. A path outside the current folder gets its absolute path, without the
/// first slash.
std::vector<BatchMesh> meshesOf(const std::vector<std::filesystem::path>& files);

/// Returns the meshes of a shard in the order of their names, each once. Throws std::runtime_error if two files have
/// one name.
std::vector<BatchMesh> shardOf(std::vector<BatchMesh> meshes, const Shard& shard);

}  // namespace bilayer::tools
