// Files that appear whole or not at all.
#pragma once

#include <filesystem>

namespace bilayer::detail {

/// A file that is written under another name beside its target and takes the target's place in commit(). Without
/// commit() the destructor removes it, and whatever stood at the target stays as it was. A target that is a symbolic
/// link is followed; an existing target hands its permissions on.
class AtomicFile {
  public:
    /// Creates the empty temporary file. Throws std::runtime_error that names `target` when its folder cannot be
    /// written to, or when `target` exists and is no regular file.
    explicit AtomicFile(const std::filesystem::path& target);
    ~AtomicFile();
    AtomicFile(const AtomicFile&) = delete;
    AtomicFile& operator=(const AtomicFile&) = delete;

    /// Write here: in the folder of the target, so that commit() is one step of the file system.
    const std::filesystem::path& temporary() const { return temporary_; }

    /// Puts the temporary file, which must be complete and closed, in the target's place.
    /// Throws std::runtime_error that names the target.
    void commit();

  private:
    struct Entry;
    friend void removeAtomicFilesOnSignal();
    static void removeAll(int signal);

    std::filesystem::path target_, temporary_;
    Entry* entry_ = nullptr;
};

/// For programs that write a file as their last act: SIGINT, SIGTERM and SIGHUP from now on remove the temporary files
/// of this process before they end it, unless they are ignored. The first that comes when all files have taken their
/// places comes too late: the program goes on to its end, and its status says that they are there. A library must not
/// call this.
void removeAtomicFilesOnSignal();

}  // namespace bilayer::detail
