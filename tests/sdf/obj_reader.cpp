// SPDX-License-Identifier: Apache-2.0
// OBJ files: every valid way to write them.
#include <fmt/format.h>
#include <catch2/catch.hpp>
#include <cstring>

#include <bilayer/sdf/inspect.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "tests/sdf/box_files.h"

namespace bilayer::obj_reader_test {
using namespace bilayer::test;

TEST_CASE("OBJ: vertices may have three to eight numbers, in any way that numbers are written") {
    for (const char* vertex :
         {"v {} {} {}\n", "v {} {} {} 1\n", "v {} {} {} 0.1 0.2 0.3\n", "v {} {} {} 1 0.1 0.2 0.3\n",
          "v {} {} {} 1 0.1 0.2 0.3 1\n", "v\t{}\t{}\t{}\t\n", "  v   {}  {} {}  \n", "v {}. {}.0 +{}\n",
          "v {}e0 {}E+00 {}.e-0\n", "v {} {} {} # corner\n", "v {} {} {}\r\n", "v {} {} {} nan nan nan\n",
          "v \\\n {} {} \\\r\n {}\n", "v {} \\ \n{}\\\t \r\n {}\\  \r\r\n", "\xef\xbb\xbfv {} {} {}\n"}) {
        CAPTURE(vertex);
        checkBox(write("box.obj", objOfBox(vertex)));
    }
    const std::string halves = replaced(objOfBox(), "v 1 ", "v .5 ");
    CHECK(inspect(readMesh(write("halves.obj", halves))).volume == Approx(3));
    CHECK(inspect(readMesh(write("halves.obj", replaced(halves, "v .5 ", "v 5.e-1 ")))).volume == Approx(3));
}

TEST_CASE("OBJ: texture and normal indices are ignored") {
    for (const char* texture : {"/1", "//1", "/1/1", "/999/-999", "/", "//", "/x/y"}) {
        CAPTURE(texture);
        checkBox(write("textured.obj", objOfBox("v {} {} {}\n", texture)));
    }
}

TEST_CASE("OBJ: lines and files may be written in any way") {
    const std::string text = objOfBox();
    checkBox(write("crlf.obj", replaced(text, "\n", "\r\n")));
    checkBox(write("cr.obj", replaced(text, "\n", "\r")));
    checkBox(write("blank.obj", replaced(text, "\n", "\n\n  \n")));
    checkBox(write("mark.obj", "\xef\xbb\xbf" + text));
    checkBox(write("marks.obj", "\xef\xbb\xbf" + replaced(text, "\n", "\n\xef\xbb\xbf")));
    for (const bool little : {false, true})
        for (const bool mark : {false, true}) checkBox(write("wide.obj", utf16(text, little, mark)));
    checkBox(write("end.obj", text.substr(0, text.size() - 1)));
    for (const char* continuation : {"\\\n", "\\ \n", "\\\t \t\r\n", "\\ \r"}) {
        CAPTURE(continuation);
        checkBox(write("joined.obj", replaced(text, " 4 ", fmt::format(" {}4 ", continuation))));
        checkBox(write("joined.obj", replaced(text, " ", continuation)));
        checkBox(write("joined.obj", replaced(text, " ", fmt::format("{} ", continuation))));
    }
    CHECK_THROWS_WITH(readMesh(write("slash.obj", text + "f 1 2 \\ 3\n")), Catch::Contains("line 15: '\\'"));
    // parts of a long text end between statements
    std::string longer = text;
    while (longer.size() < (1 << 19)) longer += "v 1 \\ \n 2 \\  \n 3\nf 1 2 \\ \n -1\n";
    CHECK(readMeshFile(write("long.obj", longer)).report.notes.empty());
    checkBox(write("named.obj", "# drawn with c:\\\nmtllib c:\\\no box\ng a b\ns off\nusemtl x\\\n" + text));
    // faces first
    const std::size_t faces = text.find('f');
    checkBox(write("faces.obj", text.substr(faces) + text.substr(0, faces)));
}

TEST_CASE("OBJ: relative indices count back from where they stand, in files of any length") {
    // more vertices than one part of the text holds
    const Mesh mesh = shapes::sphere(1, 6);
    std::string near, far = "v 9 9 9\n";
    for (const glm::uvec3& t : mesh.triangles) {
        for (int k = 0; k < 3; ++k) {
            const glm::vec3& p = mesh.points[t[k]];
            near += fmt::format("v {} {} {}\n", p.x, p.y, p.z);
        }
        near += "f -3 -2 -1\n";
    }
    for (const glm::vec3& p : mesh.points) far += fmt::format("v {} {} {}\n", p.x, p.y, p.z);
    const auto last = std::ptrdiff_t(mesh.points.size());
    for (const glm::uvec3& t : mesh.triangles)
        far += fmt::format("f {} {} {}\n", std::ptrdiff_t(t.x) - last, std::ptrdiff_t(t.y) - last, t.z + 2);
    for (const std::string& text : {near, far}) {
        const MeshReport report = inspect(readMesh(write("relative.obj", text)));
        CHECK(report.triangles == mesh.triangles.size());
        CHECK(report.points == mesh.points.size());
        CHECK(report.closed());
        CHECK(report.volume == Approx(inspect(mesh).volume));
    }
}
}  // namespace bilayer::obj_reader_test
