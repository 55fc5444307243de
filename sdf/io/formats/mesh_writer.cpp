// SPDX-License-Identifier: Apache-2.0
// Writes meshes as OBJ, STL and PLY files.
// Tested by tests/sdf/mesh_io.cpp through writeMesh().
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <glm/geometric.hpp>
#include <iterator>
#include <ostream>
#include <stdexcept>
#include <string>
#include <vector>

#include <bilayer/sdf/mesh_io.h>
#include "sdf/base/parallel_parts.h"
#include "sdf/io/atomic_file.h"
#include "sdf/io/input_file.h"

namespace bilayer::detail {
namespace {

constexpr std::size_t partItems = 1 << 14;  // vertices or triangles per task

template <class Value>
void append(std::string& bytes, const Value& value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

bool isFar(const Mesh& mesh) {
    return mesh.origin != glm::dvec3(0);
}

glm::dvec3 inWorld(const Mesh& mesh, std::size_t point) {
    return mesh.origin + glm::dvec3(mesh.points[point]);
}

/// Formats items as text or bytes, in parallel. Returns the bytes of each part, in order.
/// @param write  write(std::size_t item, std::string& bytes) appends an item
template <class Write>
std::vector<std::string> formatItems(std::size_t items, Write write) {
    std::vector<std::string> parts((items + partItems - 1) / partItems);
    inParallel(parts.size(), [&](std::size_t part) {
        for (std::size_t i = part * partItems; i < std::min((part + 1) * partItems, items); ++i) write(i, parts[part]);
    });
    return parts;
}

/// The bytes of one section of a file, in parts.
using FileSection = std::vector<std::string>;

std::vector<FileSection> objOf(const Mesh& mesh) {
    const auto text = [](std::string& bytes) { return std::back_inserter(bytes); };
    return {formatItems(mesh.points.size(),
                        [&](std::size_t i, std::string& bytes) {
                            const glm::dvec3 p = inWorld(mesh, i);
                            const glm::vec3& q = mesh.points[i];
                            if (isFar(mesh))
                                fmt::format_to(text(bytes), "v {} {} {}\n", p.x, p.y, p.z);
                            else
                                fmt::format_to(text(bytes), "v {} {} {}\n", q.x, q.y, q.z);
                        }),
            formatItems(mesh.triangles.size(), [&](std::size_t i, std::string& bytes) {
                const glm::uvec3 t = mesh.triangles[i] + 1u;
                fmt::format_to(text(bytes), "f {} {} {}\n", t.x, t.y, t.z);
            })};
}

std::vector<FileSection> plyOf(const Mesh& mesh) {
    const char* type = isFar(mesh) ? "double" : "float";
    const std::string header = fmt::format(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty {} x\nproperty {} y\nproperty {} z\n"
        "element face {}\nproperty list uchar uint vertex_indices\nend_header\n",
        mesh.points.size(), type, type, type, mesh.triangles.size());
    return {{header},
            formatItems(mesh.points.size(),
                        [&](std::size_t i, std::string& bytes) {
                            if (isFar(mesh))
                                append(bytes, inWorld(mesh, i));
                            else
                                append(bytes, mesh.points[i]);
                        }),
            formatItems(mesh.triangles.size(), [&](std::size_t i, std::string& bytes) {
                bytes.push_back(3);
                append(bytes, mesh.triangles[i]);
            })};
}

std::vector<FileSection> stlOf(const Mesh& mesh) {
    std::string header("binary STL");
    header.resize(80, ' ');
    append(header, std::uint32_t(mesh.triangles.size()));
    return {{header}, formatItems(mesh.triangles.size(), [&](std::size_t i, std::string& bytes) {
                const glm::uvec3& t = mesh.triangles[i];
                const std::array<glm::vec3, 3> p{glm::vec3(inWorld(mesh, t.x)), glm::vec3(inWorld(mesh, t.y)),
                                                 glm::vec3(inWorld(mesh, t.z))};
                const glm::dvec3 area =
                    glm::cross(glm::dvec3(p[1]) - glm::dvec3(p[0]), glm::dvec3(p[2]) - glm::dvec3(p[0]));
                const double length = glm::length(area);
                append(bytes, length > 0 ? glm::vec3(area / length) : glm::vec3(0));
                append(bytes, p);
                append(bytes, std::uint16_t(0));
            })};
}

std::vector<FileSection> contentsOf(const Mesh& mesh, const std::filesystem::path& path) {
    const std::string extension = lowerExtension(path);
    if (extension == ".obj") return objOf(mesh);
    if (extension == ".ply") return plyOf(mesh);
    if (extension == ".stl") return stlOf(mesh);
    throw std::invalid_argument(fmt::format("{}: meshes are written as .obj, .ply or .stl", path.string()));
}

}  // namespace

}  // namespace bilayer::detail

namespace bilayer {

using namespace detail;

void writeMesh(const std::filesystem::path& path, const Mesh& mesh) {
    validate(mesh);
    const std::vector<FileSection> contents = contentsOf(mesh, path);
    writeWhole(path, [&](std::ostream& stream) {
        for (const FileSection& section : contents)
            for (const std::string& part : section) stream.write(part.data(), std::streamsize(part.size()));
    });
}

}  // namespace bilayer
