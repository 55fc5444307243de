// SPDX-License-Identifier: Apache-2.0
// OFF files: every valid way to write them.
#include <fmt/format.h>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstring>

#include <bilayer/sdf/mesh_io.h>
#include "tests/sdf/box_files.h"

namespace bilayer::off_reader_test {
using namespace bilayer::test;
using Catch::Contains;

TEST_CASE("OFF: words, not lines, with colours or without") {
    for (const auto& [keyword, vertex] :
         {std::pair("OFF", ""), std::pair("COFF", " 0.1 0.2 0.3 1"), std::pair("NOFF", " 0 0 1"),
          std::pair("CNOFF", " 0 0 1 255 0 0 255"), std::pair("STOFF", " 0.5 0.5"), std::pair("OFF", " 255 0 0")})
        for (const char* face : {"", " 255 0 0", " 0.1 0.2 0.3 0.4", " # red", " 7"})
            for (const char* counts : {"8 6 12\n", "8 6\n", "8\n6\n", "8 6 0 # counts\n\n"}) {
                CAPTURE(keyword, vertex, face, counts);
                checkBox(write("box.off", offOfBox(keyword, vertex, face, counts)));
            }
    checkBox(write("joined.off", offOfBox("OFF", "", "", "8 6 12\n", "\n")));
    checkBox(write("comments.off", "# a box\n" + replaced(offOfBox("OFF", "", ""), "\n", " # x\n\n")));
    checkBox(write("crlf.off", replaced(offOfBox("OFF", "", ""), "\n", "\r\n")));
    checkBox(write("oneline.off", replaced(offOfBox("OFF", "", ""), "\n", " ")));
    // several vertices on a line, or one over several; colours of faces end with the line
    for (const auto& [keyword, vertex] :
         {std::pair("OFF", ""), std::pair("COFF", " 0.1 0.2 0.3 1"), std::pair("COFF", " 255 0 0"),
          std::pair("NOFF", " 0 0 1"), std::pair("CNOFF", " 0 0 1 255 0 0 255"), std::pair("STOFF", " 0.5 0.5")})
        for (const char* face : {"", " 255 0 0", " 0.1 0.2 0.3 0.4"})
            for (const char* counts : {"8 6 12\n", "8 6\n", "8\n6\n12\n", "8\n6\n"})
                for (const unsigned period : {2u, 4u, 6u, 7u, 8u, 1000u}) {
                    CAPTURE(keyword, vertex, face, counts, period);
                    std::string text = offOfBox(keyword, vertex, face, counts);
                    const std::size_t begin = text.find(counts) + std::strlen(counts), end = text.find("4 0 3");
                    unsigned word = 0;
                    for (std::size_t i = begin; i + 1 < end; ++i)
                        if (text[i] == ' ' || text[i] == '\n') text[i] = ++word % period == 0 ? '\n' : ' ';
                    CAPTURE(text);
                    checkBox(write("words.off", text));
                }
    checkBox(write("glued.off", replaced(offOfBox("OFF", "", ""), "OFF\n", "OFF")));
}

TEST_CASE("OFF: an error at the end of the file says where, and how much is there") {
    for (const auto& [keyword, vertex] : {std::pair("OFF", ""), std::pair("COFF", " 0.1 0.2 0.3 1")}) {
        const std::string whole = offOfBox(keyword, vertex, " 1 0 0");
        for (std::size_t size = whole.find("12\n") + 3; size < whole.rfind("\n4 "); ++size) {
            CAPTURE(keyword, size);
            const std::string text = whole.substr(0, size);
            CHECK_THROWS_WITH(readMesh(write("short.off", text)),
                              Contains(fmt::format("short.off: line {}: the file ends after ",
                                                   1 + std::count(text.begin(), text.end(), '\n'))) &&
                                  (Contains(" of the 8 vertices that it announces") ||
                                   Contains(" of the 6 faces that it announces")));
        }
    }
}
}  // namespace bilayer::off_reader_test
