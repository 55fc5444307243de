// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/mapped_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <stdexcept>
#include <system_error>

#include "sdf/io/input_file.h"

namespace bilayer::detail {

MappedFile::MappedFile(const std::filesystem::path& path, Paging paging) {
    requireInputFile(path);
    const auto fail = [&] {
        throw std::runtime_error(fmt::format("{}: {}", path.string(), std::generic_category().message(errno)));
    };
    const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    if (file < 0) fail();
    struct ::stat status {};
    void* data = nullptr;
    int error = ::fstat(file, &status);
    if (error == 0 && status.st_size > 0) {
        size_ = std::size_t(status.st_size);
        // map all pages at once where they fit: one page fault each would cost as much as reading them
        const int populate = paging == Paging::atOnce ? MAP_POPULATE : 0;
        data = ::mmap(nullptr, size_, PROT_READ, MAP_PRIVATE | populate, file, 0);
        if (data == MAP_FAILED) error = -1;
    }
    const int reason = errno;
    ::close(file);
    errno = reason;
    if (error != 0) fail();
    data_ = static_cast<const char*>(data);
}

void MappedFile::release() const {
    if (size_ > 0) ::madvise(const_cast<char*>(data_), size_, MADV_DONTNEED);
}

MappedFile::~MappedFile() {
    unmap();
}

void MappedFile::unmap() {
    if (size_ > 0) ::munmap(const_cast<char*>(data_), size_);
    data_ = nullptr;
    size_ = 0;
}

}  // namespace bilayer::detail
