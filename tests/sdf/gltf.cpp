#include <fmt/format.h>
#include <sys/stat.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>

#include "sdf/io/scene_io.h"
#include "tests/support/gltf.h"
#include "tests/support/polygons.h"
#include "tests/support/support.h"

using namespace bilayer;
using namespace bilayer::detail;
using bilayer::test::Gltf;
using bilayer::test::lower;
using bilayer::test::tells;
using bilayer::test::upper;
using bilayer::test::volume;
using nlohmann::json;

namespace {

using Strings = std::vector<std::string>;

Polygons read(Gltf gltf) {
    return readScene(gltf.write("test.gltf"));
}

nlohmann::json& primitive(Gltf& gltf) {
    return gltf.file["meshes"][0]["primitives"][0];
}

// The cube, with positions in another number format
Gltf cubeOf(Gltf::Type type, double half, bool normalized) {
    Gltf gltf = Gltf::cube();
    std::vector<double> numbers;
    for (const glm::vec3& p : test::cubePoints())
        for (int k = 0; k < 3; ++k) numbers.push_back(half * p[k]);
    const int points = gltf.accessor(numbers, type, "VEC3");
    gltf.file["accessors"][std::size_t(points)]["normalized"] = normalized;
    primitive(gltf)["attributes"]["POSITION"] = points;
    return gltf;
}

void refuses(Gltf gltf, const Strings& words) {
    const auto path = gltf.write("refused.gltf");
    INFO(gltf.file.dump().substr(0, 3000));
    try {
        readScene(path);
        FAIL_CHECK("was read");
    } catch (const std::runtime_error& error) {
        const std::string text = error.what();
        CHECK_THAT(text, Catch::Contains(path.string() + ": "));
        CHECK(text.find('\n') == std::string::npos);
        for (const std::string& word : words) CHECK_THAT(text, Catch::Contains(word));
    }
}

}  // namespace

