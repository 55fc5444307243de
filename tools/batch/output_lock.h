// SPDX-License-Identifier: Apache-2.0
// Locks of outputs, for batches that overlap.
// Tested by tests/tools/batch.cpp through run().
#pragma once

#include <filesystem>
#include <optional>
#include <utility>

namespace bilayer::tools {

/// Holds the lock of one output, so that no other batch builds it meanwhile, on this machine or another one with the
/// same file system. It is a lock file, which is removed at the end. The lock ends with the process in any case.
class OutputLock {
  public:
    /// Returns nothing if another batch holds the lock. Throws std::runtime_error that names the file if the file
    /// system does not lock files.
    static std::optional<OutputLock> take(const std::filesystem::path& path);

    OutputLock(OutputLock&& other) noexcept : path_(std::move(other.path_)), file_(std::exchange(other.file_, -1)) {}
    OutputLock& operator=(OutputLock&&) = delete;
    ~OutputLock();

  private:
    OutputLock(std::filesystem::path path, int file) : path_(std::move(path)), file_(file) {}

    std::filesystem::path path_;
    int file_;
};

}  // namespace bilayer::tools
