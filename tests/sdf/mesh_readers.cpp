// SPDX-License-Identifier: Apache-2.0
// All readers: what they leave out and report, meshes far from the origin, errors, and damaged files.
#include <fmt/format.h>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include <bilayer/sdf/inspect.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "sdf/io/polygon/polygons.h"
#include "tests/sdf/box_files.h"
#include "tests/support/support.h"

namespace bilayer::mesh_readers_test {
using namespace bilayer::test;
using Catch::Contains;

TEST_CASE("Omitted parts of a file are reported") {
    ReadReport report;
    const std::string more =
        "v 7 7 7\nf 1 2\nf 3\nf 1 1 2\nl 1 2\np 1 2 3\ncstype bspline\ncurv 0 1 1 2\nhello world\nhello\n";
    report = readMeshFile(write("more.obj", objOfBox() + more)).report;
    CHECK(report.vertices == 9);
    CHECK(report.faces == 7);
    CHECK(report.unusedVertices == 1);
    CHECK(report.collapsedTriangles == 1);
    const std::string notes = fmt::format("{}", fmt::join(report.notes, "\n"));
    CHECK_THAT(notes,
               Contains("2 faces with fewer than three corners") && Contains("2 elements that are points or lines") &&
                   Contains("2 statements of free-form") &&
                   Contains("2 lines that begin with a word that is not known; the first is 'hello' on line 23"));
    report = readMeshFile(write("more.ply", plyOfBox({.more = true}))).report;
    CHECK_THAT(fmt::format("{}", fmt::join(report.notes, "\n")), Contains("1 element 'camera'"));
    report = readMeshFile(write("more.stl", binaryStlOfBox("") + "xyz")).report;
    CHECK(report.mergedVertices == 28);
    CHECK_THAT(fmt::format("{}", fmt::join(report.notes, "\n")), Contains("3 bytes after the last triangle"));
    // more than declared
    const std::string off = offOfBox("OFF", "", "");
    for (const auto& [name, text] :
         {std::pair("more.off", replaced(off, "8 6 12", "8 5 12")), std::pair("more.off", off + "4 0 1 2 3\n"),
          std::pair("more.off", replaced(offOfBox("OFF", " 255 0 0", ""), "8 6 12", "8 5 12")),
          std::pair("more.ply", replaced(plyOfBox({}), "face 6", "face 5")),
          std::pair("more.ply", replaced(plyOfBox({.format = "binary_big_endian"}), "face 6", "face 5")),
          std::pair("more.ply", plyOfBox({.format = "binary_little_endian"}) + "x")}) {
        CAPTURE(name, text);
        report = readMeshFile(write(name, text)).report;
        CHECK_THAT(fmt::format("{}", fmt::join(report.notes, "\n")), Contains("left out") && Contains("announce"));
    }
    // a bow tie
    report = readMeshFile(write("tie.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3 4\n")).report;
    CHECK_THAT(fmt::format("{}", fmt::join(report.notes, "\n")),
               Contains("the triangles of 1 face do not cover") && Contains("area 0, the triangles 1"));
}

TEST_CASE("A mesh far from the origin keeps its shape") {
    // float coordinates would lose a box of this size entirely
    const glm::dvec3 far(512344.7230, 5403209.7230, 249.7230);
    const auto shifted = [&](const std::string& begin, const std::string& end) {
        std::string text;
        for (const glm::dvec3& p : boxPoints)
            text += fmt::format("{}{:.10f} {:.10f} {:.10f}{}", begin, far.x + p.x, far.y + p.y, far.z + p.z, end);
        return text;
    };
    const std::string obj = objOfBox(), off = offOfBox("OFF", "", "");
    std::vector<std::filesystem::path> files{
        write("far.obj", shifted("v ", "\n") + obj.substr(obj.find('f'))),
        write("far.off", "OFF\n8 6 12\n" + shifted("", "\n") + off.substr(off.find("4 0 3")))};
    std::string ply = plyOfBox({.format = "binary_little_endian", .coordinate = "double"});
    for (std::size_t i = 0; i < boxPoints.size(); ++i) {
        const glm::dvec3 p = far + boxPoints[i];
        std::memcpy(&ply[ply.find("end_header\n") + 11 + i * sizeof p], &p, sizeof p);
    }
    files.push_back(write("far.ply", ply));
    for (const auto& path : files) {
        CAPTURE(path);
        checkBox(path, far);
        // and writing it keeps the origin
        for (const std::string ending : {".obj", ".ply"}) {
            const auto again = test::scratch("again" + ending);
            writeMesh(again, readMesh(path));
            checkBox(again, far);
        }
    }
    // meshes near the origin have none
    CHECK(readMesh(write("near.obj", objOfBox("v {} {} 4{}\n"))).origin == glm::dvec3(0));
}

TEST_CASE("Coordinates lose no more than 1e-6 of the mesh's size, at any distance from the origin") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> logarithm(-1, 6), number(-1, 1);
    const std::string off = offOfBox("OFF", "", ""), faces = objOfBox().substr(objOfBox().find('f'));
    for (int i = 0; i < 300; ++i) {
        const double size = std::exp2(8 * number(random)), distance = size * std::pow(10, logarithm(random));
        const glm::dvec3 corner = distance * glm::dvec3(number(random), number(random), number(random));
        CAPTURE(i, size, distance);
        std::string obj, text = "OFF\n8 6 12\n";
        for (const glm::dvec3& p : boxPoints) {
            const glm::dvec3 q = corner + size * p;
            obj += fmt::format("v {:.17g} {:.17g} {:.17g}\n", q.x, q.y, q.z);
            text += fmt::format("{:.17g} {:.17g} {:.17g}\n", q.x, q.y, q.z);
        }
        for (const auto& path :
             {write("box.obj", obj + faces), write("box.off", text + off.substr(off.find("4 0 3")))}) {
            const Mesh mesh = readMesh(path);
            REQUIRE(mesh.points.size() == boxPoints.size());
            for (std::size_t k = 0; k < boxPoints.size(); ++k) {
                const glm::dvec3 read = mesh.origin + glm::dvec3(mesh.points[k]);
                const glm::dvec3 error = glm::abs(read - (corner + size * boxPoints[k]));
                CHECK(std::max({error.x, error.y, error.z}) <= 1e-6 * 3 * size);
            }
            // two roundings of 3e-6 sizes for sides of 1, 2 and 3 sizes
            const double error = mesh.origin == glm::dvec3(0) ? 6e-6 * (1 + 1 / 2.0 + 1 / 3.0) : 1e-6;
            CHECK(inspect(mesh).volume == Approx(6 * size * size * size).epsilon(error));
            if (distance < 10 * size) CHECK(mesh.origin == glm::dvec3(0));
        }
    }
}

