// SPDX-License-Identifier: Apache-2.0
// Locks of outputs, for batches that overlap.
// Tested by tests/tools/batch.cpp through the program.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <string_view>
#include <utility>

namespace bilayer::tools {

/// The lock of one name, held until its end.
class OutputLock {
  public:
    OutputLock(OutputLock&& other) noexcept : file_(std::exchange(other.file_, -1)), at_(other.at_) {}
    OutputLock& operator=(OutputLock&&) = delete;
    ~OutputLock();

  private:
    friend class OutputLocks;
    OutputLock(int file, off_t at) : file_(file), at_(at) {}

    int file_;
    off_t at_;
};

/// Locks of names that no other batch can take meanwhile, on this machine or another one with the same file system.
/// Each is a lock of one byte in a file that stays empty: to create and remove a file for each would be slow, because
/// ext4 searches past all files that were removed in the last seconds. The locks end with the process and its children.
class OutputLocks {
  public:
    /// Creates the file if it does not exist. Throws std::runtime_error that names it.
    explicit OutputLocks(std::filesystem::path path);
    ~OutputLocks();
    OutputLocks(const OutputLocks&) = delete;
    OutputLocks& operator=(const OutputLocks&) = delete;

    /// Returns nothing if another batch holds the lock of this name. Throws std::runtime_error that names the file if
    /// the file system does not lock files. The lock must end before this object.
    std::optional<OutputLock> take(std::string_view name) const;

  private:
    [[noreturn]] void fail(int error) const;

    std::filesystem::path path_;
    int file_;
};

}  // namespace bilayer::tools
