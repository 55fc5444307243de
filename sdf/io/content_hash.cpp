// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/content_hash.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "sdf/base/hash.h"
#include "sdf/io/mapped_file.h"

namespace bilayer::detail {
namespace {

constexpr std::uint64_t fnvStart = 0xcbf29ce484222325u;
constexpr std::size_t partOfFile = 1 << 26;  // that is in memory at once [bytes]

// Spreads the last words over all bits, so that a remainder of the hash is evenly distributed.
std::uint64_t spreadBits(std::uint64_t hash) {
    constexpr std::uint64_t oddFactor = 0x9e3779b97f4a7c15u;  // 2^64 / golden ratio
    hash = (hash ^ (hash >> 29)) * oddFactor;
    return hash ^ (hash >> 32);
}

std::string hexDigits(std::uint64_t hash) {
    return fmt::format("{:016x}", hash);
}

}  // namespace

std::uint64_t contentHash(std::string_view bytes) {
    std::uint64_t hash = mixedHash(fnvStart, bytes.size());
    while (!bytes.empty()) {
        std::uint64_t word = 0;
        const std::size_t count = std::min(bytes.size(), sizeof word);
        std::memcpy(&word, bytes.data(), count);
        hash = mixedHash(hash, word);
        bytes.remove_prefix(count);
    }
    return spreadBits(hash);
}

std::string fileHash(const std::filesystem::path& path) {
    const MappedFile file(path, MappedFile::Paging::onDemand);
    std::string hashes = std::to_string(file.bytes().size());
    for (std::size_t at = 0; at < file.bytes().size(); at += partOfFile) {
        hashes += hexDigits(contentHash(file.bytes().substr(at, partOfFile)));
        file.release();
    }
    return hexDigits(contentHash(hashes));
}

}  // namespace bilayer::detail
