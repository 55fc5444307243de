// SPDX-License-Identifier: Apache-2.0
// The bytes of a glTF file: its JSON and its buffers; internal.
// Tested by tests/sdf/gltf_buffers.cpp through readScene().
#pragma once

#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace bilayer::detail {

using Bytes = std::vector<unsigned char>;

/// A .gltf or .glb file, identified by its first bytes. Throws std::runtime_error, which does not name the file, if the
/// file is damaged, is not glTF 2, or cannot be read.
class GltfFile {
  public:
    explicit GltfFile(const std::filesystem::path& path);

    std::string_view json() const { return json_; }

    /// Returns the contents of a member of the JSON array "buffers": its chunk of a binary file, its data URI, or a
    /// regular file in the folder of the scene, truncated to its byteLength. `buffers` must come from parseGltf().
    /// Throws std::runtime_error that names the buffer.
    Bytes buffer(const nlohmann::json& buffers, std::size_t index) const;

  private:
    void splitChunks();

    std::filesystem::path folder_;
    Bytes bytes_;
    std::string_view json_, chunk_;
    bool isBinary_ = false;
};

}  // namespace bilayer::detail
