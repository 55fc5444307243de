// SPDX-License-Identifier: Apache-2.0
#include "tools/batch/mesh_file_hash.h"

#include <exception>
#include <new>
#include <nlohmann/json.hpp>

#include "sdf/io/content_hash.h"
#include "sdf/io/gltf_buffers.h"
#include "sdf/io/input_file.h"
#include "sdf/io/mapped_file.h"

namespace bilayer::tools {
namespace {

using namespace bilayer::detail;

// Adds the buffers in files next to a .gltf file. A damaged file adds nothing: reading the mesh reports the damage.
std::uint64_t withBuffers(std::uint64_t hash, const std::filesystem::path& path) {
    try {
        const GltfFile file(path);
        const nlohmann::json scene = nlohmann::json::parse(file.json());
        const nlohmann::json& buffers = scene.at("buffers");
        for (std::size_t i = 0; i < buffers.size(); ++i) {
            const Bytes bytes = file.buffer(buffers, i);
            hash = mixedHash(hash, contentHash({reinterpret_cast<const char*>(bytes.data()), bytes.size()}));
        }
    } catch (const std::bad_alloc&) {
        throw;
    } catch (const std::exception&) {
        return hash;
    }
    return hash;
}

}  // namespace

std::uint64_t meshFileHash(const std::filesystem::path& path) {
    const std::uint64_t hash = contentHash(MappedFile(path).bytes());
    return lowerEnding(path) == ".gltf" ? withBuffers(hash, path) : hash;
}

}  // namespace bilayer::tools
