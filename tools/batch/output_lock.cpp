// SPDX-License-Identifier: Apache-2.0
#include "tools/batch/output_lock.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <stdexcept>
#include <system_error>

namespace bilayer::tools {
namespace {

[[noreturn]] void fail(const std::filesystem::path& path, int error) {
    throw std::runtime_error(fmt::format("cannot lock {}: {}", path.string(), std::generic_category().message(error)));
}

// A holder removes the file before it unlocks it. Whoever waited then has a lock on a file that nobody else sees.
bool isStillThere(const std::filesystem::path& path, int file) {
    struct stat locked, named;
    return ::fstat(file, &locked) == 0 && ::stat(path.c_str(), &named) == 0 && locked.st_ino == named.st_ino &&
           locked.st_dev == named.st_dev;
}

}  // namespace

std::optional<OutputLock> OutputLock::take(const std::filesystem::path& path) {
    for (;;) {
        const int file = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
        if (file < 0) fail(path, errno);
        const bool isLocked = ::flock(file, LOCK_EX | LOCK_NB) == 0;
        const int error = isLocked ? 0 : errno;
        if (isLocked && isStillThere(path, file)) return OutputLock(path, file);
        ::close(file);
        if (error == EWOULDBLOCK) return std::nullopt;
        if (error != 0 && error != EINTR) fail(path, error);
    }
}

// Other children may have inherited the file, so closing it would not unlock it.
OutputLock::~OutputLock() {
    if (file_ < 0) return;
    ::unlink(path_.c_str());
    ::flock(file_, LOCK_UN);
    ::close(file_);
}

}  // namespace bilayer::tools