TEST_CASE("A polygon with a vertex that is not finite is refused before it is triangulated") {
    for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()})
        for (const std::size_t place : {0u, 3u, 4u}) {
            detail::Polygons polygons{
                {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {1, 1, 0}, {0, 2, 0}}, {0, 1, 2, 3, 4}, {5}, {}};
            polygons.points[place].y = bad;
            ReadReport report;
            CAPTURE(bad, place);
            CHECK_THROWS_WITH(detail::assembled(polygons, "a.lwo", report),
                              Contains("a.lwo: face 0, counted from 0, uses vertex " + std::to_string(place) +
                                       ", which is not finite: ("));
        }
}

TEST_CASE("Coordinates that the importer rounds by more than 1e-6 of the mesh's size are reported") {
    const auto notes = [](double size, double shift, double nodeShift) {
        std::string points;
        for (const glm::dvec3& p : {glm::dvec3(0), glm::dvec3(1, 0, 0), glm::dvec3(0, 1, 0), glm::dvec3(0, 0, 1)})
            points += fmt::format("{} {} {} ", shift + size * p.x, size * p.y, size * p.z);
        const std::string dae = fmt::format(
            "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">"
            "<library_geometries><geometry id=\"g\"><mesh><source id=\"p\"><float_array id=\"a\" count=\"12\">{}"
            "</float_array><technique_common><accessor source=\"#a\" count=\"4\" stride=\"3\">"
            "<param name=\"X\" type=\"float\"/><param name=\"Y\" type=\"float\"/><param name=\"Z\" type=\"float\"/>"
            "</accessor></technique_common></source><vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/>"
            "</vertices><triangles count=\"4\"><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/>"
            "<p>0 2 1 0 1 3 1 2 3 2 0 3</p></triangles></mesh></geometry></library_geometries><library_visual_scenes>"
            "<visual_scene id=\"s\"><node><matrix>1 0 0 {} 0 1 0 0 0 0 1 0 0 0 0 1</matrix>"
            "<instance_geometry url=\"#g\"/></node></visual_scene></library_visual_scenes>"
            "<scene><instance_visual_scene url=\"#s\"/></scene></COLLADA>",
            points, nodeShift);
        return fmt::format("{}", fmt::join(readMeshFile(write("far.dae", dae)).report.notes, "\n"));
    };
    CHECK(notes(1, 0, 0).empty());
    CHECK(notes(1, 8, 0).empty());
    CHECK(notes(100, 1000, 0).empty());
    CHECK_THAT(notes(1, 20, 0), Contains("single precision") && Contains("21 m from zero"));
    CHECK_THAT(notes(0.01, 90, 0), Contains("90.01 m from zero by up to 5.4e-06 m"));
    CHECK(notes(1, 0, 1000).empty());  // moved by its node
}

