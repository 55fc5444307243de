// SPDX-License-Identifier: Apache-2.0
// STL files, text and binary: every valid way to write them.
#include <catch2/catch.hpp>
#include <cstring>

#include <bilayer/sdf/mesh_io.h>
#include "tests/sdf/box_files.h"

namespace bilayer::stl_reader_test {
using namespace bilayer::test;

TEST_CASE("STL: size and contents distinguish text from binary") {
    for (const char* header : {"", "solid", "solid box", "SOLID facet normal", "COLOR=abcd", "facet"})
        for (const std::string tail : {"", "\n", "abc"}) {
            CAPTURE(header, tail);
            checkBox(write("binary.stl", binaryStlOfBox(header) + tail));
        }
    const std::string facets = stlOfBox();
    for (const std::string& name :
         {std::string(), std::string("box"), std::string("endsolid facet normal vertex outer loop"),
          std::string(5000, 'x'), std::string("two words")})
        for (const std::string before : {"", "\n\n", "\t \r\n", "\xef\xbb\xbf"})
            for (const std::string after : {"", "\n", "\n\n  ", "\n\x1a", "\nthe end\n"}) {
                CAPTURE(name, before, after);
                checkBox(write("text.stl", before + "solid " + name + "\n" + facets + "endsolid " + name + after));
            }
}

TEST_CASE("STL: keywords, normals and lines may be written in any way") {
    const std::string text = "solid box\n" + stlOfBox() + "endsolid box\n";
    std::string upper = text;
    for (char& c : upper) c = char(std::toupper(static_cast<unsigned char>(c)));
    checkBox(write("upper.stl", upper));
    checkBox(write("crlf.stl", replaced(text, "\n", "\r\n")));
    checkBox(write("cr.stl", replaced(text, "\n", "\r")));
    checkBox(write("tabs.stl", replaced(text, " ", "\t")));
    checkBox(write("lines.stl", "solid box\n" + replaced(stlOfBox(), " ", "\n") + "endsolid\n"));
    checkBox(write("oneline.stl", "solid box\n" + replaced(stlOfBox(), "\n", " ") + "\nendsolid\n"));
    checkBox(write("wide.stl", utf16(text, true, true)));
    for (const char* normal : {"nan nan nan", "-nan(ind) -nan(ind) -nan(ind)", "1.#QNAN 0 0", "1,0 0 0", "", "0 0"}) {
        CAPTURE(normal);
        checkBox(write("normals.stl", "solid\n" + stlOfBox(normal) + "endsolid\n"));
    }
    // several solids
    const std::string facets = stlOfBox();
    const std::size_t half = facets.find("  facet", facets.size() / 2);
    checkBox(write("two.stl", "solid a\n" + facets.substr(0, half) + "endsolid a\n\nsolid b\n" + facets.substr(half) +
                                  "endsolid\n"));
}
}  // namespace bilayer::stl_reader_test