TEST_CASE("glTF: a cube is read, whatever its indices are and wherever its buffer is") {
    Gltf gltf = Gltf::cube();
    for (const auto type : {Gltf::UnsignedByte, Gltf::UnsignedShort, Gltf::UnsignedInt}) {
        primitive(gltf)["indices"] = gltf.indices(test::cubeCorners(), type);
        const Polygons cube = read(gltf);
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
    CHECK(volume(read(gltf)) == 8);
}

TEST_CASE("glTF: strips and fans are triangles") {
    Gltf gltf = Gltf::cube();
    const auto corners = [&](const std::vector<unsigned>& indices, int mode) {
        primitive(gltf)["indices"] = gltf.indices(indices);
        primitive(gltf)["mode"] = mode;
        return read(gltf).corners;
    };
    using Corners = std::vector<unsigned>;
    CHECK(corners({0, 1, 2, 3, 4}, 5) == Corners{0, 1, 2, 1, 3, 2, 2, 3, 4});
    CHECK(corners({0, 1, 2, 3, 4}, 6) == Corners{1, 2, 0, 2, 3, 0, 3, 4, 0});
    CHECK(corners({0, 1}, 5).empty());
    CHECK(corners({0, 1, 2, 3, 4}, 4) == Corners{0, 1, 2});
    CHECK(tells(read(gltf), "2 indices"));
    for (const int mode : {0, 1, 2, 3}) CHECK(corners({0, 1, 2}, mode).empty());
    CHECK(tells(read(gltf), "1 primitives of points or lines"));
}

TEST_CASE("glTF: quantised positions stand for what the specification says") {
    const auto size = [](Gltf gltf) { return upper(read(std::move(gltf))).x; };
    for (const bool required : {true, false}) {
        Gltf gltf = cubeOf(Gltf::Short, 100, false);
        gltf.file["extensionsUsed"] = {"KHR_mesh_quantization"};
        if (required) gltf.file["extensionsRequired"] = {"KHR_mesh_quantization"};
        CHECK(volume(read(gltf)) == 8e6);
    }
    CHECK(size(cubeOf(Gltf::Byte, 127, true)) == 1);
    CHECK(size(cubeOf(Gltf::Byte, 100, false)) == 100);
    CHECK(size(cubeOf(Gltf::Short, 32767, true)) == 1);
    CHECK(size(cubeOf(Gltf::Short, 16000, true)) == 16000 / 32767.0);
    // -128 is -1 too
    Gltf gltf = cubeOf(Gltf::Byte, 127, true);
    gltf.bin[std::size_t(gltf.file["bufferViews"].back()["byteOffset"])] = char(-128);
    CHECK(lower(read(gltf)).x == -1);
    const std::vector<double> corner{0, 0, 0, 255, 0, 0, 0, 51, 0};
    for (const auto& [type, one] : {std::pair(Gltf::UnsignedByte, 255.0), std::pair(Gltf::UnsignedShort, 65535.0)}) {
        Gltf part = Gltf::cube();
        const int points = part.accessor(corner, type, "VEC3");
        part.file["accessors"][std::size_t(points)]["normalized"] = true;
        primitive(part) = {{"attributes", {{"POSITION", points}}}};
        CHECK(upper(read(part)) == glm::dvec3(255 / one, 51 / one, 0));
    }
}

TEST_CASE("glTF: strides and sparse elements") {
    Gltf gltf = Gltf::cube();
    std::vector<double> spread;
    for (const glm::vec3& p : test::cubePoints()) spread.insert(spread.end(), {99, p.x, p.y, p.z, 99});
    const int view = gltf.view(spread, Gltf::Float);
    gltf.file["bufferViews"][std::size_t(view)]["byteStride"] = 20;
    gltf.file["accessors"][0]["bufferView"] = view;
    gltf.file["accessors"][0]["byteOffset"] = 4;
    CHECK(volume(read(gltf)) == 8);
    // vertex 7 moves outward; then all vertices are sparse
    const auto sparse = [&](const std::vector<double>& which, const std::vector<double>& numbers) {
        return json{{"count", which.size()},
                    {"indices", {{"bufferView", gltf.view(which, Gltf::UnsignedByte)}, {"componentType", 5121}}},
                    {"values", {{"bufferView", gltf.view(numbers, Gltf::Float)}}}};
    };
    gltf.file["accessors"][0]["sparse"] = sparse({7}, {1, 1, 4});
    CHECK(upper(read(gltf)).z == 4);
    std::vector<double> all;
    for (const glm::vec3& p : test::cubePoints()) all.insert(all.end(), {2 * p.x, 2 * p.y, 2 * p.z});
    gltf.file["accessors"][0]["sparse"] = sparse({0, 1, 2, 3, 4, 5, 6, 7}, all);
    gltf.file["accessors"][0].erase("bufferView");
    CHECK(volume(read(gltf)) == 64);
    gltf.file["accessors"][0]["sparse"] = sparse({8}, {0, 0, 0});
    refuses(gltf, {"accessor 0", "element 8 of 8"});
    gltf.file["accessors"][0].erase("sparse");
    refuses(gltf, {"accessor 0", "neither a buffer view"});
}

TEST_CASE("glTF: nodes place meshes in double precision, and mirrors keep outside outside") {
    Gltf gltf = Gltf::cube();
    json& nodes = gltf.file["nodes"];
    nodes[0]["scale"] = {-1, 1, 1};
    nodes[0]["translation"] = {3, 0, 0};
    CHECK(volume(read(gltf)) == 8);
    CHECK(lower(read(gltf)).x == 2);
    nodes[0] = {{"scale", {1, -2, 1}}, {"children", {1}}};
    nodes[1] = {{"mesh", 0}, {"scale", {1, 1, -1}}};
    CHECK(volume(read(gltf)) == 16);
    nodes[1] = {{"mesh", 0}, {"matrix", {0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1}}};
    CHECK(volume(read(gltf)) == 16);
    CHECK(upper(read(gltf)) == glm::dvec3(6, -10, 8));
    const double s = std::sqrt(0.5);
    nodes = json::array({{{"mesh", 0}, {"rotation", {0, 0, s, s}}, {"scale", {3, 1, 1}}, {"translation", {0, 0, 1}}}});
    CHECK(upper(read(gltf)).y == Approx(3));
    CHECK(upper(read(gltf)).x == Approx(1));
    nodes[0] = {{"mesh", 0}, {"translation", {4567890.125, 5000000.0625, 0.0}}, {"scale", {0.25, 0.25, 0.25}}};
    CHECK(lower(read(gltf)).x == 4567889.875);
    CHECK(upper(read(gltf)).y == 5000000.3125);
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
            CHECK(volume(read(gltf)) == Approx(8).epsilon(1e-12));
        }
    node["rotation"] = {0, 0, 0, 0};
    refuses(gltf, {"rotation of node 0 is 0 0 0 0", "length 1"});
    node.erase("rotation");
    node["matrix"] = {1, 0, 0, 0.5, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    refuses(gltf, {"bottom row of the matrix of node 0 is 0.5 0 0 1", "0 0 0 1"});
    node["matrix"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 2};
    refuses(gltf, {"bottom row of the matrix of node 0 is 0 0 0 2"});
    node["matrix"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0.99999994};  // rounded to floats
    CHECK(volume(read(gltf)) == 8);
    node.erase("matrix");
    json& attributes = node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
    attributes = {{"ROTATION", gltf.accessor({0, 0, 0, 1, 0, 0, 0.7, 0.7}, Gltf::Float, "VEC4")}};
    CHECK(volume(read(gltf)) == Approx(16).epsilon(1e-12));
    for (const double bad : {0.0, std::nan(""), double(INFINITY)}) {
        attributes["ROTATION"] = gltf.accessor({0, 0, 0, 1, 0, 0, 0, bad}, Gltf::Float, "VEC4");
        refuses(gltf, {"rotation of instance 1 of node 0"});
    }
    attributes["ROTATION"] = "abc";
    refuses(gltf, {"instances of node 0", "ROTATION"});
}

TEST_CASE("glTF: every instance of EXT_mesh_gpu_instancing is there") {
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
        const Polygons three = read(gltf);
        CHECK(test::faceCount(three) == 36);
        CHECK(volume(three) == 24);
        CHECK(upper(three) == glm::dvec3(6, 6, 11));
    }
    attributes["SCALE"] = s;
    attributes["ROTATION"] = r;
    CHECK(volume(read(gltf)) == 8 + 8 + 64);
    CHECK(upper(read(gltf)) == glm::dvec3(6, 7, 12));
    attributes["SCALE"] = gltf.points({{1, 1, 1}});
    refuses(gltf, {"instances of node 0", "3 translations", "1 scales"});
    attributes = {{"COLOR", 0}};
    refuses(gltf, {"instances of node 0", "no TRANSLATION"});
}

