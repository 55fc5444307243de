// SPDX-License-Identifier: Apache-2.0
// glTF: quantised, strided and sparse numbers.
#include <sys/stat.h>

#include <catch2/catch.hpp>

#include "tests/support/gltf.h"
#include "tests/support/gltf_refusals.h"
#include "tests/support/polygons.h"

namespace bilayer::gltf_numbers_test {
using namespace bilayer::detail;
using namespace bilayer::test;
using nlohmann::json;

namespace {

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

}  // namespace

TEST_CASE("glTF: quantised positions have the values of the specification") {
    const auto size = [](Gltf gltf) { return upper(readGltf(std::move(gltf))).x; };
    for (const bool required : {true, false}) {
        Gltf gltf = cubeOf(Gltf::Short, 100, false);
        gltf.file["extensionsUsed"] = {"KHR_mesh_quantization"};
        if (required) gltf.file["extensionsRequired"] = {"KHR_mesh_quantization"};
        CHECK(volume(readGltf(gltf)) == 8e6);
    }
    CHECK(size(cubeOf(Gltf::Byte, 127, true)) == 1);
    CHECK(size(cubeOf(Gltf::Byte, 100, false)) == 100);
    CHECK(size(cubeOf(Gltf::Short, 32767, true)) == 1);
    CHECK(size(cubeOf(Gltf::Short, 16000, true)) == 16000 / 32767.0);
    // -128 is -1 too
    Gltf gltf = cubeOf(Gltf::Byte, 127, true);
    gltf.bin[std::size_t(gltf.file["bufferViews"].back()["byteOffset"])] = char(-128);
    CHECK(lower(readGltf(gltf)).x == -1);
    const std::vector<double> corner{0, 0, 0, 255, 0, 0, 0, 51, 0};
    for (const auto& [type, one] : {std::pair(Gltf::UnsignedByte, 255.0), std::pair(Gltf::UnsignedShort, 65535.0)}) {
        Gltf part = Gltf::cube();
        const int points = part.accessor(corner, type, "VEC3");
        part.file["accessors"][std::size_t(points)]["normalized"] = true;
        primitive(part) = {{"attributes", {{"POSITION", points}}}};
        CHECK(upper(readGltf(part)) == glm::dvec3(255 / one, 51 / one, 0));
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
    CHECK(volume(readGltf(gltf)) == 8);
    // vertex 7 moves outward; then all vertices are sparse
    const auto sparse = [&](const std::vector<double>& which, const std::vector<double>& numbers) {
        return json{{"count", which.size()},
                    {"indices", {{"bufferView", gltf.view(which, Gltf::UnsignedByte)}, {"componentType", 5121}}},
                    {"values", {{"bufferView", gltf.view(numbers, Gltf::Float)}}}};
    };
    gltf.file["accessors"][0]["sparse"] = sparse({7}, {1, 1, 4});
    CHECK(upper(readGltf(gltf)).z == 4);
    std::vector<double> all;
    for (const glm::vec3& p : test::cubePoints()) all.insert(all.end(), {2 * p.x, 2 * p.y, 2 * p.z});
    gltf.file["accessors"][0]["sparse"] = sparse({0, 1, 2, 3, 4, 5, 6, 7}, all);
    gltf.file["accessors"][0].erase("bufferView");
    CHECK(volume(readGltf(gltf)) == 64);
    gltf.file["accessors"][0]["sparse"] = sparse({8}, {0, 0, 0});
    refuses(gltf, {"accessor 0", "element 8 of 8"});
    gltf.file["accessors"][0].erase("sparse");
    refuses(gltf, {"accessor 0", "neither a buffer view"});
}
}  // namespace bilayer::gltf_numbers_test
