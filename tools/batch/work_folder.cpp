// SPDX-License-Identifier: Apache-2.0
#include "tools/batch/work_folder.h"

#include <fmt/format.h>

#include <stdexcept>
#include <system_error>
#include <vector>

namespace bilayer::tools {

namespace fs = std::filesystem;

WorkFolder::WorkFolder(const fs::path& path, const OutputLocks& locks)
    : path_(path), lock_(locks.take(path.filename().string())) {
    if (!lock_) throw std::runtime_error(path.string() + ": another batch has this work folder");
    std::error_code error;
    fs::create_directory(path, error);
    if (error) throw std::runtime_error(fmt::format("cannot create {}: {}", path.string(), error.message()));
}

WorkFolder::~WorkFolder() {
    std::error_code absent;
    fs::remove_all(path_, absent);
}

void removeAbandoned(const fs::path& folder, const OutputLocks& locks) {
    // listed first: what is removed meanwhile need not be in the rest of a listing
    std::error_code error;
    std::vector<fs::path> found;
    for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
        found.push_back(entry->path());
    for (const fs::path& path : found)
        if (const auto lock = locks.take(path.filename().string())) fs::remove_all(path, error);
}

}  // namespace bilayer::tools
