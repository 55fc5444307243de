// SPDX-License-Identifier: Apache-2.0
#include "tools/batch/content_hash.h"

#include <algorithm>
#include <cstring>
#include <exception>
#include <new>
#include <nlohmann/json.hpp>

#include "sdf/io/gltf_buffers.h"
#include "sdf/io/input_file.h"
#include "sdf/io/mapped_file.h"

namespace bilayer::tools {
namespace {

using namespace bilayer::detail;

constexpr std::uint64_t fnvStart = 0xcbf29ce484222325u, fnvPrime = 0x100000001b3u;

// An FNV-1a step on 64 bits, with the high bits folded down.
std::uint64_t mixed(std::uint64_t hash, std::uint64_t word) {
    const std::uint64_t product = (hash ^ word) * fnvPrime;
    return product ^ (product >> 32);
}

// Spreads the last words over all bits, so that a remainder of the hash is evenly distributed.
std::uint64_t spread(std::uint64_t hash) {
    constexpr std::uint64_t oddFactor = 0x9e3779b97f4a7c15u;  // 2^64 / golden ratio
    hash = (hash ^ (hash >> 29)) * oddFactor;
    return hash ^ (hash >> 32);
}

// Adds the buffers in files next to a .gltf file. A damaged file adds nothing: reading the mesh reports the damage.
std::uint64_t withBuffers(std::uint64_t hash, const std::filesystem::path& path) {
    try {
        const GltfFile file(path);
        const nlohmann::json scene = nlohmann::json::parse(file.json());
        const nlohmann::json& buffers = scene.at("buffers");
        for (std::size_t i = 0; i < buffers.size(); ++i) {
            const Bytes bytes = file.buffer(buffers, i);
            hash = mixed(hash, contentHash({reinterpret_cast<const char*>(bytes.data()), bytes.size()}));
        }
    } catch (const std::bad_alloc&) {
        throw;
    } catch (const std::exception&) {
        return hash;
    }
    return hash;
}

}  // namespace

std::uint64_t contentHash(std::string_view bytes) {
    std::uint64_t hash = mixed(fnvStart, bytes.size());
    while (!bytes.empty()) {
        std::uint64_t word = 0;
        const std::size_t count = std::min(bytes.size(), sizeof word);
        std::memcpy(&word, bytes.data(), count);
        hash = mixed(hash, word);
        bytes.remove_prefix(count);
    }
    return spread(hash);
}

std::uint64_t meshFileHash(const std::filesystem::path& path) {
    const std::uint64_t hash = contentHash(MappedFile(path).bytes());
    return lowerEnding(path) == ".gltf" ? withBuffers(hash, path) : hash;
}

}  // namespace bilayer::tools
