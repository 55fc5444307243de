// SPDX-License-Identifier: Apache-2.0
// PLY files: every valid way to write them.
#include <catch2/catch.hpp>
#include <cstring>

#include <bilayer/sdf/mesh_io.h>
#include "box_files.h"

using namespace bilayer;
using namespace bilayer::test;

TEST_CASE("PLY: any format, types, order of elements, line ends, and data between") {
    for (const char* format : {"ascii", "binary_little_endian", "binary_big_endian"})
        for (const char* coordinate : {"float", "double", "float32", "float64", "int", "short", "uchar", "int8"})
            for (const auto& [count, index] :
                 {std::pair("uchar", "int"), std::pair("int", "uint"), std::pair("uint8", "int32"),
                  std::pair("ushort", "short"), std::pair("uint32", "uchar"), std::pair("char", "int8")})
                for (const char* end : {"\n", "\r\n", "\r"})
                    for (const bool facesFirst : {false, true})
                        for (const bool more : {false, true}) {
                            CAPTURE(format, coordinate, count, index, end, facesFirst, more);
                            checkBox(
                                write("box.ply", plyOfBox({format, coordinate, count, index, end, facesFirst, more})));
                        }
}

TEST_CASE("PLY: data may begin with any byte, also with one that ends lines") {
    for (const char* end : {"\n", "\r\n", "\r"})
        for (int first = 0; first < 256; ++first) {
            CAPTURE(end, first);
            std::string bytes = plyOfBox({.format = "binary_little_endian", .end = end});
            const std::size_t data = bytes.find("end_header") + 10 + std::strlen(end);
            bytes[data] = char(first);  // the lowest digits of the first coordinate
            float expected = 0;
            std::memcpy(&expected, &bytes[data], sizeof expected);
            const Mesh mesh = readMesh(write("first.ply", bytes));
            CHECK(mesh.triangles.size() == 12);
            CHECK(mesh.points[0].x == expected);
        }
}

TEST_CASE("PLY: strips of triangles are read, with breaks") {
    const std::string head =
        "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n"
        "element tristrips 1\nproperty list int int vertex_indices\nend_header\n";
    const std::string points = "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n1 2 0\n";
    const auto area = [&](const std::string& strips) {
        const Mesh mesh = readMesh(write("strips.ply", head + points + strips));
        double z = 0;
        for (const glm::uvec3& t : mesh.triangles)
            z += 0.5 * glm::cross(mesh.points[t.y] - mesh.points[t.x], mesh.points[t.z] - mesh.points[t.x]).z;
        return z;
    };
    CHECK(area("6 0 1 2 3 4 5\n") == Approx(2));
    CHECK(area("9 0 1 2 3 -1 2 3 4 5\n") == Approx(2));
    CHECK(area("8 0 1 2 -1 -1 2 3 4\n") == Approx(1));
}
