// SPDX-License-Identifier: Apache-2.0
// PLY files: every valid way to write them.
#include <fmt/format.h>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstring>
#include <limits>
#include <random>
#include <utility>

#include <bilayer/sdf/mesh_io.h>
#include "tests/sdf/box_files.h"
#include "tests/support/support.h"

namespace bilayer::ply_reader_test {
using namespace bilayer::test;
using Catch::Contains;
using namespace std::string_literals;

TEST_CASE("PLY: any format, types, order of elements, line ends, and data between") {
    for (const char* format : {"ascii", "binary_little_endian", "binary_big_endian"})
        for (const char* coordinate : {"float", "double", "float32", "float64", "int", "short", "uchar", "int8"})
            for (const auto& [count, index] :
                 {std::pair("float", "double"), std::pair("double", "float"), std::pair("uchar", "int"),
                  std::pair("int", "uint"), std::pair("uint8", "int32"), std::pair("ushort", "short"),
                  std::pair("uint32", "uchar"), std::pair("char", "int8")})
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

TEST_CASE("PLY: reals in lists are whole numbers") {
    for (const char* format : {"ascii", "binary_little_endian", "binary_big_endian"})
        for (const char* bad : {"0.5", "nan", "1e300"}) {
            CAPTURE(format, bad);
            // the count of the first face, and its first corner
            std::string counts = plyOfBox({.format = format, .count = "double"}), corners = counts;
            corners = plyOfBox({.format = format, .index = "double"});
            if (format == std::string("ascii")) {
                counts = replaced(counts, "\n4 0 3 2 1", fmt::format("\n{} 0 3 2 1", bad));
                corners = replaced(corners, "\n4 0 3 2 1", fmt::format("\n4 {} 3 2 1", bad));
            } else {
                double value = std::stod(bad);
                if (format == std::string("binary_big_endian"))
                    std::reverse(reinterpret_cast<char*>(&value), reinterpret_cast<char*>(&value + 1));
                const std::size_t faces = 8 * 3 * sizeof(float) + 11;
                std::memcpy(&counts[counts.find("end_header\n") + faces], &value, sizeof value);
                std::memcpy(&corners[corners.find("end_header\n") + faces + 1], &value, sizeof value);
            }
            for (const std::string& text : {counts, corners})
                CHECK_THROWS_WITH(readMesh(write("real.ply", text)),
                                  Contains("real.ply: ") && Contains("face 0: its list 'vertex_indices' has ") &&
                                      Contains("where a whole number should stand"));
        }
}

TEST_CASE("PLY: an error in binary data names the byte of the value") {
    for (const char* format : {"binary_little_endian", "binary_big_endian"})
        for (const bool more : {false, true})
            for (const auto& [face, corner] : {std::pair(0, 0), std::pair(0, 3), std::pair(5, 2)}) {
                CAPTURE(format, more, face, corner);
                std::string bytes = plyOfBox({.format = format, .more = more});
                // before the corners of a face: the other element, the vertices, the faces, the area, and the count
                const int before = more ? 4 + 8 * 20 + face * 30 + 9 : 8 * 12 + face * 17 + 1;
                const std::size_t at = bytes.find("end_header\n") + 11 + std::size_t(before + corner * 4);
                const bool isLittle = format[7] == 'l';
                bytes.replace(at, 4, isLittle ? std::string("c\0\0\0", 4) : std::string("\0\0\0c", 4));
                CHECK_THROWS_WITH(readMesh(write("index.ply", bytes)),
                                  Contains(fmt::format(
                                      "index.ply: byte {}: face {} refers to vertex 99, but there are 8", at, face)));
            }
    std::string bytes = plyOfBox({.format = "binary_little_endian"});
    const float bad = std::numeric_limits<float>::infinity();
    const std::size_t at = bytes.find("end_header\n") + 11 + 3 * 12 + 4;
    std::memcpy(&bytes[at], &bad, sizeof bad);
    CHECK_THROWS_WITH(readMesh(write("infinite.ply", bytes)),
                      Contains(fmt::format("infinite.ply: byte {}: vertex 3: its y is inf", at)));
}

TEST_CASE("PLY: errors quote names of elements and lists on one line, shortened") {
    for (const char* format : {"ascii", "binary_little_endian", "binary_big_endian"})
        for (const std::string& name : {std::string("\x1b[31mparts"), std::string(5000, 'a')})
            for (const bool isReal : {false, true}) {
                CAPTURE(format, name.size(), isReal);
                const bool isText = format == std::string("ascii");
                const std::string header = fmt::format(
                    "ply\nformat {} 1.0\nelement vertex 1\nproperty uchar x\nproperty uchar y\nproperty uchar z\n"
                    "element {} 1\nproperty list {} uchar {}\nelement face 1\nproperty list uchar uchar "
                    "vertex_indices\n"
                    "end_header\n",
                    format, name, isReal ? "float" : "char", name);
                // one vertex, and a list of -1 or of not a number of items
                const std::string nan = format[7] == 'l' ? std::string("\0\0\xc0\x7f", 4) : "\x7f\xc0\0\0"s;
                const std::string data = isText
                                             ? "0 0 0\n"s + (isReal ? "nan" : "-1") + "\n"
                                             : std::string(3, '\0') + (isReal ? nan : "\xff"s) + std::string(9, '\0');
                try {
                    readMesh(write("names.ply", header + data));
                    FAIL("read");
                } catch (const std::exception& error) {
                    const std::string text = error.what();
                    CAPTURE(text);
                    CHECK_THAT(text, Contains("its list"));
                    CHECK(text.size() < 300);
                    CHECK(std::all_of(text.begin(), text.end(), [](char c) { return c >= ' ' && c <= '~'; }));
                }
            }
}

TEST_CASE("PLY: words of a text may stand on any lines") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (const bool facesFirst : {false, true})
        for (const bool more : {false, true})
            for (int i = 0; i < 50; ++i) {
                std::string text = plyOfBox({.facesFirst = facesFirst, .more = more});
                for (std::size_t k = text.find("end_header\n") + 11; k < text.size(); ++k)
                    if (text[k] == ' ' || text[k] == '\n') text[k] = random() % 5 ? ' ' : '\n';
                CAPTURE(text);
                checkBox(write("words.ply", text));
            }
    // a number more on each line of vertices is an error, not the first coordinate of the next one
    CHECK_THROWS_WITH(readMesh(write("more.ply", replaced(plyOfBox({}), "3 \n", "3 9 \n"))),
                      Contains("'9' stands where the end of the line should"));
}

TEST_CASE("PLY: an error at the end of the file says where, and how much is there") {
    for (const char* format : {"ascii", "binary_little_endian", "binary_big_endian"})
        for (const bool more : {false, true})
            for (const bool facesFirst : {false, true}) {
                const bool isText = format == std::string("ascii");
                const std::string whole = plyOfBox({.format = format, .facesFirst = facesFirst, .more = more});
                const std::size_t data = whole.find("end_header\n") + 11;
                for (std::size_t size = data; size + 1 < whole.size() - (isText ? 5 : 0); size += 7) {
                    const std::string text = whole.substr(0, size);
                    CAPTURE(format, more, facesFirst, size);
                    const auto place = isText ? fmt::format("line {}: ", 1 + std::count(text.begin(), text.end(), '\n'))
                                              : fmt::format("byte {}: ", size);
                    CHECK_THROWS_WITH(readMesh(write("short.ply", text)),
                                      Contains("short.ply: " + place + "the file ends after ") &&
                                          (Contains(" of the 8 elements 'vertex' that its header announces") ||
                                           Contains(" of the 6 elements 'face' that its header announces") ||
                                           Contains(" of the 1 elements 'camera' that its header announces")));
                }
            }
    const std::string ply = plyOfBox({.format = "binary_little_endian"});
    const std::size_t data = ply.find("end_header\n") + 11;
    CHECK_THROWS_WITH(readMesh(write("short.ply", ply.substr(0, data + 5 * 12 + 3))), Contains("after 5 of the 8"));
    CHECK_THROWS_WITH(readMesh(write("short.ply", ply.substr(0, data + 8 * 12 + 2 * 17))),
                      Contains("after 2 of the 6"));
    CHECK_THROWS_WITH(readMesh(write("short.ply", replaced(ply, "vertex 8", "vertex 888888888888"))),
                      Contains("of the 888888888888 elements 'vertex'"));
    const std::string text = plyOfBox({});
    CHECK_THROWS_WITH(readMesh(write("short.ply", replaced(text, "face 6", "face 7"))), Contains("after 6 of the 7"));
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
}  // namespace bilayer::ply_reader_test
