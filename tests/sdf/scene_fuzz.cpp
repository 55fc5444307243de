// SPDX-License-Identifier: Apache-2.0
// Damaged scene files: each is read, or refused by a one-line message that names it. BILAYER_FUZZ multiplies the
// rounds.
#include <catch2/catch.hpp>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <random>
#include <stdexcept>
#include <string>

#include <bilayer/sdf/mesh_io.h>
#include "sdf/io/scene_io.h"
#include "tests/support/gltf.h"
#include "tests/support/scene_files.h"
#include "tests/support/support.h"

using namespace bilayer;
using namespace bilayer::detail;
using bilayer::test::SceneFile;

namespace {

class Damage {
  public:
    explicit Damage(unsigned seed) : engine_(seed) {}

    std::size_t below(std::size_t count) { return std::uniform_int_distribution<std::size_t>(0, count - 1)(engine_); }

    // Applies one to four changes, each of a random kind.
    std::string of(std::string bytes) {
        for (std::size_t changes = 1 + below(4); changes > 0; --changes) change(bytes);
        return bytes;
    }

  private:
    void change(std::string& bytes) {
        if (bytes.empty()) bytes.push_back('x');
        const std::size_t at = below(bytes.size()), length = 1 + below(std::min<std::size_t>(bytes.size() - at, 40));
        switch (below(8)) {
            case 0:
                bytes[at] = char(bytes[at] ^ (1 << below(8)));
                break;
            case 1:
                bytes[at] = char(below(256));
                break;
            case 2:
                bytes.resize(at);
                break;
            case 3:
                bytes.erase(at, length);
                break;
            case 4:
                bytes.insert(at, bytes.substr(at, length));
                break;
            case 5:
                overwrite(bytes, at, oddNumber());
                break;
            case 6:
                replaceNumber(bytes, at);
                break;
            default:
                bytes.insert(at, noise(length));
                break;
        }
    }

    static std::string spliced(const std::string& bytes, std::size_t at, std::size_t removed,
                               const std::string& added) {
        return bytes.substr(0, at) + added + bytes.substr(at + removed);
    }

    static void overwrite(std::string& bytes, std::size_t at, std::uint32_t number) {
        for (std::size_t k = 0; k < 4 && at + k < bytes.size(); ++k) bytes[at + k] = char(number >> (8 * k));
    }

    std::uint32_t oddNumber() {
        constexpr std::uint32_t numbers[]{0, 1, 2, 255, 65535, 65536, 0x7fffffff, 0x80000000, 0xffffffff, 0x7fc00000};
        return below(2) ? numbers[below(std::size(numbers))] : std::uint32_t(below(300));
    }

    // Replaces the first number in the text from this position on.
    void replaceNumber(std::string& bytes, std::size_t at) {
        constexpr const char* numbers[]{"",    "-1",          "0",   "1e999", "nan",  "99999999999999999999",
                                        "255", "-2147483649", "0x1", "1e",    "\"\"", "4294967295"};
        const std::size_t first = bytes.find_first_of("0123456789", at);
        if (first == std::string::npos) return;
        const std::size_t end = std::min(bytes.find_first_not_of("0123456789.", first), bytes.size());
        bytes = spliced(bytes, first, end - first, numbers[below(std::size(numbers))]);
    }

    std::string noise(std::size_t length) {
        std::string text;
        for (std::size_t i = 0; i < length; ++i) text += char(below(4) ? below(4) : below(256));
        return text;
    }

    std::mt19937 engine_;
};

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
