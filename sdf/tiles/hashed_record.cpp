// SPDX-License-Identifier: Apache-2.0
#include "sdf/tiles/hashed_record.h"

#include <fmt/format.h>

#include <fstream>
#include <stdexcept>

#include "sdf/io/atomic_file.h"
#include "sdf/io/content_hash.h"
#include "sdf/io/input_file.h"

namespace bilayer::detail {

void HashedRecordWriter::write(const std::filesystem::path& path) const {
    const std::uint64_t hash = contentHash(bytes_);
    writeWhole(path, [&](std::ostream& stream) {
        stream.write(bytes_.data(), std::streamsize(bytes_.size()));
        stream.write(reinterpret_cast<const char*>(&hash), sizeof hash);
    });
}

HashedRecordReader::HashedRecordReader(const std::filesystem::path& path) : path_(path) {
    requireInputFile(path);
    std::uint64_t hash = 0;
    const std::uintmax_t size = std::filesystem::file_size(path);
    if (size < sizeof hash) fail();
    bytes_.resize(std::size_t(size) - sizeof hash);
    std::ifstream stream(path, std::ios::binary);
    stream.read(bytes_.data(), std::streamsize(bytes_.size()));
    stream.read(reinterpret_cast<char*>(&hash), sizeof hash);
    if (!stream || hash != contentHash(bytes_)) fail();
}

void HashedRecordReader::fail() const {
    throw std::runtime_error(fmt::format("{}: is damaged: repeat the command, which writes it again", path_.string()));
}

}  // namespace bilayer::detail
