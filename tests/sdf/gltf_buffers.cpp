// SPDX-License-Identifier: Apache-2.0
// glTF: buffers in files, data URIs and binary chunks.
#include <sys/stat.h>

#include <catch2/catch.hpp>
#include <fstream>
#include <iterator>
#include <string>

#include "sdf/io/scenes/scene_io.h"
#include "tests/support/gltf.h"
#include "tests/support/polygons.h"
#include "tests/support/support.h"

namespace bilayer::gltf_buffers_test {
using namespace bilayer::detail;
using namespace bilayer::test;

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

TEST_CASE("glTF: truncated and damaged binary files are rejected") {
    Gltf gltf = Gltf::cube();
    const auto path = gltf.writeBinary("whole.glb");
    const std::string whole = test::contentsOf(path);
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
}  // namespace bilayer::gltf_buffers_test
