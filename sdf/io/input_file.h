// SPDX-License-Identifier: Apache-2.0
// Checks that an input path is a file.
// Tested by tests/sdf/mesh_io.cpp.
#pragma once

#include <filesystem>
#include <string>

namespace bilayer::detail {

/// Throws std::runtime_error that names the path, unless it is a readable regular file or a link to one. Other kinds
/// must not be opened: a FIFO blocks until a writer appears, and a device may have no end.
void requireInputFile(const std::filesystem::path& path);

/// Returns the extension of a path in lower case, with its dot: ".obj".
std::string lowerEnding(const std::filesystem::path& path);

}  // namespace bilayer::detail
