// SPDX-License-Identifier: Apache-2.0
#include "tools/mesh_file.h"

#include <algorithm>
#include <exception>
#include <new>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "sdf/base/hash.h"
#include "sdf/io/content_hash.h"
#include "sdf/io/input_file.h"
#include "sdf/io/mapped_file.h"
#include "sdf/io/scenes/gltf_buffers.h"

namespace bilayer::tools {
namespace {

using namespace bilayer::detail;
using nlohmann::json;

/// Memory to read a mesh whole, per byte of its file, and the program without it [bytes]. The largest factor is
/// that of binary files.
constexpr double bytesPerFileByte = 6, bytesOfReader = 120e6;
/// The same for formats that are compressed, or of which an importer holds several forms. A 3MF file took 80 bytes.
constexpr double bytesPerImportedByte = 100;
/// Memory per triangle of a scene, whose nodes may share meshes [bytes]. 4 million triangles took 53, with the program.
constexpr double bytesPerSceneTriangle = 120;

bool isGltf(const std::filesystem::path& path) {
    return lowerExtension(path) == ".gltf" || lowerExtension(path) == ".glb";
}

// Calls visit(scene, buffers) for a glTF file. A damaged file ends the visit: reading the mesh reports the damage.
void visitScene(const std::filesystem::path& path, auto&& visit) {
    try {
        const GltfFile file(path);
        const json scene = json::parse(file.json());
        std::vector<Bytes> buffers;
        if (const auto found = scene.find("buffers"); found != scene.end())
            for (std::size_t i = 0; i < found->size(); ++i) buffers.push_back(file.buffer(*found, i));
        visit(scene, buffers);
    } catch (const std::bad_alloc&) {
        throw;
    } catch (const std::exception&) {
    }
}

// Returns the count of triangles of a mesh; of strips and fans about that.
double trianglesOf(const json& scene, const json& mesh) {
    double count = 0;
    for (const json& primitive : mesh.at("primitives")) {
        const json& corners =
            primitive.contains("indices") ? primitive["indices"] : primitive.at("attributes").at("POSITION");
        const bool isList = primitive.value("mode", 4) == 4;
        count += scene.at("accessors").at(corners.get<std::size_t>()).at("count").get<double>() / (isList ? 3 : 1);
    }
    return count;
}

}  // namespace

std::uint64_t meshFileHash(const std::filesystem::path& path) {
    std::uint64_t hash = contentHash(MappedFile(path).bytes());
    if (lowerExtension(path) == ".gltf")
        visitScene(path, [&](const json&, const std::vector<Bytes>& buffers) {
            for (const Bytes& bytes : buffers)
                hash = mixedHash(hash, contentHash({reinterpret_cast<const char*>(bytes.data()), bytes.size()}));
        });
    return hash;
}

double bytesToRead(const std::filesystem::path& path) {
    requireInputFile(path);
    const auto size = double(std::filesystem::file_size(path));
    double need = size * bytesPerImportedByte;
    for (const char* direct : {".obj", ".ply", ".stl", ".off", ".raw", ".gltf", ".glb"})
        if (lowerExtension(path) == direct) need = size * bytesPerFileByte;
    if (isGltf(path))
        visitScene(path, [&](const json& scene, const std::vector<Bytes>& buffers) {
            double held = 0, triangles = 0;
            for (const Bytes& bytes : buffers) held += double(bytes.size());  // in the file, or next to it
            for (const json& node : scene.at("nodes"))
                if (node.contains("mesh"))
                    triangles += trianglesOf(scene, scene.at("meshes").at(node["mesh"].get<std::size_t>()));
            need = std::max({need, held * bytesPerFileByte, triangles * bytesPerSceneTriangle});
        });
    return need + bytesOfReader;
}

}  // namespace bilayer::tools
