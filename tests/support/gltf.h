// SPDX-License-Identifier: Apache-2.0
// Writes small glTF files for tests.
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/vec3.hpp>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "sdf/io/polygon/polygons.h"

namespace bilayer::test {

/// The vertices of a cube of side 2 around the origin, and its outward triangles.
const std::vector<glm::vec3>& cubePoints();
const std::vector<unsigned>& cubeCorners();

/// A glTF file under construction. Members of `file` may be changed freely before it is written.
struct Gltf {
    /// componentType
    enum Type { Byte = 5120, UnsignedByte, Short, UnsignedShort, UnsignedInt = 5125, Float };

    nlohmann::json file{{"asset", {{"version", "2.0"}}}};
    std::string bin;  ///< buffer 0

    /// Appends numbers as `type` to the buffer and returns the index of their accessor.
    int accessor(const std::vector<double>& numbers, Type type, const std::string& shape);
    /// Appends numbers and returns the index of their buffer view.
    int view(const std::vector<double>& numbers, Type type);
    int points(const std::vector<glm::vec3>& points);
    int indices(const std::vector<unsigned>& indices, Type type = UnsignedShort);
    /// Appends an object to an array of the file and returns its index.
    int add(const std::string& array, const nlohmann::json& object);

    /// A cube as mesh 0, instanced by node 0 of scene 0.
    static Gltf cube();

    /// Writes the file and returns the path. The buffer is a data URI, a chunk of the file, or a separate file.
    std::filesystem::path write(const std::string& name);
    std::filesystem::path writeBinary(const std::string& name);
    std::filesystem::path writeApart(const std::string& name, const std::string& uri, const std::string& binName);
};

/// The first primitive of the first mesh.
nlohmann::json& primitive(Gltf& gltf);

/// Writes the file and reads it.
detail::Polygons readGltf(Gltf gltf);

}  // namespace bilayer::test
