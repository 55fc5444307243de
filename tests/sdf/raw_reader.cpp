// SPDX-License-Identifier: Apache-2.0
// RAW files: triangles as lines of text, and what is wrong with a line.
#include <fmt/format.h>
#include <catch2/catch.hpp>
#include <string>

#include <bilayer/sdf/mesh_io.h>
#include "tests/sdf/box_files.h"

namespace bilayer::raw_reader_test {
using namespace bilayer::test;
using Catch::Contains;

namespace {

// The box, two lines per face.
std::string rawOfBox(const std::string& before, const std::string& behind) {
    std::string text;
    for (const auto& face : boxFaces)
        for (std::size_t half = 0; half < 2; ++half) {
            text += before;
            for (const std::size_t k : {std::size_t(0), half + 1, half + 2}) {
                const glm::dvec3& p = boxPoints[std::size_t(face[k])];
                text += fmt::format("{} {} {} ", p.x, p.y, p.z);
            }
            text += behind + "\n";
        }
    return text;
}

}  // namespace

TEST_CASE("RAW: names, comments, colours and textures are ignored") {
    for (const char* before : {"", "  ", "\n\n", "box\n", "\"a box\"\n", "# 1 2 3\n", "0.1 0.2 0.3 "})
        for (const char* behind : {"", "wood.png", "3d.png", "\r", "\n# end"}) {
            CAPTURE(before, behind);
            checkBox(write("box.raw", rawOfBox(before, behind)));
        }
    const ReadReport report = readMeshFile(write("box.raw", "box\n" + rawOfBox("0.1 0.2 0.3 ", ""))).report;
    REQUIRE(report.notes.size() == 1);
    CHECK_THAT(report.notes[0], Contains("12 lines have 12 numbers") && Contains("colour; the first is line 2"));
    CHECK(readMeshFile(write("box.raw", rawOfBox("", ""))).report.notes.empty());
}

TEST_CASE("RAW: coordinates keep their doubles") {
    std::string text;
    const glm::dvec3 far(512344.7230, 5403209.7230, 249.7230);
    for (const auto& face : boxFaces)
        for (std::size_t half = 0; half < 2; ++half)
            for (const std::size_t k : {std::size_t(0), half + 1, half + 2}) {
                const glm::dvec3 p = far + boxPoints[std::size_t(face[k])];
                text += fmt::format("{:.10f} {:.10f} {:.10f}{}", p.x, p.y, p.z, k == half + 2 ? "\n" : " ");
            }
    checkBox(write("far.raw", text), far);
}

TEST_CASE("RAW: errors name the line and what is wrong in it") {
    const std::string box = rawOfBox("", "");
    const auto fails = [&](const std::string& line, const std::string& what) {
        CAPTURE(line);
        CHECK_THROWS_WITH(readMesh(write("bad.raw", box + line + "\n" + box)), Contains("bad.raw: line 13: " + what));
    };
    fails("0 0 0 1 0 0 0 1", "8 numbers, but a triangle has 9");
    fails("0 0 0 1 0 0 0 1 0 7", "10 numbers, but a triangle has 9");
    fails("0 0 0 1 0 0 0 1 0 1 0 0 1", "13 numbers, but a triangle has 9");
    fails("1", "1 number, but a triangle has 9");
    fails("0 0 0 1 x 0 0 1 0", "'x' stands where a coordinate should");
    fails("0 0 0 1,0 0 0 1 0", "'1,0' stands where a coordinate should");
    fails("0x 0 0 1 0 0 0 1 0", "'0x' stands where a coordinate should");
    fails("0 0 0 1 nan 0 0 1 0", "the coordinate 'nan' is not finite");
    fails("nan 0 0 1 0 0 0 1 0", "the coordinate 'nan' is not finite");
    fails("0 0 0 1e39 0 0 0 1 0", "the coordinate '1e39' is too large for a float");
    CHECK_THROWS_WITH(readMesh(write("none.raw", "box\n")), Contains("none.raw: holds no triangle"));
    CHECK_THROWS_WITH(readMesh(write("none.raw", "")), Contains("none.raw"));
}
}  // namespace bilayer::raw_reader_test
