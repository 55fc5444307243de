// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/scenes/scene_io.h"

#include <unistd.h>

#include <catch2/catch.hpp>
#include <fstream>
#include <string>

#include <bilayer/sdf/inspect.h>
#include <bilayer/sdf/mesh_io.h>
#include "tests/support/gltf.h"
#include "tests/support/polygons.h"
#include "tests/support/scene_files.h"
#include "tests/support/support.h"

namespace bilayer::scene_io_test {
using namespace bilayer::detail;
using bilayer::test::SceneFile;

namespace {

std::filesystem::path write(const SceneFile& file) {
    const auto path = test::scratch(file.name);
    std::ofstream(path, std::ios::binary) << file.bytes;
    return path;
}

// A box of 1 x 2 x 3 with right angles, as quadrilaterals, under a node's matrix
std::string collada(const std::string& upAxis, const std::string& matrix) {
    return "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">"
           "<asset><up_axis>" +
           upAxis +
           "</up_axis></asset><library_geometries><geometry id=\"g\"><mesh><source id=\"p\"><float_array id=\"a\" "
           "count=\"24\">0 0 0 1 0 0 0 2 0 1 2 0 0 0 3 1 0 3 0 2 3 1 2 3</float_array><technique_common><accessor "
           "source=\"#a\" count=\"8\" stride=\"3\"><param name=\"X\" type=\"float\"/><param name=\"Y\" "
           "type=\"float\"/><param name=\"Z\" type=\"float\"/></accessor></technique_common></source><vertices "
           "id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/></vertices><polylist count=\"6\"><input "
           "semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><vcount>4 4 4 4 4 4</vcount><p>0 2 3 1 4 5 7 6 0 1 5 4 2 6 "
           "7 3 0 4 6 2 1 3 7 5</p></polylist></mesh></geometry></library_geometries><library_visual_scenes>"
           "<visual_scene id=\"s\"><node id=\"n\"><matrix>" +
           matrix +
           "</matrix><instance_geometry url=\"#g\"/></node></visual_scene></library_visual_scenes><scene>"
           "<instance_visual_scene url=\"#s\"/></scene></COLLADA>";
}

}  // namespace

TEST_CASE("a cube is a cube in every format") {
    for (const SceneFile& file : test::cubeFiles()) {
        CAPTURE(file.name);
        const Polygons cube = readScene(write(file));
        CHECK(test::faceCount(cube) == 12);
        CHECK(std::abs(test::volume(cube)) == Approx(8).epsilon(1e-5));
        const Mesh mesh = readMesh(test::scratch(file.name));
        CHECK(mesh.points.size() == 8);
        CHECK(inspect(mesh).closed());
    }
}

TEST_CASE("polygons stay whole, in the file's own axes, and mirrors keep outside outside") {
    for (const std::string up : {"X_UP", "Y_UP", "Z_UP"}) {
        const Polygons box = readScene(write({"box.dae", collada(up, "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1")}));
        CHECK(box.sizes == std::vector<unsigned>(6, 4));
        CHECK(test::volume(box) == 6);
        CHECK(test::lower(box) == glm::dvec3(0, 0, 0));
        CHECK(test::upper(box) == glm::dvec3(1, 2, 3));
    }
    const Polygons mirrored = readScene(write({"box.dae", collada("Z_UP", "-1 0 0 5 0 1 0 0 0 0 2 0 0 0 0 1")}));
    CHECK(test::volume(mirrored) == 12);
    CHECK(test::lower(mirrored) == glm::dvec3(4, 0, 0));
    CHECK(test::upper(mirrored) == glm::dvec3(5, 2, 6));
}

TEST_CASE("a thumbnail does no harm to a 3MF file, nor does a missing model to the reader") {
    std::vector<SceneFile> parts = test::parts3mf();
    parts.push_back({"Metadata/thumbnail.png", "\x89PNG\r\n\x1a\n and no image"});
    const std::string relation =
        "<Relationship Target=\"/Metadata/thumbnail.png\" Id=\"rel1\" "
        "Type=\"http://schemas.openxmlformats.org/package/2006/relationships/metadata/"
        "thumbnail\"/>";
    parts[1].bytes.insert(parts[1].bytes.find("<Relationship "), relation);
    CHECK(test::volume(readScene(write({"thumbnail.3mf", test::zip(parts)}))) == Approx(8));
    parts.erase(parts.begin() + 2);
    CHECK_THROWS_WITH(readMesh(write({"empty.3mf", test::zip(parts)})), Catch::Contains("empty.3mf: "));
    CHECK_THROWS_WITH(readMesh(write({"none.3mf", test::zip({})})), Catch::Contains("none.3mf: "));
}

TEST_CASE("skeletons make no surface") {
    const auto path = write({"walk.bvh",
                             "HIERARCHY\nROOT hip\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition "
                             "Zposition\nEnd Site\n{\nOFFSET 0 1 0\n}\n}\nMOTION\nFrames: 1\nFrame Time: "
                             "1\n0 0 0\n"});
    const Polygons skeleton = readScene(path);
    CHECK(skeleton.corners.empty());
    CHECK(test::mentions(skeleton, "the scene shows 0 meshes"));
    CHECK_THROWS_WITH(readMesh(path), Catch::Contains("holds no triangle"));
}

TEST_CASE("what no reader knows is refused by its extension") {
    CHECK_THROWS_WITH(readScene(write({"a.xyz", "1 2 3"})), Catch::Contains("a.xyz: .xyz is not the extension"));
    CHECK_THROWS_WITH(readScene(write({"bare", "1 2 3"})), Catch::Contains("bare: has no extension"));
    CHECK_THROWS_WITH(readScene("/nonexistent.dae"), Catch::Contains("/nonexistent.dae: no such file"));
}

TEST_CASE("an importer that needs too much memory is an error that states its limit") {
    if (test::isSanitized()) return;
    test::Gltf gltf = test::Gltf::cube();
    gltf.file["accessors"][0]["count"] = std::uint64_t(1) << 40;
    gltf.file["accessors"][0].erase("bufferView");
    gltf.file["accessors"][0]["sparse"] = {
        {"count", 0}, {"indices", {{"bufferView", 1}, {"componentType", 5123}}}, {"values", {{"bufferView", 0}}}};
    CHECK_THROWS_WITH(readScene(gltf.write("large.gltf")), Catch::Contains("large.gltf: reading it needs more than"));
    std::string corners = collada("Z_UP", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1");
    corners.replace(corners.find("<p>0 2 3 1"), 10, "<p>2E6 7 2 7 3");
    CHECK_THROWS_WITH(readScene(write({"corners.dae", corners})),
                      Catch::Contains("corners.dae: reading it needs more than the 2048 MiB of memory that importers"));
}

TEST_CASE("an importer that takes too long or crashes is an error that states what to do") {
    using namespace std::chrono_literals;
    test::Gltf gltf = test::Gltf::cube();
    const auto path = gltf.write("slow.gltf");
    CHECK_THROWS_WITH(readScene(path, {0ms, std::size_t(1) << 30}),
                      Catch::Contains("slow.gltf: the importer for GLTF files took longer than 0 s; convert it to "
                                      "OBJ, PLY or STL"));
    // Assimp 5.2 crashes on a texture without a name; other versions may not
    const std::string text = collada("Z_UP", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1");
    const std::size_t at = text.find("<library_geometries>");
    const auto crash = write({"nameless.dae", text.substr(0, at) +
                                                  "<library_images><image id=\"i\"><init_from/></image>"
                                                  "</library_images>" +
                                                  text.substr(at)});
    try {
        const Polygons box = readScene(crash);
        CHECK(test::volume(box) == 6);
    } catch (const std::runtime_error& error) {
        CHECK_THAT(error.what(), Catch::Contains("nameless.dae: the importer for DAE files ended by signal") &&
                                     Catch::Contains("; convert it to OBJ, PLY, STL or glTF"));
    }
}

TEST_CASE("the scenes of the public cases are read") {
    const auto path = [](const char* name) { return test::corpusMesh(std::string("../cases/") + name); };
    if (!path("Z_UP.dae")) return;
    const MeshReport box = inspect(readMesh(*path("Z_UP.dae")));
    CHECK(box.volume == Approx(6));
    for (const char* name : {"mirrored-node.gltf", "quantized.gltf"}) {
        const Mesh cube = readMesh(*path(name));
        CHECK(cube.triangles.size() == 12);
        CHECK(inspect(cube).volume == Approx(8));
    }
    CHECK(readMesh(*path("gpu-instancing.gltf")).triangles.size() == 36);
    CHECK(readMesh(*path("thumbnail.3mf")).triangles.size() == 12);
    CHECK_THROWS_WITH(readMesh(*path("zip64.3mf")), Catch::Contains("zip64.3mf: is a ZIP64 archive"));
    CHECK_THROWS_WITH(readMesh(*path("empty_init_from.dae")), Catch::Contains("empty_init_from.dae: "));
}
}  // namespace bilayer::scene_io_test
