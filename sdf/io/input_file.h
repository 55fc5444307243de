// What is read must be a file.
#pragma once

#include <filesystem>
#include <string>

namespace bilayer::detail {

/// Throws std::runtime_error that names the path unless it is a regular file, or a link to one, that may be read.
/// Anything else must not be opened: a FIFO waits for a writer that may never come, and a device may have no end.
void requireInputFile(const std::filesystem::path& path);

/// The ending of a path in lower case, with its dot: ".obj".
std::string lowerEnding(const std::filesystem::path& path);

}  // namespace bilayer::detail
