// SPDX-License-Identifier: Apache-2.0
// MappedFile on the heap, in place of the library's: the address sanitizer sees reads beyond the end of a file there,
// and of one that was unmapped.
#include <fstream>

#include "sdf/io/input_file.h"
#include "sdf/io/mapped_file.h"

namespace bilayer::detail {

MappedFile::MappedFile(const std::filesystem::path& path, Paging) {
    requireInputFile(path);
    size_ = std::filesystem::file_size(path);
    char* data = new char[size_];
    std::ifstream(path, std::ios::binary).read(data, std::streamsize(size_));
    data_ = data;
}

MappedFile::~MappedFile() {
    unmap();
}

void MappedFile::release() const {}

void MappedFile::unmap() {
    delete[] data_;
    data_ = nullptr;
    size_ = 0;
}

}  // namespace bilayer::detail
