#include "sdf/mesh_io.h"

#include <catch2/catch.hpp>
#include <fstream>

#include "demos/shared/shapes.h"
#include "sdf/inspect.h"
#include "tests/support/support.h"

using namespace bilayer;

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
    const Mesh mesh = readMesh(write("comments.off", "OFF 4 4 6 # counts\n\n0 0 0\n1 0 0 # x\n\n0 1 0\n0 0 1\n# faces\n"
                                                     "3 0 2 1\n\n3 0 1 3\n3 0 3 2\n\n3 1 2 3\n"));
    CHECK(mesh.triangles.size() == 4);
    CHECK(inspect(mesh).closed());
}

TEST_CASE("unreadable files give an error that names them") {
    CHECK_THROWS_WITH(readMesh("/nonexistent.obj"), Catch::Contains("/nonexistent.obj") && Catch::Contains("no such file"));
    for (const auto& [name, text] : {std::pair("empty.obj", ""), std::pair("noise.ply", "ply\nnot a ply"),
                                     std::pair("points.obj", "v 0 0 0\nv 1 0 0\n"), std::pair("text.stl", "hello"),
                                     std::pair("flat.obj", "v 0 0 0\nv 1 0 0\nv 0 0 0\nf 1 2 3\n")}) {
        CAPTURE(name);
        CHECK_THROWS_WITH(readMesh(write(name, text)), Catch::Contains(name));
    }
    CHECK_THROWS_WITH(readMesh(write("nan.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")), Catch::Contains("nan.obj"));
}

TEST_CASE("the public corpus's formats are read") {
    struct Case {
        const char* name;
        std::size_t triangles;
    };
    for (const Case& c : {Case{"formats/comments.off", 12}, Case{"formats/negative_indices.obj", 12},
                          Case{"formats/polygonfaces.obj", 3}, Case{"formats/nancolor.obj", 12},
                          Case{"formats/two_objects_mixed_case_names.stl", 24}, Case{"formats/20mm-xyz-cube.stl", 260},
                          Case{"formats/cube_blender_uv.ply", 12}, Case{"bunny_zipper_soup.stl", 69451},
                          Case{"dragon_vrip_871k.ply", 871306}, Case{"formats/whitespace.off", 12},
                          Case{"cgal-cube-shuffled.off", 12}, Case{"screwdriver.off", 54300}}) {
        const auto path = test::corpusMesh(c.name);
        if (!path) return;
        CAPTURE(c.name);
        CHECK(readMesh(*path).triangles.size() == c.triangles);
    }
    CHECK_THROWS_WITH(readMesh(*test::corpusMesh("formats/brain_tristrips.ply")), Catch::Contains("triangle strips"));
    CHECK_THROWS(readMesh(*test::corpusMesh("formats/empty.obj")));
    CHECK_THROWS(readMesh(*test::corpusMesh("formats/stl_empty_bin.stl")));
}
