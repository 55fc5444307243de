// SPDX-License-Identifier: Apache-2.0
#include "tools/batch/mesh_list.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <iostream>
#include <stdexcept>
#include <string_view>
#include <system_error>

#include "sdf/io/input_file.h"

namespace bilayer::tools {
namespace {

namespace fs = std::filesystem;

// Formats with meshes in use. Other formats that readMesh() supports can be listed by name.
constexpr std::array<std::string_view, 10> meshExtensions{".obj", ".ply", ".stl", ".off", ".gltf",
                                                          ".glb", ".3mf", ".dae", ".fbx", ".3ds"};

bool isMesh(const fs::directory_entry& entry) {
    const std::string extension = detail::lowerExtension(entry.path());
    std::error_code ignored;  // of a link that leads nowhere: reading it reports why
    return std::find(meshExtensions.begin(), meshExtensions.end(), extension) != meshExtensions.end() &&
           !entry.is_directory(ignored);
}

std::string meshName(const fs::path& file) {
    const fs::path normal = file.lexically_normal();
    const bool isInside = normal.is_relative() && !normal.empty() && *normal.begin() != "..";
    return isInside ? normal.generic_string() : fs::absolute(file).lexically_normal().relative_path().generic_string();
}

std::vector<fs::path> linesOf(std::istream& stream) {
    std::vector<fs::path> paths;
    for (std::string line; std::getline(stream, line);) {
        if (!line.empty() && line.back() == '\r') line.pop_back();
        if (!line.empty()) paths.emplace_back(line);
    }
    return paths;
}

}  // namespace

std::vector<BatchMesh> meshesInTree(const fs::path& folder) {
    std::vector<BatchMesh> meshes;
    // an iterator over all levels does not report which folder it cannot read
    std::vector<fs::path> folders{folder};
    while (!folders.empty()) {
        const fs::path current = std::move(folders.back());
        folders.pop_back();
        std::error_code error;
        for (fs::directory_iterator entry(current, error), end; !error && entry != end; entry.increment(error)) {
            std::error_code ignored;
            if (entry->is_directory(ignored) && !entry->is_symlink(ignored))
                folders.push_back(entry->path());
            else if (isMesh(*entry))
                meshes.push_back({entry->path(), entry->path().lexically_relative(folder).generic_string()});
        }
        if (error) throw std::runtime_error(fmt::format("{}: {}", current.string(), error.message()));
    }
    return meshes;
}

std::vector<fs::path> pathsInList(const fs::path& list) {
    if (list == "-") return linesOf(std::cin);
    detail::requireInputFile(list);
    std::ifstream stream(list);
    std::vector<fs::path> paths = linesOf(stream);
    if (stream.bad()) throw std::runtime_error(list.string() + ": cannot be read to its end");
    return paths;
}

std::vector<BatchMesh> meshesOf(const std::vector<fs::path>& files) {
    std::vector<BatchMesh> meshes;
    for (const fs::path& file : files) meshes.push_back({file, meshName(file)});
    return meshes;
}

std::vector<BatchMesh> shardOf(std::vector<BatchMesh> meshes, const Shard& shard) {
    std::erase_if(meshes, [&](const BatchMesh& mesh) { return !shard.contains(mesh.name); });
    std::sort(meshes.begin(), meshes.end(), [](const BatchMesh& a, const BatchMesh& b) { return a.name < b.name; });
    const auto isSame = [](const BatchMesh& a, const BatchMesh& b) { return a.name == b.name; };
    for (auto at = meshes.begin(); (at = std::adjacent_find(at, meshes.end(), isSame)) != meshes.end(); ++at)
        if (fs::absolute(at->file).lexically_normal() != fs::absolute((at + 1)->file).lexically_normal())
            throw std::runtime_error(
                fmt::format("{} and {} would have the same output", at->file.string(), (at + 1)->file.string()));
    meshes.erase(std::unique(meshes.begin(), meshes.end(), isSame), meshes.end());
    return meshes;
}

}  // namespace bilayer::tools