TEST_CASE("Errors of readers name the file, the position, the text there, and what is expected") {
    const auto obj = objOfBox();
    const auto fails = [](const std::string& name, const std::string& text, const std::string& what) {
        CAPTURE(name);
        CHECK_THROWS_WITH(readMesh(write(name, text)), Contains(name) && Contains(what));
    };
    fails("a.obj", obj + "f 1 2 99\n", "line 15: a face refers to vertex 99, but the file has 8 vertices");
    fails("b.obj", obj + "f 1 2 -9\n", "line 15: a face refers to vertex -9, but only 8 come before it");
    fails("c.obj", obj + "f 1 2 0\n", "line 15: a face refers to vertex 0");
    fails("d.obj", obj + "f 1 2 x3\n", "line 15: 'x3' stands where the number of a vertex should");
    fails("e.obj", obj + "v 1 2\n", "line 15: the end of the line stands where a coordinate should");
    fails("f.obj", obj + "v 1 2 3.4.5\n", "line 15: '3.4.5' stands where a coordinate should");
    fails("g.obj", obj + "v 1 2 inf\n", "line 15: the coordinate 'inf' is not finite");
    fails("k.obj", obj + "v 1 2 1e39\n", "line 15: the coordinate '1e39' is too large for a float");
    fails("l.obj", "V 0 0 0\nF 1 2 3\n",
          "holds no triangle; left out: 2 lines that begin with a word that is not known");
    fails("h.obj", obj + "v 1 2 " + std::string(100, 'y') + "\n", "'" + std::string(40, 'y') + "...'");
    fails("i.obj", replaced(obj, "\n", "\r\n") + "f 1 2 99\n", "line 15:");
    fails("j.obj", "v 0 0 0\n", "holds no triangle");
    fails("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n", "line 6: a face refers to vertex 7, but there are 3");
    fails("b.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\nthree 0 1 2\n", "line 6: 'three' stands where");
    fails("c.off", "OFF\n3 many\n", "line 2: 'many' stands where the number of faces should");
    fails("d.off", "OFF BINARY\n", "binary OFF is not read");
    fails("e.off", "OFF\n999999999 5 0\n0 0 0\n",
          "line 4: the file ends after 1 of the 999999999 vertices that it announces");
    fails("f.off", "v 0 0 0\n", "stands where 'OFF' should");
    fails("a.ply", "ply\nformat ascii 2\n", "has no end_header");
    fails("b.ply", replaced(plyOfBox({}), "property float y\n", ""), "no property 'y'");
    fails("c.ply", replaced(plyOfBox({}), "float x", "real x"), "line 5: 'real' stands where a type");
    fails("d.ply", replaced(plyOfBox({}), "\n4 0 3 2 1", "\n4 0 3 2 11"), "face 0 refers to vertex 11");
    fails("e.ply", replaced(plyOfBox({}), "\n4 0 3 2 1", "\n4 0 3 2 x"), "'x' stands where an integer should");
    fails("f.ply", replaced(plyOfBox({}), "element vertex 8", "element vertex 888888888888"),
          "line 19: '2' stands where the end of the line should");
    fails("h.ply", replaced(plyOfBox({}), "\n1 2 3 \n", "\n1 2 3 7 \n"), "'7' stands where the end of the line should");
    fails("i.ply", replaced(plyOfBox({}), "\n1 2 3 \n", "\n1 nan 3 \n"),
          "vertex 6: its y is nan, which is no finite float");
    fails("j.ply", replaced(plyOfBox({}), "element face", "element " + std::string(99, 'z')), "holds no triangle");
    fails("g.ply", replaced(plyOfBox({}), "vertex_indices", "corners"), "no list 'vertex_indices'");
    fails("a.stl", "solid\n" + replaced(stlOfBox(), "vertex 1 2 3", "vertex 1 2 z"),
          "'z' stands where a coordinate should");
    fails("b.stl", "solid\n" + stlOfBox(), "ends before its 'endsolid'");
    fails("c.stl",
          "solid\n" + stlOfBox() + "facet normal 0 0 0\nouter loop\nvertex 0 0 0\nendloop\nendfacet\nendsolid\n",
          "a facet has 1 vertices");
    fails("d.stl", binaryStlOfBox("").substr(0, 300),
          "after 300 bytes: of the 12 triangles that it announces there are 4");
    std::string infinite = binaryStlOfBox("");
    const float inf = std::numeric_limits<float>::infinity();
    std::memcpy(&infinite[84 + 7 * 50 + 12 + 20], &inf, sizeof inf);
    fails("f.stl", infinite, "triangle 7, counted from 0, has the coordinate inf, which is not finite");
    fails("g.stl", "", "has 0 bytes");
    checkBox(write("comment.stl", "# drawn by hand\nsolid\n# facets\n" + stlOfBox() + "endsolid\n# end\n"));
    fails("e.stl", "hello", "'hello' stands where 'facet'");
}

