// SPDX-License-Identifier: Apache-2.0
// Damaged scene files: each is read, or refused by a one-line message that names it. BILAYER_FUZZ multiplies the
// rounds.
#include <catch2/catch.hpp>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <stdexcept>
#include <string>

#include <bilayer/sdf/mesh_io.h>
#include "sdf/io/scene_io.h"
#include "tests/support/damage.h"
#include "tests/support/gltf.h"
#include "tests/support/scene_files.h"
#include "tests/support/support.h"

namespace bilayer::scene_fuzz_test {
using namespace bilayer::detail;
using bilayer::test::Damage;
using bilayer::test::SceneFile;

namespace {

std::size_t rounds(std::size_t usual) {
    const char* const factor = std::getenv("BILAYER_FUZZ");
    return factor ? usual * std::strtoul(factor, nullptr, 10) : usual;
}

// The fault in how a file was read, or nothing
std::string complaint(const SceneFile& file) {
    constexpr ChildLimits limits{std::chrono::seconds(1), std::size_t(1) << 30};
    const auto path = test::scratch(file.name);
    std::ofstream(path, std::ios::binary) << file.bytes;
    try {
        readScene(path, limits);
        readMesh(path);
    } catch (const std::exception& error) {
        const std::string text = error.what();
        if (text.find(path.string() + ": ") != 0) return "does not name the file: " + text;
        if (text.find('\n') != std::string::npos) return "more than a line: " + text;
        if (text.size() > path.string().size() + 500) return "too long: " + text;
        if (text.find("damaged answer") != std::string::npos) return text;
        for (const char* jargon : {"std::", "::_M_", "basic_string", "stoi", "stol", "json.exception", "exception"})
            if (text.find(jargon) != std::string::npos) return "not in plain words: " + text;
    }
    return {};
}

void requireAnswer(const SceneFile& file, std::size_t count, Damage& damage) {
    for (std::size_t i = 0; i < count; ++i) {
        const SceneFile damaged{file.name, damage.of(file.bytes)};
        const std::string wrong = complaint(damaged);
        if (wrong.empty()) continue;
        CAPTURE(file.name, i);
        FAIL_CHECK(wrong);
    }
}

}  // namespace

TEST_CASE("damaged files of Assimp's formats are read or refused") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Damage damage(seed);
    for (const SceneFile& file : test::cubeFiles()) requireAnswer(file, rounds(20), damage);
    for (const SceneFile& file : test::headFiles()) {
        CHECK(complaint(file) == "");
        // a header alone, and one followed by other bytes
        for (std::size_t i = 0; i < rounds(10); ++i) {
            std::string bytes = file.bytes;
            for (std::size_t k = damage.below(400); k > 0; --k)
                bytes += char(damage.below(3) ? damage.below(9) : damage.below(256));
            CAPTURE(file.name);
            CHECK(complaint({file.name, bytes}) == "");
        }
    }
    std::vector<SceneFile> parts = test::parts3mf();
    for (std::size_t i = 0; i < rounds(20); ++i) {
        std::vector<SceneFile> damaged = parts;
        std::string& bytes = damaged[damage.below(parts.size())].bytes;
        bytes = damage.of(bytes);
        CHECK(complaint({"inside.3mf", test::zip(damaged)}) == "");
    }
}

TEST_CASE("damaged glTF files are read or refused") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Damage damage(seed);
    test::Gltf gltf = test::Gltf::cube();
    gltf.file["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {
        {"TRANSLATION", gltf.points({{0, 0, 0}, {5, 0, 0}})}};
    gltf.file["skins"] = {{{"joints", {0}}}};
    gltf.file["accessors"][0]["sparse"] = {
        {"count", 1},
        {"indices", {{"bufferView", gltf.view({7}, test::Gltf::UnsignedByte)}, {"componentType", 5121}}},
        {"values", {{"bufferView", gltf.view({1, 1, 1}, test::Gltf::Float)}}}};
    for (const std::string name : {"fuzz.gltf", "fuzz.glb"}) {
        const auto path = name == "fuzz.glb" ? gltf.writeBinary(name) : gltf.write(name);
        std::ifstream stream(path, std::ios::binary);
        const std::string bytes{std::istreambuf_iterator<char>(stream), {}};
        CHECK(complaint({name, bytes}) == "");
        requireAnswer({name, bytes}, rounds(200), damage);
    }
}
}  // namespace bilayer::scene_fuzz_test
