// SPDX-License-Identifier: Apache-2.0
// glTF: errors in the JSON of a file.
#include <sys/stat.h>

#include <catch2/catch.hpp>
#include <fstream>
#include <functional>
#include <string>

#include "sdf/io/scenes/scene_io.h"
#include "tests/support/gltf.h"
#include "tests/support/gltf_refusals.h"
#include "tests/support/polygons.h"
#include "tests/support/support.h"

namespace bilayer::gltf_json_test {
using namespace bilayer::detail;
using namespace bilayer::test;
using nlohmann::json;

TEST_CASE("glTF: damaged parts are rejected by name") {
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

TEST_CASE("glTF: members of a wrong type or length are rejected with their text") {
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
    CHECK(volume(readGltf(gltf)) == 8);
    gltf.file["accessors"][0].erase("count");
    refuses(gltf, {"accessor 0 has no count"});
}

TEST_CASE("glTF: text of the file is quoted up to 40 bytes") {
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

TEST_CASE("glTF: damaged JSON is rejected with line and column, or with its text") {
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
}  // namespace bilayer::gltf_json_test
