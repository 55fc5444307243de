// SPDX-License-Identifier: Apache-2.0
#include "tools/batch/output_locks.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <stdexcept>
#include <system_error>

#include "sdf/io/content_hash.h"

namespace bilayer::tools {
namespace {

// These locks belong to the open file, which children inherit, not to the process. Returns an error, or 0.
int setLock(int file, short type, off_t at) {
    struct flock byte = {};
    byte.l_type = type;
    byte.l_whence = SEEK_SET;
    byte.l_start = at;
    byte.l_len = 1;
    int result;
    do result = ::fcntl(file, F_OFD_SETLK, &byte);
    while (result != 0 && errno == EINTR);
    return result == 0 ? 0 : errno;
}

}  // namespace

OutputLock::~OutputLock() {
    if (file_ >= 0) setLock(file_, F_UNLCK, at_);
}

OutputLocks::OutputLocks(std::filesystem::path path) : path_(std::move(path)) {
    file_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (file_ < 0) fail(errno);
}

OutputLocks::~OutputLocks() {
    ::close(file_);
}

std::optional<OutputLock> OutputLocks::take(std::string_view name) const {
    const auto at = off_t(detail::contentHash(name) >> 2);  // some file systems do not lock the last bytes
    const int error = setLock(file_, F_WRLCK, at);
    if (error == EAGAIN || error == EACCES) return std::nullopt;
    if (error != 0) fail(error);
    return OutputLock(file_, at);
}

void OutputLocks::fail(int error) const {
    throw std::runtime_error(fmt::format("cannot lock {}: {}", path_.string(), std::generic_category().message(error)));
}

}  // namespace bilayer::tools
