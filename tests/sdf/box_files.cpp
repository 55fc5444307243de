// SPDX-License-Identifier: Apache-2.0
#include "tests/sdf/box_files.h"

#include <fmt/format.h>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <glm/geometric.hpp>

#include <bilayer/sdf/inspect.h>
#include <bilayer/sdf/mesh_io.h>
#include "tests/support/support.h"

namespace bilayer::test {

std::filesystem::path write(const std::string& name, const std::string& bytes) {
    const auto path = scratch(name);
    std::ofstream(path, std::ios::binary) << bytes;
    return path;
}

const std::vector<glm::dvec3> boxPoints{{0, 0, 0}, {1, 0, 0}, {1, 2, 0}, {0, 2, 0},
                                        {0, 0, 3}, {1, 0, 3}, {1, 2, 3}, {0, 2, 3}};
const std::vector<std::vector<int>> boxFaces{{0, 3, 2, 1}, {4, 5, 6, 7}, {0, 1, 5, 4},
                                             {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}};

void checkBox(const std::filesystem::path& path, const glm::dvec3& corner) {
    const Mesh mesh = readMesh(path);
    const MeshReport report = inspect(mesh);
    CHECK(report.triangles == 12);
    CHECK(report.points == 8);
    CHECK(report.closed());
    CHECK(report.oriented());
    CHECK(report.volume == Approx(6).epsilon(1e-6));
    CHECK(glm::distance(mesh.origin + glm::dvec3(report.bounds.lower), corner) < 1e-6);
}

std::string objOfBox(const std::string& vertex, const std::string& texture) {
    std::string text;
    for (const glm::dvec3& p : boxPoints) text += fmt::format(fmt::runtime(vertex), p.x, p.y, p.z);
    for (const auto& face : boxFaces) {
        text += "f";
        for (const int corner : face) text += fmt::format(" {}{}", corner + 1, texture);
        text += "\n";
    }
    return text;
}

std::string replaced(std::string text, const std::string& what, const std::string& by) {
    for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += by.size())
        text.replace(at, what.size(), by);
    return text;
}

std::string utf16(const std::string& text, bool little, bool mark) {
    std::string bytes = mark ? little ? "\xff\xfe" : "\xfe\xff" : "";
    for (const char c : text) bytes += little ? std::string{c, '\0'} : std::string{'\0', c};
    return bytes;
}

std::string stlOfBox(const std::string& normal) {
    std::string text;
    for (const auto& face : boxFaces)
        for (int half = 0; half < 2; ++half) {
            text += "  facet normal " + normal + "\n    outer loop\n";
            for (const int k : {0, half + 1, half + 2}) {
                const glm::dvec3& p = boxPoints[face[k]];
                text += fmt::format("      vertex {} {} {}\n", p.x, p.y, p.z);
            }
            text += "    endloop\n  endfacet\n";
        }
    return text;
}

std::string binaryStlOfBox(const std::string& header) {
    std::string bytes = header;
    bytes.resize(80, ' ');
    const auto add = [&](const auto& value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); };
    add(std::uint32_t(12));
    for (const auto& face : boxFaces)
        for (int half = 0; half < 2; ++half) {
            add(glm::vec3(0));
            for (const int k : {0, half + 1, half + 2}) add(glm::vec3(boxPoints[face[k]]));
            add(std::uint16_t(0));
        }
    return bytes;
}

namespace {

template <class Value>
void add(std::string& bytes, Value value, bool swapped) {
    char raw[sizeof(Value)];
    std::memcpy(raw, &value, sizeof value);
    if (swapped) std::reverse(raw, raw + sizeof value);
    bytes.append(raw, sizeof value);
}

void addNumber(std::string& bytes, const std::string& type, double value, const std::string& format) {
    if (format == "ascii") {
        bytes += fmt::format("{} ", value);
        return;
    }
    const bool swapped = format == "binary_big_endian";
    if (type == "char" || type == "int8") return add(bytes, std::int8_t(value), swapped);
    if (type == "uchar" || type == "uint8") return add(bytes, std::uint8_t(value), swapped);
    if (type == "short" || type == "int16") return add(bytes, std::int16_t(value), swapped);
    if (type == "ushort" || type == "uint16") return add(bytes, std::uint16_t(value), swapped);
    if (type == "int" || type == "int32") return add(bytes, std::int32_t(value), swapped);
    if (type == "uint" || type == "uint32") return add(bytes, std::uint32_t(value), swapped);
    if (type == "float" || type == "float32") return add(bytes, float(value), swapped);
    add(bytes, value, swapped);
}

}  // namespace

std::string plyOfBox(const PlyStyle& style) {
    const std::string e = style.end;
    std::string vertexHead = "element vertex 8" + e, faceHead = "element face 6" + e, vertices, faces;
    if (style.more) vertexHead += "property list uchar short tags" + e;
    for (const char* axis : {"x", "y", "z"}) {
        vertexHead += "property " + style.coordinate + " " + axis + e;
        if (style.more) vertexHead += "property uchar u" + std::string(axis) + e;
    }
    if (style.more) faceHead += "property double area" + e;
    faceHead += "property list " + style.count + " " + style.index + " vertex_indices" + e;
    if (style.more) faceHead += "property list uchar float texcoord" + e;
    const auto endRecord = [&](std::string& bytes) {
        if (style.format == "ascii") bytes += e;
    };
    for (const glm::dvec3& p : boxPoints) {
        if (style.more) {
            addNumber(vertices, "uchar", 2, style.format);
            for (const int tag : {7, -7}) addNumber(vertices, "short", tag, style.format);
        }
        for (int axis = 0; axis < 3; ++axis) {
            addNumber(vertices, style.coordinate, p[axis], style.format);
            if (style.more) addNumber(vertices, "uchar", 10, style.format);
        }
        endRecord(vertices);
    }
    for (const auto& face : boxFaces) {
        if (style.more) addNumber(faces, "double", 1.5, style.format);
        addNumber(faces, style.count, double(face.size()), style.format);
        for (const int corner : face) addNumber(faces, style.index, corner, style.format);
        if (style.more) {
            addNumber(faces, "uchar", 1, style.format);
            addNumber(faces, "float", 0.5, style.format);
        }
        endRecord(faces);
    }
    std::string head = "ply" + e + "format " + style.format + " 1.0" + e + "comment a box" + e;
    std::string other;
    if (style.more) {
        head += "element camera 1" + e + "property float fov" + e;
        addNumber(other, "float", 1, style.format);
        endRecord(other);
    }
    head += style.facesFirst ? faceHead + vertexHead : vertexHead + faceHead;
    return head + "end_header" + e + other + (style.facesFirst ? faces + vertices : vertices + faces);
}

std::string offOfBox(const std::string& keyword, const std::string& behindVertex, const std::string& behindFace,
                     const std::string& counts, const std::string& blank) {
    std::string text = keyword + "\n" + counts;
    for (const glm::dvec3& p : boxPoints)
        text += fmt::format("{}{}{}{}{}{}\n", p.x, blank, p.y, blank, p.z, behindVertex);
    for (const auto& face : boxFaces) {
        text += "4";
        for (const int corner : face) text += blank + std::to_string(corner);
        text += behindFace + "\n";
    }
    return text;
}

}  // namespace bilayer::test
