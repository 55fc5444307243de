// SPDX-License-Identifier: Apache-2.0
// OFF files: every valid way to write them.
#include <catch2/catch.hpp>

#include <bilayer/sdf/mesh_io.h>
#include "box_files.h"

using namespace bilayer;
using namespace bilayer::test;

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
    checkBox(write("glued.off", replaced(offOfBox("OFF", "", ""), "OFF\n", "OFF")));
}
