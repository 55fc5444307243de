// SPDX-License-Identifier: Apache-2.0
// Folders for files that are not finished.
// Tested by tests/tools/batch_limits.cpp through the program.
#pragma once

#include <filesystem>

#include "tools/batch/output_locks.h"

namespace bilayer::tools {

/// The folder of one worker. It has a lock, so that other batches know that it is in use, and is removed at the end.
class WorkFolder {
  public:
    /// Creates the folder, whose name must be unique. Throws std::runtime_error that names what cannot be written.
    WorkFolder(const std::filesystem::path& path, const OutputLocks& locks);
    ~WorkFolder();
    WorkFolder(const WorkFolder&) = delete;
    WorkFolder& operator=(const WorkFolder&) = delete;

    const std::filesystem::path& path() const { return path_; }

  private:
    std::filesystem::path path_;
    std::optional<OutputLock> lock_;
};

/// Removes the work folders in a folder that batches have left which were killed.
void removeAbandoned(const std::filesystem::path& folder, const OutputLocks& locks);

}  // namespace bilayer::tools
