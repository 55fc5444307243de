// SPDX-License-Identifier: Apache-2.0
// Files that appear complete or not at all.
// Tested by tests/tools/files.cpp.
#pragma once

#include <filesystem>
#include <functional>
#include <iosfwd>

namespace bilayer::detail {

/// A file that is written under a temporary name next to its target and replaces the target in commit(). Without
/// commit(), the destructor removes it and an existing target stays unchanged. A symbolic link is followed to its
/// target. The permissions of an existing target are kept.
class AtomicFile {
  public:
    /// Creates the empty temporary file. Throws std::runtime_error that names `target` if its folder is not writable,
    /// or if `target` exists and is not a regular file.
    explicit AtomicFile(const std::filesystem::path& target);
    ~AtomicFile();
    AtomicFile(const AtomicFile&) = delete;
    AtomicFile& operator=(const AtomicFile&) = delete;

    /// The path to write to. It is in the folder of the target, so that commit() is one atomic rename.
    const std::filesystem::path& temporary() const { return temporary_; }

    /// Replaces the target by the temporary file, which must be complete and closed. Throws std::runtime_error that
    /// names the target.
    void commit();

  private:
    struct Entry;
    friend void removeAtomicFilesOnSignal();
    static void removeAll(int signal);

    std::filesystem::path target_, temporary_;
    Entry* entry_ = nullptr;
};

/// Writes a file whole or not at all, as AtomicFile does. The stream throws where it fails. Throws std::runtime_error
/// that names `target` where the stream or `write` throws, other than std::bad_alloc.
void writeWhole(const std::filesystem::path& target, const std::function<void(std::ostream&)>& write);

/// For programs that write a file as their last action. After this call, SIGINT, SIGTERM and SIGHUP remove the
/// temporary files of this process before they end it, unless they are ignored. The first signal after all files were
/// committed has no effect: the program runs to its end, and its exit status reports the files as written. A library
/// must not call this.
void removeAtomicFilesOnSignal();

}  // namespace bilayer::detail
