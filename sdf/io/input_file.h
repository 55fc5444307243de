// SPDX-License-Identifier: Apache-2.0
// What all readers do with the path of an input.
// Tested by tests/sdf/mesh_io.cpp through readMesh().
#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

namespace bilayer::detail {

/// Throws std::runtime_error that names the path, unless it is a readable regular file or a link to one. Other kinds
/// must not be opened: a FIFO blocks until a writer appears, and a device may have no end.
void requireInputFile(const std::filesystem::path& path);

/// Returns work(). A std::invalid_argument of it becomes a std::runtime_error that names the file.
template <class Work>
auto namingFile(const std::filesystem::path& path, const Work& work) {
    try {
        return work();
    } catch (const std::invalid_argument& error) {
        throw std::runtime_error(path.string() + ": " + error.what());
    }
}

/// Returns the extension of a path in lower case, with its dot: ".obj".
std::string lowerExtension(const std::filesystem::path& path);

}  // namespace bilayer::detail
