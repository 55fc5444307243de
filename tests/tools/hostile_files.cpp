// SPDX-License-Identifier: Apache-2.0
// `bilayer` on .vdb files that were made to harm: names and structures that no program writes.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <string>

#include "tests/support/support.h"
#include "tests/tools/program.h"

namespace bilayer::hostile_files_test {
using namespace bilayer::test;

namespace {

constexpr std::size_t checksumSize = 23;     // of the line at the end, which files of other programs lack [bytes]
constexpr std::size_t maxErrorBytes = 1000;  // [bytes]

// A text as OpenVDB stores it.
std::string stored(const std::string& text) {
    const auto size = std::uint32_t(text.size());
    return std::string(reinterpret_cast<const char*>(&size), sizeof size) + text;
}

std::string foreignField() {
    const std::string file = contents(fieldFile());
    return file.substr(0, file.size() - checksumSize);
}

std::string withEntry(const std::string& file, const std::string& name, const std::string& value) {
    const std::string head = stored(name) + stored("string");
    const std::size_t at = file.find(head) + head.size();
    REQUIRE(at >= head.size());
    std::uint32_t size = 0;
    std::memcpy(&size, file.data() + at, sizeof size);
    return file.substr(0, at) + stored(value) + file.substr(at + sizeof size + size);
}

bool steersTerminal(const std::string& text) {
    return std::any_of(text.begin(), text.end(),
                       [](char c) { return (static_cast<unsigned char>(c) < ' ' && c != '\n') || c == '\x7f'; });
}

}  // namespace

TEST_CASE("names in a file make no long error and steer no terminal") {
    for (const std::string& name : {std::string(1000000, ' '), std::string(100000, '\n'), std::string(1000000, 'a'),
                                    std::string("\x1b[31m\n\x7f \r \xc2\x9b")}) {
        const std::string named = withEntry(foreignField(), "name", name);
        const std::string path = textFile("named.vdb", named).string();
        const Result info = run({"info", path});
        CHECK(info.status == 0);
        CHECK_FALSE(steersTerminal(info.out));
        CHECK(info.out.find("\xc2\x9b") == std::string::npos);
        textFile("named.vdb", withEntry(named, "bilayer:sign", "none"));
        for (const char* command : {"info", "query"}) {
            const Result r = run({command, path});
            CHECK(r.status == 1);
            CHECK(r.errorLines() == 1);
            CHECK(r.err.size() < maxErrorBytes);
            CHECK_FALSE(steersTerminal(r.err));
        }
    }
}

TEST_CASE("frustums within frustums are refused, however deep") {
    const std::string file = foreignField(), map = stored("UniformScaleMap");
    const std::size_t at = file.find(map);
    REQUIRE(at != std::string::npos);
    const std::string frustum = stored("NonlinearFrustumMap") + std::string(8 * sizeof(double), '\0');
    for (const int depth : {2, 100000}) {
        std::string nested = file.substr(0, at);
        for (int i = 0; i < depth; ++i) nested += frustum;
        const Result r = run({"info", textFile("nested.vdb", nested + file.substr(at)).string()});
        CAPTURE(depth, r.err);
        CHECK(r.status == 1);
        CHECK(r.errorLines() == 1);
        CHECK(r.err.find("a transform of unknown type") != std::string::npos);
    }
}
}  // namespace bilayer::hostile_files_test
