// SPDX-License-Identifier: Apache-2.0
// Memory-mapped input files.
// Tested by tests/sdf/mesh_readers.cpp through readMesh().
#pragma once

#include <cstddef>
#include <filesystem>
#include <string_view>

namespace bilayer::detail {

/// A file mapped into memory for reading. If another program truncates the file meanwhile, access ends this program.
class MappedFile {
  public:
    /// When the pages of a file are read.
    enum class Paging {
        atOnce,    ///< for files that fit into memory
        onDemand,  ///< for larger files: call release() from time to time
    };

    /// Throws as requireInputFile() does, and throws std::runtime_error that names the file if it cannot be mapped.
    explicit MappedFile(const std::filesystem::path& path, Paging paging = Paging::atOnce);
    ~MappedFile();
    MappedFile(const MappedFile&) = delete;
    MappedFile& operator=(const MappedFile&) = delete;

    /// Frees the memory of all pages. They are read again where they are used again.
    void release() const;

    std::string_view bytes() const { return {data_, size_}; }

    /// Releases the memory: nothing may refer to the bytes any more.
    void unmap();

  private:
    const char* data_ = nullptr;
    std::size_t size_ = 0;
};

}  // namespace bilayer::detail
