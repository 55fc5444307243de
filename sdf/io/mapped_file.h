// The bytes of a file, where the system has them.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string_view>

namespace bilayer::detail {

/// A file mapped into memory for reading. Another program that cuts the file off meanwhile ends this one.
class MappedFile {
  public:
    /// Throws as requireInputFile() does, and std::runtime_error that names the file where it cannot be mapped.
    explicit MappedFile(const std::filesystem::path& path);
    ~MappedFile();
    MappedFile(const MappedFile&) = delete;
    MappedFile& operator=(const MappedFile&) = delete;

    std::string_view bytes() const { return {data_, size_}; }

  private:
    const char* data_ = nullptr;
    std::size_t size_ = 0;
};

}  // namespace bilayer::detail
