// The project's own readers: every valid variant of their formats, and invalid files.
#include <fmt/format.h>
#include <catch2/catch.hpp>
#include <cstring>
#include <fstream>
#include <limits>
#include <random>

#include <bilayer/sdf/inspect.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "tests/support/support.h"

using namespace bilayer;
using Catch::Contains;

namespace {

std::filesystem::path write(const std::string& name, const std::string& bytes) {
    const auto path = test::scratch(name);
    std::ofstream(path, std::ios::binary) << bytes;
    return path;
}

// A box from 0 to 1, 2 and 3, as quadrilaterals.
const std::vector<glm::dvec3> boxPoints{{0, 0, 0}, {1, 0, 0}, {1, 2, 0}, {0, 2, 0},
                                        {0, 0, 3}, {1, 0, 3}, {1, 2, 3}, {0, 2, 3}};
const std::vector<std::vector<int>> boxFaces{{0, 3, 2, 1}, {4, 5, 6, 7}, {0, 1, 5, 4},
                                             {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}};

void checkBox(const std::filesystem::path& path, const glm::dvec3& corner = glm::dvec3(0)) {
    const Mesh mesh = readMesh(path);
    const MeshReport report = inspect(mesh);
    CHECK(report.triangles == 12);
    CHECK(report.points == 8);
    CHECK(report.closed());
    CHECK(report.oriented());
    CHECK(report.volume == Approx(6).epsilon(1e-6));
    CHECK(glm::distance(mesh.origin + glm::dvec3(report.bounds.lower), corner) < 1e-6);
}

std::string objOfBox(const std::string& vertex = "v {} {} {}\n", const std::string& texture = "") {
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

// The box as the triangles of text STL.
std::string stlOfBox(const std::string& normal = "0 0 0") {
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

struct PlyStyle {
    std::string format = "ascii", coordinate = "float", count = "uchar", index = "int", end = "\n";
    bool facesFirst = false, more = false;
};

// With `more`, unused properties and elements stand before, between and after the used ones.
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
                     const std::string& counts = "8 6 12\n", const std::string& blank = " ") {
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

}  // namespace

TEST_CASE("OBJ: vertices may have three to eight numbers, in any way that numbers are written") {
    for (const char* vertex :
         {"v {} {} {}\n", "v {} {} {} 1\n", "v {} {} {} 0.1 0.2 0.3\n", "v {} {} {} 1 0.1 0.2 0.3\n",
          "v {} {} {} 1 0.1 0.2 0.3 1\n", "v\t{}\t{}\t{}\t\n", "  v   {}  {} {}  \n", "v {}. {}.0 +{}\n",
          "v {}e0 {}E+00 {}.e-0\n", "v {} {} {} # corner\n", "v {} {} {}\r\n", "v {} {} {} nan nan nan\n",
          "v \\\n {} {} \\\r\n {}\n", "\xef\xbb\xbfv {} {} {}\n"}) {
        CAPTURE(vertex);
        checkBox(write("box.obj", objOfBox(vertex)));
    }
    const std::string halves = replaced(objOfBox(), "v 1 ", "v .5 ");
    CHECK(inspect(readMesh(write("halves.obj", halves))).volume == Approx(3));
    CHECK(inspect(readMesh(write("halves.obj", replaced(halves, "v .5 ", "v 5.e-1 ")))).volume == Approx(3));
}

TEST_CASE("OBJ: texture and normal indices are not looked at") {
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
    checkBox(write("joined.obj", replaced(text, " 4 ", " \\\n4 ")));
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

TEST_CASE("What of a file is left out is told") {
    ReadReport report;
    const std::string more =
        "v 7 7 7\nf 1 2\nf 3\nf 1 1 2\nl 1 2\np 1 2 3\ncstype bspline\ncurv 0 1 1 2\nhello world\nhello\n";
    readMesh(write("more.obj", objOfBox() + more), &report);
    CHECK(report.vertices == 9);
    CHECK(report.faces == 7);
    CHECK(report.unusedVertices == 1);
    CHECK(report.collapsedTriangles == 1);
    const std::string notes = fmt::format("{}", fmt::join(report.notes, "\n"));
    CHECK_THAT(notes,
               Contains("2 faces with fewer than three corners") && Contains("2 elements that are points or lines") &&
                   Contains("2 statements of free-form") &&
                   Contains("2 lines that begin with a word that is not known; the first is 'hello' on line 23"));
    readMesh(write("more.ply", plyOfBox({.more = true})), &report);
    CHECK_THAT(fmt::format("{}", fmt::join(report.notes, "\n")), Contains("1 element 'camera'"));
    readMesh(write("more.stl", binaryStlOfBox("") + "xyz"), &report);
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
        readMesh(write(name, text), &report);
        CHECK_THAT(fmt::format("{}", fmt::join(report.notes, "\n")), Contains("left out") && Contains("announce"));
    }
    // a bow tie
    readMesh(write("tie.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3 4\n"), &report);
    CHECK_THAT(fmt::format("{}", fmt::join(report.notes, "\n")), Contains("the triangles of 1 face do not cover"));
}

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

TEST_CASE("STL: size and contents tell text from binary") {
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

TEST_CASE("A mesh far from the zero point keeps its shape") {
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
    CHECK(readMesh(write("near.obj", objOfBox("v {} {} 100{}\n"))).origin == glm::dvec3(0));
}

TEST_CASE("Errors of readers name the file, the place, what stands there, and what would be right") {
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
    fails("e.off", "OFF\n999999999 5 0\n0 0 0\n", "the file ends before them");
    fails("f.off", "v 0 0 0\n", "stands where 'OFF' should");
    fails("a.ply", "ply\nformat ascii 2\n", "has no end_header");
    fails("b.ply", replaced(plyOfBox({}), "property float y\n", ""), "no property 'y'");
    fails("c.ply", replaced(plyOfBox({}), "float x", "real x"), "line 5: 'real' stands where a type");
    fails("d.ply", replaced(plyOfBox({}), "\n4 0 3 2 1", "\n4 0 3 2 11"), "face 0 refers to vertex 11");
    fails("e.ply", replaced(plyOfBox({}), "\n4 0 3 2 1", "\n4 0 3 2 x"), "'x' stands where an integer should");
    fails("f.ply", replaced(plyOfBox({}), "element vertex 8", "element vertex 888888888888"), "ends before all");
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
    fails("d.stl", binaryStlOfBox("").substr(0, 300), "of the 12 triangles that it announces there are 4");
    std::string infinite = binaryStlOfBox("");
    const float inf = std::numeric_limits<float>::infinity();
    std::memcpy(&infinite[84 + 7 * 50 + 12 + 20], &inf, sizeof inf);
    fails("f.stl", infinite, "triangle 7, counted from 0, has the coordinate inf, which is not finite");
    fails("g.stl", "", "has 0 bytes");
    checkBox(write("comment.stl", "# drawn by hand\nsolid\n# facets\n" + stlOfBox() + "endsolid\n# end\n"));
    fails("e.stl", "hello", "'hello' stands where 'facet'");
}

TEST_CASE("The parts that a file is read in make no difference to errors") {
    // two faults in different parts: the first one is reported, whichever thread is faster
    std::string text;
    for (int i = 0; i < 200000; ++i) text += "v 1.5 2.5 3.5\n";
    const std::string twice = text + "v 1 2 x\n" + text + text + "v 1 y 3\n" + text;
    for (int go = 0; go < 5; ++go) CHECK_THROWS_WITH(readMesh(write("twice.obj", twice)), Contains("line 200001: 'x'"));
}

TEST_CASE("Damaged files are read or refused") {
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
