// SPDX-License-Identifier: Apache-2.0
// Libraries of small meshes, and batches over them.
#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "tests/tools/program.h"

namespace bilayer::test {

/// Makes an empty folder in the scratch folder.
std::filesystem::path emptyFolder(const std::string& name);

/// Makes a folder with `count` different boxes in two subfolders: "a/0.ply", "b/1.ply", "a/2.ply", ...
std::filesystem::path boxLibrary(const std::string& name, int count);

/// The command `bilayer batch --tree LIBRARY -o OUTPUT --voxel-size 0.1 --json` with more options.
Words batchWords(const std::filesystem::path& library, const std::filesystem::path& output, const Words& options = {});

/// Parses lines of JSON. Returns them by their member "file".
std::map<std::string, nlohmann::json> recordsIn(const std::string& lines);

/// The files below a folder, by relative path, without those in ".bilayer", with their contents. What
/// differs between two files of one field is left out: OpenVDB's random identifier and the checksum.
std::map<std::string, std::string> fieldsIn(const std::filesystem::path& folder);

/// The files that a batch has left in its own folder, other than records and thumbnails. There should be none.
std::vector<std::string> leftovers(const std::filesystem::path& output);

/// Waits until a process has this many children. Returns them; nothing after ten seconds.
std::vector<pid_t> childrenOf(pid_t process, std::size_t count);

}  // namespace bilayer::test
