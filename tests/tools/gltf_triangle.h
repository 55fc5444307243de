// SPDX-License-Identifier: Apache-2.0
// A glTF file whose buffer is a file of its own.
#pragma once

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace bilayer::test {

/// Writes the scene NAME.gltf of unconnected triangles, in nodes that share them. Their corners are in NAME.bin.
inline void writeGltf(const std::filesystem::path& folder, const std::string& name, int triangles, int nodes) {
    std::string list, indices;
    for (int i = 0; i < nodes; ++i) {
        list += fmt::format("{}{{\"mesh\":0}}", i ? "," : "");
        indices += fmt::format("{}{}", i ? "," : "", i);
    }
    std::ofstream(folder / (name + ".gltf"))
        << R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[)" << indices << R"(]}],"nodes":[)" << list
        << R"(],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],)"
        << fmt::format(
               R"("buffers":[{{"uri":"{0}.bin","byteLength":{1}}}],"bufferViews":[{{"buffer":0,"byteLength":{1}}}],)",
               name, 36 * triangles)
        << fmt::format(R"("accessors":[{{"bufferView":0,"componentType":5126,"count":{},)", 3 * triangles)
        << R"("type":"VEC3","min":[0,0,0],"max":[1,1,0]}]})";
}

/// Writes the corners of one triangle.
inline void writeGltfTriangle(const std::filesystem::path& folder, const std::string& name, float height) {
    const float corners[9] = {0, 0, 0, 1, 0, 0, 0, height, 0};
    std::ofstream(folder / (name + ".bin"), std::ios::binary)
        .write(reinterpret_cast<const char*>(corners), sizeof corners);
}

}  // namespace bilayer::test
