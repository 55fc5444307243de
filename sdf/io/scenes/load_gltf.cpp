// SPDX-License-Identifier: Apache-2.0
#define TINYGLTF_IMPLEMENTATION
#include "sdf/io/scenes/load_gltf.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "sdf/io/scenes/gltf_buffers.h"
#include "sdf/io/scenes/gltf_json.h"

namespace bilayer::detail {
namespace {

using nlohmann::json;

// Supported extensions that change the shape.
constexpr std::string_view understood[] = {"KHR_mesh_quantization", "EXT_mesh_gpu_instancing"};
// Prefixes of extensions that only concern appearance or sound, and of their vendors.
constexpr std::string_view appearanceOnly[] = {"KHR_materials_", "KHR_texture_", "EXT_texture_",
                                               "MSFT_texture_",  "KHR_lights_",  "EXT_lights_",
                                               "KHR_xmp",        "KHR_audio",    "KHR_technique"};
// Extensions that contain the geometry itself, even if they are only listed as used.
constexpr std::string_view compressions[] = {"KHR_draco_mesh_compression", "EXT_meshopt_compression",
                                             "KHR_meshopt_compression"};

template <class Names>
bool contains(const Names& names, std::string_view name) {
    return std::find(std::begin(names), std::end(names), name) != std::end(names);
}

std::vector<std::string> names(const json& file, const char* member) {
    return file.value(member, std::vector<std::string>());
}

bool isUnderstood(std::string_view name) {
    if (contains(understood, name)) return true;
    return std::any_of(std::begin(appearanceOnly), std::end(appearanceOnly),
                       [&](std::string_view beginning) { return name.substr(0, beginning.size()) == beginning; });
}

void checkRequired(const json& file) {
    for (const std::string& name : names(file, "extensionsRequired"))
        if (!isUnderstood(name))
            throw std::runtime_error(
                fmt::format("requires the glTF extension {}, which is not read; export it without", excerpt(name)));
}

// Takes the buffers out of the file and replaces each by its index, by which tinygltf requests it.
std::vector<Bytes> takeBuffers(json& file, const GltfFile& source) {
    std::vector<Bytes> buffers;
    const auto declared = file.find("buffers");
    if (declared == file.end()) return buffers;
    for (std::size_t i = 0; i < declared->size(); ++i) {
        buffers.push_back(source.buffer(*declared, i));
        (*declared)[i] = {{"byteLength", buffers.back().size()}, {"uri", fmt::format("{}", i)}};
    }
    return buffers;
}

tinygltf::FsCallbacks filesOf(std::vector<Bytes>& buffers) {
    const auto exists = [](const std::string&, void*) { return true; };
    const auto expand = [](const std::string& name, void*) { return name; };
    const auto read = [](Bytes* bytes, std::string*, const std::string& name, void* all) {
        *bytes = std::move(static_cast<std::vector<Bytes>*>(all)->at(std::stoul(name)));
        return true;
    };
    return {exists, expand, read, nullptr, &buffers};
}

std::size_t countPrimitives(const json& file) {
    std::size_t count = 0;
    if (const auto meshes = file.find("meshes"); meshes != file.end())
        for (const json& mesh : *meshes) count += mesh["primitives"].size();
    return count;
}

std::size_t countPrimitives(const tinygltf::Model& model) {
    std::size_t count = 0;
    for (const tinygltf::Mesh& mesh : model.meshes) count += mesh.primitives.size();
    return count;
}

std::string complaint(const json& file, std::string error) {
    error = error.substr(0, error.find_first_of("\n\r"));
    if (error.empty()) error = "its meshes hold something that is no primitive";
    for (const std::string& name : names(file, "extensionsUsed"))
        if (contains(compressions, name)) error += fmt::format(" (it uses {}, which is not read)", name);
    return "is not valid glTF 2: " + error;
}

}  // namespace

tinygltf::Model loadGltf(const std::filesystem::path& path) {
    const GltfFile source(path);
    json file = parseGltf(source.json());
    checkRequired(file);
    std::vector<Bytes> buffers = takeBuffers(file, source);
    const std::string text = file.dump();
    tinygltf::TinyGLTF loader;
    loader.SetFsCallbacks(filesOf(buffers));
    tinygltf::Model model;
    std::string error, warning;
    const std::string noFolder;
    const bool loaded =
        loader.LoadASCIIFromString(&model, &error, &warning, text.data(), unsigned(text.size()), noFolder);
    // it omits primitives that it cannot read
    if (!loaded || countPrimitives(model) != countPrimitives(file)) throw std::runtime_error(complaint(file, error));
    if (model.asset.version.substr(0, 2) != "2.")
        throw std::runtime_error(fmt::format("is glTF {}; only glTF 2 is read", excerpt(model.asset.version)));
    return model;
}

}  // namespace bilayer::detail