TEST_CASE("glTF: the scene that is shown is read") {
    Gltf gltf = Gltf::cube();
    gltf.add("nodes", {{"mesh", 0}, {"translation", {10, 0, 0}}});
    CHECK(upper(read(gltf)).x == 1);
    gltf.add("scenes", {{"nodes", {1}}});
    CHECK(upper(read(gltf)).x == 1);
    CHECK(tells(read(gltf), "scene 0 of 2"));
    gltf.file["scene"] = 1;
    CHECK(lower(read(gltf)).x == 9);
    gltf.file["scene"] = 2;
    refuses(gltf, {"scene 2", "has 2"});
    gltf.file.erase("scene");
    gltf.file.erase("scenes");
    CHECK(volume(read(gltf)) == 16);
    gltf.add("meshes", gltf.file["meshes"][0]);
    CHECK(tells(read(gltf), "1 meshes were left out"));
}

TEST_CASE("glTF: what the scene does not show is told") {
    Gltf gltf = Gltf::cube();
    gltf.add("nodes", {{"mesh", 0}, {"translation", {10, 0, 0}}});
    gltf.add("nodes", {{"children", {1}}});
    const Polygons shared = read(gltf);
    CHECK(volume(shared) == 8);
    CHECK(tells(shared, "1 nodes with a mesh are outside of the scene"));
    gltf.file["scenes"][0]["nodes"] = {0, 2};
    CHECK(read(gltf).notes.empty());
    gltf.file["scenes"][0]["nodes"] = json::array();
    CHECK(tells(read(gltf), "the scene shows 0 meshes; the file has 1 meshes and 3 nodes"));
    CHECK(tells(read(gltf), "2 nodes with a mesh are outside of the scene"));
    Gltf empty;
    empty.view({0}, Gltf::Byte);
    CHECK(tells(read(empty), "the file has 0 meshes and 0 nodes"));
    Gltf points = Gltf::cube();
    primitive(points)["mode"] = 0;
    CHECK(tells(read(points), "1 primitives of points or lines"));
}

