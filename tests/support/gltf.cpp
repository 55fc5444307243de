// SPDX-License-Identifier: Apache-2.0
#include "tests/support/gltf.h"

#include <cstring>
#include <fstream>

#include "sdf/io/scenes/scene_io.h"
#include "tests/support/support.h"

namespace bilayer::test {
namespace {

std::string base64(const std::string& bytes) {
    const char* digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        unsigned three = 0;
        for (std::size_t k = 0; k < 3; ++k)
            three = three << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
        for (std::size_t k = 0; k < 4; ++k) text += i + k > bytes.size() ? '=' : digits[three >> (18 - 6 * k) & 63];
    }
    return text;
}

template <class T>
void append(std::string& bytes, double number) {
    const T value = T(number);
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

void append(std::string& bytes, double number, Gltf::Type type) {
    switch (type) {
        case Gltf::Byte:
            return append<std::int8_t>(bytes, number);
        case Gltf::UnsignedByte:
            return append<std::uint8_t>(bytes, number);
        case Gltf::Short:
            return append<std::int16_t>(bytes, number);
        case Gltf::UnsignedShort:
            return append<std::uint16_t>(bytes, number);
        case Gltf::UnsignedInt:
            return append<std::uint32_t>(bytes, number);
        case Gltf::Float:
            return append<float>(bytes, number);
    }
}

std::filesystem::path writeBytes(const std::string& name, const std::string& bytes) {
    const std::filesystem::path path = scratch(name);
    std::ofstream(path, std::ios::binary) << bytes;
    return path;
}

std::string chunk(std::string bytes, const char* type, char filler) {
    bytes.resize((bytes.size() + 3) / 4 * 4, filler);
    std::string head;
    append<std::uint32_t>(head, double(bytes.size()));
    return head + std::string(type, 4) + bytes;
}

}  // namespace

const std::vector<glm::vec3>& cubePoints() {
    static const std::vector<glm::vec3> points{{-1, -1, -1}, {1, -1, -1}, {-1, 1, -1}, {1, 1, -1},
                                               {-1, -1, 1},  {1, -1, 1},  {-1, 1, 1},  {1, 1, 1}};
    return points;
}

const std::vector<unsigned>& cubeCorners() {
    static const std::vector<unsigned> corners{0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                                               2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
    return corners;
}

int Gltf::add(const std::string& array, const nlohmann::json& object) {
    file[array].push_back(object);
    return int(file[array].size()) - 1;
}

int Gltf::view(const std::vector<double>& numbers, Type type) {
    bin.resize((bin.size() + 3) / 4 * 4, '\0');
    const std::size_t first = bin.size();
    for (const double number : numbers) append(bin, number, type);
    return add("bufferViews", {{"buffer", 0}, {"byteOffset", first}, {"byteLength", bin.size() - first}});
}

int Gltf::accessor(const std::vector<double>& numbers, Type type, const std::string& shape) {
    const std::size_t components = shape == "SCALAR" ? 1 : shape == "VEC3" ? 3 : shape == "VEC4" ? 4 : 16;
    return add("accessors", {{"bufferView", view(numbers, type)},
                             {"componentType", int(type)},
                             {"count", numbers.size() / components},
                             {"type", shape}});
}

int Gltf::points(const std::vector<glm::vec3>& points) {
    std::vector<double> numbers;
    for (const glm::vec3& p : points) numbers.insert(numbers.end(), {p.x, p.y, p.z});
    return accessor(numbers, Float, "VEC3");
}

int Gltf::indices(const std::vector<unsigned>& indices, Type type) {
    return accessor({indices.begin(), indices.end()}, type, "SCALAR");
}

Gltf Gltf::cube() {
    Gltf gltf;
    const int points = gltf.points(cubePoints()), corners = gltf.indices(cubeCorners());
    gltf.add("meshes", {{"primitives", {{{"attributes", {{"POSITION", points}}}, {"indices", corners}}}}});
    gltf.add("nodes", {{"mesh", 0}});
    gltf.add("scenes", {{"nodes", {0}}});
    return gltf;
}

std::filesystem::path Gltf::write(const std::string& name) {
    file["buffers"] = {{{"byteLength", bin.size()}, {"uri", "data:application/octet-stream;base64," + base64(bin)}}};
    return writeBytes(name, file.dump());
}

std::filesystem::path Gltf::writeBinary(const std::string& name) {
    file["buffers"] = {{{"byteLength", bin.size()}}};
    const std::string chunks = chunk(file.dump(), "JSON", ' ') + chunk(bin, "BIN\0", '\0');
    std::string head = "glTF";
    append<std::uint32_t>(head, 2);
    append<std::uint32_t>(head, double(12 + chunks.size()));
    return writeBytes(name, head + chunks);
}

std::filesystem::path Gltf::writeApart(const std::string& name, const std::string& uri, const std::string& binName) {
    file["buffers"] = {{{"byteLength", bin.size()}, {"uri", uri}}};
    if (!binName.empty()) writeBytes(binName, bin + "padding");
    return writeBytes(name, file.dump());
}

nlohmann::json& primitive(Gltf& gltf) {
    return gltf.file["meshes"][0]["primitives"][0];
}

detail::Polygons readGltf(Gltf gltf) {
    return detail::readScene(gltf.write("test.gltf"));
}

}  // namespace bilayer::test
