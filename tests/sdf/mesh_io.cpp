// SPDX-License-Identifier: Apache-2.0
#include <bilayer/sdf/mesh_io.h>

#include <fmt/format.h>
#include <catch2/catch.hpp>
#include <fstream>
#include <iterator>

#include <bilayer/sdf/inspect.h>
#include "demos/shared/shapes.h"
#include "tests/support/support.h"

namespace bilayer::mesh_io_test {
namespace {

std::filesystem::path write(const std::string& name, const std::string& text) {
    const auto path = test::scratch(name);
    std::ofstream(path, std::ios::binary) << text;
    return path;
}

}  // namespace

TEST_CASE("a written mesh is read back the same") {
    const Mesh mesh = shapes::torus(1.f, 0.3f, 24, 12);
    for (const std::string ending : {".obj", ".ply", ".stl"}) {
        CAPTURE(ending);
        const auto path = test::scratch("torus" + ending);
        writeMesh(path, mesh);
        const Mesh back = readMesh(path);
        REQUIRE(back.triangles.size() == mesh.triangles.size());
        CHECK(back.points.size() == mesh.points.size());
        const MeshReport report = inspect(back);
        CHECK(report.closed());
        CHECK(report.oriented());
        CHECK(report.volume == Approx(inspect(mesh).volume).epsilon(1e-5));
    }
    CHECK_THROWS_AS(writeMesh(test::scratch("torus.xyz"), mesh), std::invalid_argument);
    CHECK_THROWS_WITH(writeMesh("/nonexistent/torus.ply", mesh), Catch::Contains("/nonexistent/torus.ply"));
}

TEST_CASE("polygons, negative indices and node transforms are understood") {
    const Mesh obj = readMesh(write("quad.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf -4 -3 -2 -1\n"));
    CHECK(obj.triangles.size() == 2);
    CHECK(obj.points.size() == 4);
    const std::string gltf = R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
      "nodes":[{"mesh":0,"translation":[10,0,0]}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
      "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}],
      "bufferViews":[{"buffer":0,"byteLength":36}],
      "buffers":[{"byteLength":36,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]})";
    const Mesh moved = readMesh(write("triangle.gltf", gltf));
    REQUIRE(moved.triangles.size() == 1);
    CHECK(bounds(moved).lower == glm::vec3(10, 0, 0));
    CHECK(bounds(moved).upper == glm::vec3(11, 1, 0));
}

TEST_CASE("OFF files may hold comments and empty lines anywhere") {
    const Mesh mesh = readMesh(write("comments.off",
                                     "OFF 4 4 6 # counts\n\n0 0 0\n1 0 0 # x\n\n0 1 0\n0 0 1\n# faces\n"
                                     "3 0 2 1\n\n3 0 1 3\n3 0 3 2\n\n3 1 2 3\n"));
    CHECK(mesh.triangles.size() == 4);
    CHECK(inspect(mesh).closed());
}

TEST_CASE("unreadable files give an error that names them") {
    CHECK_THROWS_WITH(readMesh("/nonexistent.obj"),
                      Catch::Contains("/nonexistent.obj") && Catch::Contains("no such file"));
    CHECK_THROWS_WITH(readMesh("/dev"), Catch::Contains("/dev: not a regular file"));
    for (const auto& [name, text] : {std::pair("empty.obj", ""), std::pair("noise.ply", "ply\nnot a ply"),
                                     std::pair("points.obj", "v 0 0 0\nv 1 0 0\n"), std::pair("text.stl", "hello"),
                                     std::pair("flat.obj", "v 0 0 0\nv 1 0 0\nv 0 0 0\nf 1 2 3\n")}) {
        CAPTURE(name);
        CHECK_THROWS_WITH(readMesh(write(name, text)), Catch::Contains(name));
    }
    CHECK_THROWS_WITH(readMesh(write("nan.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")), Catch::Contains("nan.obj"));
}

TEST_CASE("files that end early are refused, wherever they end") {
    const Mesh mesh = shapes::sphere(1, 3);
    std::vector<std::filesystem::path> whole;
    for (const std::string ending : {".ply", ".stl"}) {
        whole.push_back(test::scratch("whole" + ending));
        writeMesh(whole.back(), mesh);
    }
    std::string off = fmt::format("OFF\n{} {} 0\n", mesh.points.size(), mesh.triangles.size());
    std::string ascii = fmt::format(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nelement face "
        "{}\n"
        "property list uchar int vertex_indices\nend_header\n",
        mesh.points.size(), mesh.triangles.size());
    std::string stl = "solid sphere\n";
    for (const auto& p : mesh.points) off += fmt::format("{} {} {}\n", p.x, p.y, p.z);
    for (const auto& p : mesh.points) ascii += fmt::format("{} {} {}\n", p.x, p.y, p.z);
    for (const auto& t : mesh.triangles) {
        off += fmt::format("3 {} {} {}\n", t.x, t.y, t.z);
        ascii += fmt::format("3 {} {} {}\n", t.x, t.y, t.z);
        stl += "facet normal 0 0 0\nouter loop\n";
        for (int k = 0; k < 3; ++k) {
            const glm::vec3 p = mesh.points[t[k]];
            stl += fmt::format("vertex {} {} {}\n", p.x, p.y, p.z);
        }
        stl += "endloop\nendfacet\n";
    }
    whole.push_back(write("whole.off", off));
    whole.push_back(write("ascii.ply", ascii));
    whole.push_back(write("ascii.stl", stl + "endsolid sphere\n"));
    for (const char* name : {"brain.ply", "bunny_zipper.ply", "cgal-knot2.off", "screwdriver_7k.off", "busted.STL"})
        if (const auto path = test::corpusMesh(name)) whole.push_back(*path);
    for (const auto& path : whole) {
        CAPTURE(path);
        const std::string bytes = test::contentsOf(path);
        CHECK_NOTHROW(readMesh(path));
        for (const double part : {0.0, 0.01, 0.05, 0.2, 0.3, 0.5, 0.6, 0.7, 0.9, 0.97, 0.995}) {
            CAPTURE(part);
            const auto cut =
                write("cut" + path.extension().string(), bytes.substr(0, std::size_t(part * double(bytes.size()))));
            CHECK_THROWS_WITH(readMesh(cut), Catch::Contains(cut.string()));
        }
    }
}

TEST_CASE("faces that use vertices which are not there are refused") {
    CHECK_THROWS_WITH(readMesh(write("index.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n")),
                      Catch::Contains("line 6") && Catch::Contains("vertex 7"));
    CHECK_THROWS(readMesh(write("index.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n")));
    CHECK_THROWS(readMesh(write("index.ply",
                                "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                                "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
                                "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n")));
}

TEST_CASE("the public corpus's formats are read") {
    struct Case {
        const char* name;
        std::size_t triangles;
    };
    for (const Case& c :
         {Case{"formats/comments.off", 12}, Case{"formats/negative_indices.obj", 12},
          Case{"formats/polygonfaces.obj", 3}, Case{"formats/nancolor.obj", 12},
          Case{"formats/two_objects_mixed_case_names.stl", 24}, Case{"formats/20mm-xyz-cube.stl", 260},
          Case{"formats/cube_blender_uv.ply", 12}, Case{"bunny_zipper_soup.stl", 69451},
          Case{"dragon_vrip_871k.ply", 871306}, Case{"formats/whitespace.off", 12}, Case{"cgal-cube-shuffled.off", 12},
          Case{"screwdriver.off", 54300}, Case{"formats/brain_tristrips.ply", 36752}}) {
        const auto path = test::corpusMesh(c.name);
        if (!path) return;
        CAPTURE(c.name);
        CHECK(readMesh(*path).triangles.size() == c.triangles);
    }
    CHECK_THROWS(readMesh(*test::corpusMesh("formats/empty.obj")));
    CHECK_THROWS(readMesh(*test::corpusMesh("formats/stl_empty_bin.stl")));
}
}  // namespace bilayer::mesh_io_test