TEST_CASE("glTF: trees of nodes may be deep, and must be trees") {
    Gltf gltf = Gltf::cube();
    json& nodes = gltf.file["nodes"];
    constexpr int depth = 100000;
    nodes = json::array();
    for (int i = 0; i < depth; ++i) nodes.push_back({{"translation", {1, 0, 0}}, {"children", {i + 1}}});
    nodes.push_back({{"mesh", 0}});
    CHECK(upper(read(gltf)).x == depth + 1);
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

TEST_CASE("glTF: skins are applied, morph targets are told of") {
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
    const Polygons skinned = read(gltf);
    CHECK(lower(skinned) == glm::dvec3(-1, -1, -1));
    CHECK(upper(skinned) == glm::dvec3(1, 1, 5));
    CHECK(tells(skinned, "skins"));
    gltf.file["skins"][0]["joints"] = {1};
    refuses(gltf, {"joint 1", "has 1"});
    gltf.file["nodes"][0]["skin"] = 3;
    refuses(gltf, {"skin 3"});
    Gltf morphed = Gltf::cube();
    primitive(morphed)["targets"] = {{{"POSITION", 0}}};
    CHECK(volume(read(morphed)) == 8);
    CHECK(tells(read(morphed), "morph"));
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
    CHECK(volume(read(gltf)) == 8);
}

TEST_CASE("glTF: required extensions that are not understood are refused by name") {
    for (const char* name : {"KHR_draco_mesh_compression", "EXT_meshopt_compression", "VENDOR_new"}) {
        Gltf gltf = Gltf::cube();
        gltf.file["extensionsUsed"] = gltf.file["extensionsRequired"] = {name};
        refuses(gltf, {name, "requires"});
    }
    for (const char* name : {"KHR_materials_unlit", "KHR_texture_transform", "KHR_lights_punctual"}) {
        Gltf gltf = Gltf::cube();
        gltf.file["extensionsUsed"] = gltf.file["extensionsRequired"] = {name};
        CHECK(volume(read(gltf)) == 8);
    }
    Gltf gltf = Gltf::cube();
    gltf.file["extensionsUsed"] = {"KHR_draco_mesh_compression"};
    primitive(gltf)["extensions"]["KHR_draco_mesh_compression"] = {{"bufferView", 0}};
    refuses(gltf, {"primitive 0 of mesh 0", "KHR_draco_mesh_compression"});
    gltf.file["accessors"][1].erase("bufferView");
    refuses(gltf, {"KHR_draco_mesh_compression"});
}

TEST_CASE("glTF: what is damaged is refused by its name") {
    const auto damaged = [](const std::function<void(json&)>& damage, const Strings& words) {
        Gltf gltf = Gltf::cube();
        damage(gltf.file);
        refuses(gltf, words);
    };
    damaged([](json& f) { f["accessors"][0]["count"] = 9; }, {"accessor 0 (POSITION) needs 9 elements of 12", "96"});
    damaged([](json& f) { f["accessors"][0]["count"] = std::uint64_t(1) << 62; }, {"accessor 0"});
    damaged([](json& f) { f["accessors"][0]["byteOffset"] = std::uint64_t(-4); }, {"accessor 0"});
    damaged([](json& f) { f["accessors"][0]["bufferView"] = 7; }, {"buffer view 7", "has 2"});
    damaged([](json& f) { f["accessors"][0]["type"] = "VEC4"; }, {"accessor 0", "VEC4", "must be VEC3"});
    damaged([](json& f) { f["accessors"][0]["componentType"] = 5130; }, {"accessor 0", "5130"});
    damaged([](json& f) { f["accessors"][1]["componentType"] = 5122; }, {"accessor 1", "5122"});
    damaged([](json& f) { f["accessors"][1]["componentType"] = 5125; }, {"accessor 1"});
    damaged([](json& f) { f["bufferViews"][0]["byteLength"] = 1000; }, {"buffer view 0", "1000"});
    damaged([](json& f) { f["bufferViews"][0]["byteOffset"] = std::uint64_t(-1); }, {"buffer view 0"});
    damaged([](json& f) { f["bufferViews"][0]["buffer"] = 3; }, {"buffer 3", "has 1"});
    damaged([](json& f) { f["bufferViews"][0]["byteStride"] = 4; }, {"byteStride 4", "12"});
    damaged([](json& f) { f["nodes"][0]["mesh"] = 5; }, {"mesh 5", "has 1"});
    damaged([](json& f) { f["meshes"][0]["primitives"][0]["mode"] = 9; }, {"mode 9", "0 to 6"});
    damaged([](json& f) { f["meshes"][0]["primitives"][0].erase("attributes"); }, {"attributes"});
    damaged([](json& f) { f["meshes"][0]["primitives"][0]["attributes"] = {{"NORMAL", 0}}; }, {"no POSITION"});
    damaged([](json& f) { f["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = 5; }, {"accessor 5"});
    damaged([](json& f) { f["asset"]["version"] = "1.0"; }, {"glTF 1.0"});
    damaged([](json& f) { f.erase("asset"); }, {"asset"});
    Gltf gltf = Gltf::cube();
    primitive(gltf)["indices"] = gltf.indices({0, 1, 8});
    refuses(gltf, {"index 2", "is 8", "8 vertices"});
}

TEST_CASE("glTF: members of a wrong type or length are refused by what stands there") {
    const auto wrong = [](const std::string& at, const json& value, const Strings& words) {
        Gltf gltf = Gltf::cube();
        gltf.file["skins"] = {{{"joints", {0}}}};
        gltf.file[json::json_pointer(at)] = value;
        refuses(gltf, words);
    };
    for (const auto& [name, count] :
         {std::pair("translation", 3), std::pair("scale", 3), std::pair("rotation", 4), std::pair("matrix", 16)}) {
        const std::string of = std::string("the ") + name + " of node 0 ", at = std::string("/nodes/0/") + name;
        const std::string right = std::to_string(count);
        wrong(at, "abc", {of + "is \"abc\"; it must be an array of " + right + " numbers"});
        wrong(at, 7, {of + "is 7;"});
        wrong(at, nullptr, {of + "is null;"});
        wrong(at, {{"x", 1}}, {of + "is {\"x\":1};"});
        wrong(at, {1, "2", 3}, {of + "is [1,\"2\",3];"});
        wrong(at, json::array(), {of + "has 0 numbers; it must have " + right});
        wrong(at, std::vector<int>(std::size_t(count) + 1), {"must have " + right});
    }
    wrong("/accessors/0/byteOffset", -8, {"the byteOffset of accessor 0 is -8", "not negative"});
    wrong("/accessors/0/byteOffset", 0.5, {"the byteOffset of accessor 0 is 0.5"});
    wrong("/accessors/0/bufferView", "x", {"the bufferView of accessor 0 is \"x\""});
    wrong("/accessors/0/normalized", 1, {"the normalized of accessor 0 is 1", "true or false"});
    wrong("/accessors/0/count", -1, {"the count of accessor 0 is -1"});
    wrong("/accessors/0/type", "VECTOR", {"the type of accessor 0 is \"VECTOR\"", "VEC3"});
    wrong("/accessors/0/type", std::string(500, 'V'), {std::string(39, 'V') + " ...;"});
    wrong("/accessors/0/sparse", {{"count", 1}}, {"the sparse of accessor 0 has no indices"});
    wrong("/accessors/0", 5, {"the accessors of the file is [5,", "array of objects"});
    wrong("/bufferViews/1/byteOffset", -8, {"the byteOffset of buffer view 1 is -8"});
    wrong("/bufferViews/1/byteStride", "4", {"the byteStride of buffer view 1 is \"4\""});
    wrong("/nodes", {{"mesh", 0}}, {"the nodes of the file"});
    wrong("/nodes/0/mesh", -1, {"the mesh of node 0 is -1"});
    wrong("/nodes/0/mesh", std::uint64_t(1) << 32, {"the mesh of node 0 is 4294967296"});
    wrong("/nodes/0/children", {0, "1"}, {"the children of node 0"});
    wrong("/scene", "main", {"the scene of the file is \"main\""});
    wrong("/scenes/0/nodes", 0, {"the nodes of scene 0 is 0"});
    wrong("/skins/0/joints", "hip", {"the joints of skin 0"});
    wrong("/meshes/0/primitives", 3, {"the primitives of mesh 0 is 3"});
    wrong("/meshes/0/primitives/0/mode", "4", {"the mode of primitive 0 of mesh 0 is \"4\""});
    wrong("/meshes/0/primitives/0/indices", -1, {"the indices of primitive 0 of mesh 0 is -1"});
    wrong("/meshes/0/primitives/0/attributes", {{"POSITION", "0"}}, {"the attributes of primitive 0 of mesh 0"});
    wrong("/extensionsRequired", "KHR_draco_mesh_compression", {"the extensionsRequired of the file"});
    wrong("/asset/version", 2, {"the version of the asset of the file is 2"});
    Gltf gltf = Gltf::cube();
    gltf.file["nodes"][0]["mesh"] = 0.0;
    gltf.file["accessors"][0]["count"] = 8.0;
    CHECK(volume(read(gltf)) == 8);
    gltf.file["accessors"][0].erase("count");
    refuses(gltf, {"accessor 0 has no count"});
}

TEST_CASE("glTF: what stands in the file is quoted to 40 bytes") {
    const std::string longName = std::string(38, 'X') + "\xc3\xa4\xc3\xa4" + std::string(200, 'X');
    Gltf gltf = Gltf::cube();
    gltf.file["extensionsRequired"] = {longName};
    refuses(gltf, {"extension " + std::string(38, 'X') + "   ..."});  // the letter's two bytes are replaced by blanks
    gltf.file.erase("extensionsRequired");
    gltf.file["asset"]["version"] = std::string(300, '1');
    refuses(gltf, {"is glTF " + std::string(40, '1') + " ...;"});
    for (const std::size_t size : {100, 5000})
        CHECK_THROWS_WITH(readScene(gltf.writeApart("apart.gltf", std::string(size, 'b'), "")),
                          Catch::Contains("buffer 0: its uri is " + std::string(40, 'b') + " ...: "));
}

TEST_CASE("glTF: damaged JSON is refused by line and column, or by what stands there") {
    const auto path = test::scratch("damaged.gltf");
    const auto damaged = [&](const std::string& text, const std::string& words) {
        std::ofstream(path, std::ios::binary) << text;
        CAPTURE(text.substr(0, 100));
        try {
            readScene(path);
            FAIL_CHECK("was read");
        } catch (const std::runtime_error& error) {
            CHECK(std::string(error.what()) == path.string() + ": " + words);
        }
    };
    damaged("", "line 1, column 1: its JSON is damaged: unexpected end of input; expected a value");
    damaged("{\n \"a\":", "line 2, column 6: its JSON is damaged: unexpected end of input; expected a value");
    damaged("{\"a\" 1}", "line 1, column 6: its JSON is damaged: unexpected number literal; expected ':', at 1}");
    damaged("{\n\"a\":\"x", "line 2, column 7: its JSON is damaged: invalid string: missing closing quote");
    damaged("{'a':1}", "line 1, column 2: its JSON is damaged: invalid literal; expected string literal, at 'a':1}");
    damaged("{\"a\":\n1e999}", "line 2, column 1: the number 1e999 is too large");
    damaged("{\"a\":" + std::string(5000, '9') + "}",
            "line 1, column 6: the number " + std::string(40, '9') + " ... is too large");
    damaged("{\"a\":[1,]}", "line 1, column 9: its JSON is damaged: unexpected ']'; expected a value, at ]}");
    damaged("{\"a\":\"" + std::string(5000, 'x'),
            "line 1, column 5007: its JSON is damaged: invalid string: missing closing quote");
    damaged(R"({"asset":{"version":"2.0"},"buffers":[{"byteLength":-1}]})",
            "the byteLength of buffer 0 is -1; it must be an integer that is not negative");
    damaged(R"({"asset":{"version":"2.0"},"buffers":[{"byteLength":0,"uri":"data:;base64,"}]})",
            "buffer 0: its byteLength is 0; it must be at least 1");
    damaged("[]", "its JSON is no object, as glTF's is");
}

TEST_CASE("glTF: buffers are regular files in the folder of the scene") {
    Gltf gltf = Gltf::cube();
    CHECK_THROWS_WITH(readScene(gltf.writeApart("apart.gltf", "missing.bin", "")), Catch::Contains("missing.bin"));
    CHECK_THROWS_WITH(readScene(gltf.writeApart("apart.gltf", "/dev/zero", "")), Catch::Contains("/dev/zero"));
    REQUIRE(mkfifo(test::scratch("fifo.bin").c_str(), 0600) == 0);
    CHECK_THROWS_WITH(readScene(gltf.writeApart("apart.gltf", "fifo.bin", "")), Catch::Contains("fifo.bin"));
    const std::string whole = gltf.bin;
    gltf.writeApart("apart.gltf", "short.bin", "short.bin");
    gltf.bin += std::string(100, ' ');
    const auto path = gltf.writeApart("apart.gltf", "short.bin", "");
    CHECK_THROWS_WITH(readScene(path), Catch::Contains("buffer 0: its byteLength is 268, but it has 175 bytes"));
    const auto data = [](const std::string& uri) {
        Gltf cube = Gltf::cube();
        return readScene(cube.writeApart("data.gltf", uri, ""));
    };
    CHECK_THROWS_WITH(data("data:application/octet-stream;base64,AAAA"), Catch::Contains("it has 3 bytes"));
    CHECK_THROWS_WITH(data("data:application/octet-stream;base64,A*AA"), Catch::Contains("'*'"));
    CHECK_THROWS_WITH(data("data:application/octet-stream,hello"), Catch::Contains("base64"));
    CHECK_THROWS_WITH(data("data:"), Catch::Contains("buffer 0"));
    std::string zeros = "data:;base64,";
    for (int i = 0; i < 100; ++i) zeros += "AAAA";
    CHECK(test::faceCount(data(zeros)) == 12);
}

TEST_CASE("glTF: binary files that end early, or are damaged, are refused") {
    Gltf gltf = Gltf::cube();
    const auto path = gltf.writeBinary("whole.glb");
    std::ifstream stream(path, std::ios::binary);
    const std::string whole{std::istreambuf_iterator<char>(stream), {}};
    const auto cut = test::scratch("cut.glb");
    for (std::size_t size = 0; size < whole.size(); size += size < 40 ? 1 : 7) {
        std::ofstream(cut, std::ios::binary) << whole.substr(0, size);
        CAPTURE(size);
        CHECK_THROWS_WITH(readScene(cut), Catch::Contains("cut.glb: "));
    }
    std::string other = whole;
    other[4] = 1;
    std::ofstream(cut, std::ios::binary) << other;
    CHECK_THROWS_WITH(readScene(cut), Catch::Contains("binary glTF 1; only glTF 2"));
}
