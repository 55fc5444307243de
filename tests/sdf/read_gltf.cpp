// SPDX-License-Identifier: Apache-2.0
// glTF: meshes, nodes, instances, scenes, skins and extensions.
#include <sys/stat.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <string>

#include "sdf/io/scenes/scene_io.h"
#include "tests/support/gltf.h"
#include "tests/support/gltf_refusals.h"
#include "tests/support/polygons.h"
#include "tests/support/support.h"

namespace bilayer::read_gltf_test {
using namespace bilayer::detail;
using namespace bilayer::test;
using nlohmann::json;

TEST_CASE("glTF: a cube is read, whatever its indices are and wherever its buffer is") {
    Gltf gltf = Gltf::cube();
    for (const auto type : {Gltf::UnsignedByte, Gltf::UnsignedShort, Gltf::UnsignedInt}) {
        primitive(gltf)["indices"] = gltf.indices(test::cubeCorners(), type);
        const Polygons cube = readGltf(gltf);
        CHECK(test::faceCount(cube) == 12);
        CHECK(cube.points.size() == 8);
        CHECK(volume(cube) == 8);
        CHECK(cube.notes.empty());
    }
    CHECK(volume(readScene(gltf.writeBinary("cube.glb"))) == 8);
    CHECK(volume(readScene(gltf.writeBinary("cube.GLTF"))) == 8);
    // a separate file, which may be longer
    CHECK(volume(readScene(gltf.writeApart("apart.gltf", "cube.bin", "cube.bin"))) == 8);
    CHECK(volume(readScene(gltf.writeApart("apart.gltf", "a%20cube.bin", "a cube.bin"))) == 8);
    CHECK(volume(readScene(gltf.writeApart("apart.gltf", "a+cube.bin", "a+cube.bin"))) == 8);
    primitive(gltf).erase("indices");
    std::vector<glm::vec3> soup;
    for (const unsigned corner : test::cubeCorners()) soup.push_back(test::cubePoints()[corner]);
    primitive(gltf)["attributes"]["POSITION"] = gltf.points(soup);
    CHECK(volume(readGltf(gltf)) == 8);
}

TEST_CASE("glTF: strips and fans are triangles") {
    Gltf gltf = Gltf::cube();
    const auto corners = [&](const std::vector<unsigned>& indices, int mode) {
        primitive(gltf)["indices"] = gltf.indices(indices);
        primitive(gltf)["mode"] = mode;
        return readGltf(gltf).corners;
    };
    using Corners = std::vector<unsigned>;
    CHECK(corners({0, 1, 2, 3, 4}, 5) == Corners{0, 1, 2, 1, 3, 2, 2, 3, 4});
    CHECK(corners({0, 1, 2, 3, 4}, 6) == Corners{1, 2, 0, 2, 3, 0, 3, 4, 0});
    CHECK(corners({0, 1}, 5).empty());
    CHECK(corners({0, 1, 2, 3, 4}, 4) == Corners{0, 1, 2});
    CHECK(mentions(readGltf(gltf), "2 indices"));
    for (const int mode : {0, 1, 2, 3}) CHECK(corners({0, 1, 2}, mode).empty());
    CHECK(mentions(readGltf(gltf), "1 primitives of points or lines"));
}

TEST_CASE("glTF: nodes place meshes in double precision, and mirrors keep the outward side") {
    Gltf gltf = Gltf::cube();
    json& nodes = gltf.file["nodes"];
    nodes[0]["scale"] = {-1, 1, 1};
    nodes[0]["translation"] = {3, 0, 0};
    CHECK(volume(readGltf(gltf)) == 8);
    CHECK(lower(readGltf(gltf)).x == 2);
    nodes[0] = {{"scale", {1, -2, 1}}, {"children", {1}}};
    nodes[1] = {{"mesh", 0}, {"scale", {1, 1, -1}}};
    CHECK(volume(readGltf(gltf)) == 16);
    nodes[1] = {{"mesh", 0}, {"matrix", {0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1}}};
    CHECK(volume(readGltf(gltf)) == 16);
    CHECK(upper(readGltf(gltf)) == glm::dvec3(6, -10, 8));
    const double s = std::sqrt(0.5);
    nodes = json::array({{{"mesh", 0}, {"rotation", {0, 0, s, s}}, {"scale", {3, 1, 1}}, {"translation", {0, 0, 1}}}});
    CHECK(upper(readGltf(gltf)).y == Approx(3));
    CHECK(upper(readGltf(gltf)).x == Approx(1));
    nodes[0] = {{"mesh", 0}, {"translation", {4567890.125, 5000000.0625, 0.0}}, {"scale", {0.25, 0.25, 0.25}}};
    CHECK(lower(readGltf(gltf)).x == 4567889.875);
    CHECK(upper(readGltf(gltf)).y == 5000000.3125);
    nodes[0]["translation"] = {1, 2};
    refuses(gltf, {"translation of node 0 has 2 numbers", "3"});
}

TEST_CASE("glTF: rotations are normalised, and matrices are affine") {
    Gltf gltf = Gltf::cube();
    json& node = gltf.file["nodes"][0];
    for (const double scale : {1e-300, 1e-3, 0.7, 1.0, 3.0, 1e300})
        for (const json& rotation : {json{0, 0, scale, scale}, json{scale, -2 * scale, 3 * scale, 4 * scale}}) {
            CAPTURE(rotation.dump());
            node["rotation"] = rotation;
            CHECK(volume(readGltf(gltf)) == Approx(8).epsilon(1e-12));
        }
    node["rotation"] = {0, 0, 0, 0};
    refuses(gltf, {"rotation of node 0 is 0 0 0 0", "length 1"});
    node.erase("rotation");
    node["matrix"] = {1, 0, 0, 0.5, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    refuses(gltf, {"bottom row of the matrix of node 0 is 0.5 0 0 1", "0 0 0 1"});
    node["matrix"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 2};
    refuses(gltf, {"bottom row of the matrix of node 0 is 0 0 0 2"});
    node["matrix"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0.99999994};  // rounded to floats
    CHECK(volume(readGltf(gltf)) == 8);
    node.erase("matrix");
    json& attributes = node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
    attributes = {{"ROTATION", gltf.accessor({0, 0, 0, 1, 0, 0, 0.7, 0.7}, Gltf::Float, "VEC4")}};
    CHECK(volume(readGltf(gltf)) == Approx(16).epsilon(1e-12));
    for (const double bad : {0.0, std::nan(""), double(INFINITY)}) {
        attributes["ROTATION"] = gltf.accessor({0, 0, 0, 1, 0, 0, 0, bad}, Gltf::Float, "VEC4");
        refuses(gltf, {"rotation of instance 1 of node 0"});
    }
    attributes["ROTATION"] = "abc";
    refuses(gltf, {"instances of node 0", "ROTATION"});
}

TEST_CASE("glTF: every instance of EXT_mesh_gpu_instancing is read") {
    Gltf gltf = Gltf::cube();
    const int t = gltf.points({{0, 0, 0}, {5, 0, 0}, {0, 5, 0}});
    const int s = gltf.points({{1, 1, 1}, {-1, 1, 1}, {2, 2, 2}});
    const int r = gltf.accessor({0, 0, 0, 32767, 0, 0, 32767, 0, 0, 0, 0, 32767}, Gltf::Short, "VEC4");
    gltf.file["accessors"][std::size_t(r)]["normalized"] = true;
    json& node = gltf.file["nodes"][0];
    node["translation"] = {0, 0, 10};
    json& attributes = node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
    attributes = {{"TRANSLATION", t}};
    for (const bool required : {false, true}) {
        if (required) gltf.file["extensionsRequired"] = {"EXT_mesh_gpu_instancing"};
        const Polygons three = readGltf(gltf);
        CHECK(test::faceCount(three) == 36);
        CHECK(volume(three) == 24);
        CHECK(upper(three) == glm::dvec3(6, 6, 11));
    }
    attributes["SCALE"] = s;
    attributes["ROTATION"] = r;
    CHECK(volume(readGltf(gltf)) == 8 + 8 + 64);
    CHECK(upper(readGltf(gltf)) == glm::dvec3(6, 7, 12));
    attributes["SCALE"] = gltf.points({{1, 1, 1}});
    refuses(gltf, {"instances of node 0", "3 translations", "1 scales"});
    attributes = {{"COLOR", 0}};
    refuses(gltf, {"instances of node 0", "no TRANSLATION"});
}

TEST_CASE("glTF: the default scene is read") {
    Gltf gltf = Gltf::cube();
    gltf.add("nodes", {{"mesh", 0}, {"translation", {10, 0, 0}}});
    CHECK(upper(readGltf(gltf)).x == 1);
    gltf.add("scenes", {{"nodes", {1}}});
    CHECK(upper(readGltf(gltf)).x == 1);
    CHECK(mentions(readGltf(gltf), "scene 0 of 2"));
    gltf.file["scene"] = 1;
    CHECK(lower(readGltf(gltf)).x == 9);
    gltf.file["scene"] = 2;
    refuses(gltf, {"scene 2", "has 2"});
    gltf.file.erase("scene");
    gltf.file.erase("scenes");
    CHECK(volume(readGltf(gltf)) == 16);
    gltf.add("meshes", gltf.file["meshes"][0]);
    CHECK(mentions(readGltf(gltf), "1 meshes were left out"));
}

TEST_CASE("glTF: parts outside the scene are reported") {
    Gltf gltf = Gltf::cube();
    gltf.add("nodes", {{"mesh", 0}, {"translation", {10, 0, 0}}});
    gltf.add("nodes", {{"children", {1}}});
    const Polygons shared = readGltf(gltf);
    CHECK(volume(shared) == 8);
    CHECK(mentions(shared, "1 nodes with a mesh are outside of the scene"));
    gltf.file["scenes"][0]["nodes"] = {0, 2};
    CHECK(readGltf(gltf).notes.empty());
    gltf.file["scenes"][0]["nodes"] = json::array();
    CHECK(mentions(readGltf(gltf), "the scene shows 0 meshes; the file has 1 meshes and 3 nodes"));
    CHECK(mentions(readGltf(gltf), "2 nodes with a mesh are outside of the scene"));
    Gltf empty;
    empty.view({0}, Gltf::Byte);
    CHECK(mentions(readGltf(empty), "the file has 0 meshes and 0 nodes"));
    Gltf points = Gltf::cube();
    primitive(points)["mode"] = 0;
    CHECK(mentions(readGltf(points), "1 primitives of points or lines"));
}

TEST_CASE("glTF: trees of nodes may be deep, and must be trees") {
    Gltf gltf = Gltf::cube();
    json& nodes = gltf.file["nodes"];
    constexpr int depth = 100000;
    nodes = json::array();
    for (int i = 0; i < depth; ++i) nodes.push_back({{"translation", {1, 0, 0}}, {"children", {i + 1}}});
    nodes.push_back({{"mesh", 0}});
    CHECK(upper(readGltf(gltf)).x == depth + 1);
    nodes = json::array();
    for (int i = 0; i < 10; ++i) nodes.push_back({{"children", {i + 1}}});
    nodes.push_back({{"mesh", 0}, {"children", {7}}});
    refuses(gltf, {"node 7 is reached twice"});
    nodes = json::array({{{"mesh", 0}, {"children", {0}}}});
    refuses(gltf, {"node 0 is reached twice"});
    nodes = json::array({{{"mesh", 0}, {"children", {4}}}});
    refuses(gltf, {"node 0 names node 4", "has 1"});
    std::string deep(100000, '[');
    const auto path = test::scratch("nested.gltf");
    std::ofstream(path) << R"({"asset":{"version":"2.0"},"extras":)" << deep;
    CHECK_THROWS_WITH(readScene(path), Catch::Contains("nested more than"));
}

TEST_CASE("glTF: skins are applied, and morph targets are reported") {
    Gltf gltf = Gltf::cube();
    // the upper half is bound to a joint that is 4 higher than in the bind pose
    std::vector<double> joints, weights, inverse;
    for (const glm::vec3& p : test::cubePoints()) {
        joints.insert(joints.end(), {0, 1, 0, 0});
        weights.insert(weights.end(), {p.z < 0 ? 1.0 : 0.0, p.z < 0 ? 0.0 : 1.0, 0, 0});
    }
    for (int j = 0; j < 2; ++j)
        for (int i = 0; i < 16; ++i) inverse.push_back(i % 5 == 0 ? 1.0 : i == 14 && j == 1 ? -1.0 : 0.0);
    primitive(gltf)["attributes"]["JOINTS_0"] = gltf.accessor(joints, Gltf::UnsignedByte, "VEC4");
    primitive(gltf)["attributes"]["WEIGHTS_0"] = gltf.accessor(weights, Gltf::Float, "VEC4");
    gltf.add("skins", {{"joints", {1, 2}}, {"inverseBindMatrices", gltf.accessor(inverse, Gltf::Float, "MAT4")}});
    gltf.file["nodes"] = json::array(
        {{{"mesh", 0}, {"skin", 0}, {"translation", {77, 0, 0}}}, {{"children", {2}}}, {{"translation", {0, 0, 5}}}});
    gltf.file["scenes"][0]["nodes"] = {0, 1};
    const Polygons skinned = readGltf(gltf);
    CHECK(lower(skinned) == glm::dvec3(-1, -1, -1));
    CHECK(upper(skinned) == glm::dvec3(1, 1, 5));
    CHECK(mentions(skinned, "skins"));
    gltf.file["skins"][0]["joints"] = {1};
    refuses(gltf, {"joint 1", "has 1"});
    gltf.file["nodes"][0]["skin"] = 3;
    refuses(gltf, {"skin 3"});
    Gltf morphed = Gltf::cube();
    primitive(morphed)["targets"] = {{{"POSITION", 0}}};
    CHECK(volume(readGltf(morphed)) == 8);
    CHECK(mentions(readGltf(morphed), "morph"));
}

TEST_CASE("glTF: images are never loaded") {
    Gltf gltf = Gltf::cube();
    gltf.file["images"] = {{{"uri", "missing.png"}},
                           {{"uri", "data:image/png;base64,AAAA"}},
                           {{"bufferView", 0}, {"mimeType", "image/png"}}};
    gltf.file["textures"] = {{{"source", 0}}};
    gltf.file["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
    gltf.file["materials"].push_back({{"normalTexture", json::object()}});
    primitive(gltf)["material"] = 0;
    CHECK(volume(readGltf(gltf)) == 8);
}

TEST_CASE("glTF: unknown required extensions are rejected by name") {
    for (const char* name : {"KHR_draco_mesh_compression", "EXT_meshopt_compression", "VENDOR_new"}) {
        Gltf gltf = Gltf::cube();
        gltf.file["extensionsUsed"] = gltf.file["extensionsRequired"] = {name};
        refuses(gltf, {name, "requires"});
    }
    for (const char* name : {"KHR_materials_unlit", "KHR_texture_transform", "KHR_lights_punctual"}) {
        Gltf gltf = Gltf::cube();
        gltf.file["extensionsUsed"] = gltf.file["extensionsRequired"] = {name};
        CHECK(volume(readGltf(gltf)) == 8);
    }
    Gltf gltf = Gltf::cube();
    gltf.file["extensionsUsed"] = {"KHR_draco_mesh_compression"};
    primitive(gltf)["extensions"]["KHR_draco_mesh_compression"] = {{"bufferView", 0}};
    CHECK(volume(readGltf(gltf)) == 8);  // the uncompressed data are there too
    for (auto& accessor : gltf.file["accessors"]) {
        const auto view = accessor["bufferView"];
        accessor.erase("bufferView");
        refuses(gltf, {"KHR_draco_mesh_compression"});
        accessor["bufferView"] = view;
    }
}
}  // namespace bilayer::read_gltf_test