TEST_CASE("Errors do not depend on the parts that a file is read in") {
    // two faults in different parts: the first one is reported, whichever thread is faster
    std::string text;
    for (int i = 0; i < 200000; ++i) text += "v 1.5 2.5 3.5\n";
    const std::string twice = text + "v 1 2 x\n" + text + text + "v 1 y 3\n" + text;
    for (int go = 0; go < 5; ++go) CHECK_THROWS_WITH(readMesh(write("twice.obj", twice)), Contains("line 200001: 'x'"));
}

TEST_CASE("Damaged files are read or rejected") {
    const unsigned start = test::seed();
    CAPTURE(start);
    std::mt19937 random(start);
    std::vector<std::pair<std::string, std::string>> files{{".obj", objOfBox()},
                                                           {".stl", binaryStlOfBox("box")},
                                                           {".stl", "solid box\n" + stlOfBox() + "endsolid box\n"},
                                                           {".off", offOfBox("OFF", "", "")},
                                                           {".off", offOfBox("COFF", " 1 0 0 1", " 1 0 0")}};
    for (const char* format : {"ascii", "binary_little_endian", "binary_big_endian"})
        for (const bool more : {false, true}) files.emplace_back(".ply", plyOfBox({.format = format, .more = more}));
    const std::string words[] = {"-1",
                                 "4294967295",
                                 "1e999",
                                 "nan",
                                 "-",
                                 "99999999999999999999",
                                 "\\\n",
                                 "\n",
                                 "\r",
                                 "#",
                                 "/",
                                 "facet",
                                 "endsolid",
                                 "vertex",
                                 "end_header\n",
                                 "element face 3\n",
                                 std::string(1, '\0'),
                                 "\xff\xfe"};
    int read = 0, refused = 0;
    for (int i = 0; i < 20000; ++i) {
        const auto& [ending, whole] = files[random() % files.size()];
        std::string bytes = whole;
        for (unsigned faults = 1 + random() % 3; faults > 0; --faults) {
            const std::size_t at = random() % bytes.size();
            switch (random() % 5) {
                case 0:
                    bytes[at] = char(random());
                    break;
                case 1:
                    bytes.erase(at, 1 + random() % 20);
                    break;
                case 2:
                    bytes.insert(at, words[random() % std::size(words)]);
                    break;
                case 3:
                    bytes.insert(at, bytes.substr(random() % bytes.size(), random() % 30));
                    break;
                default:
                    bytes[at] = char(bytes[at] ^ (1 << random() % 8));
            }
            if (bytes.empty()) bytes = whole;
        }
        const auto path = write("damaged" + ending, bytes);
        CAPTURE(i, ending);
        try {
            const Mesh mesh = readMesh(path);
            CHECK_NOTHROW(validate(mesh));
            ++read;
        } catch (const std::exception& error) {
            CHECK_THAT(error.what(), Contains(path.filename().string()));
            ++refused;
        }
    }
    CHECK(read > 1000);
    CHECK(refused > 1000);
}
}  // namespace bilayer::mesh_readers_test
