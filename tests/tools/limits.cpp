// SPDX-License-Identifier: Apache-2.0
// `bilayer` on sizes at and beyond its limits: refused by name before anything is built, or done. docs/limits.md lists
// them.
#include <catch2/catch.hpp>
#include <sstream>
#include <string>
#include <vector>

#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "tests/support/support.h"
#include "tests/tools/program.h"

namespace bilayer::limits_test {
using namespace bilayer::test;

namespace {

constexpr long memoryLimit = 4L << 30;  // of each run [bytes]
// Peak of a run that is refused before it allocates for its voxels [bytes].
constexpr std::size_t maxRefusedMemory = std::size_t(200) << 20;

std::string meshFile(const std::string& name, const Mesh& mesh) {
    const std::filesystem::path path = scratch(name);
    writeMesh(path, mesh);
    return path.string();
}

Mesh tetrahedron(float size) {
    return {{{0, 0, 0}, {size, 0, 0}, {0, size, 0}, {0, 0, size}}, {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
}

void requireRefused(Words words, const std::string& limit) {
    words.insert(words.end(), {"-o", rejectedOutput()});
    CAPTURE(words);
    const Result r = run(words, {.memoryLimit = memoryLimit});
    CAPTURE(r.err);
    CHECK(r.status == 1);
    CHECK(r.errorLines() == 1);
    CHECK(r.err.find(limit) != std::string::npos);
    CHECK(r.peakMemory < maxRefusedMemory);
    CHECK_FALSE(std::filesystem::exists(rejectedOutput()));
}

}  // namespace

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // they need terabytes of address space

TEST_CASE("sizes beyond a limit are refused at once, by the name of the limit") {
    const std::string unit = meshFile("unit.ply", tetrahedron(1)), wide = meshFile("wide.ply", tetrahedron(1000)),
                      large = meshFile("large.ply", tetrahedron(1e30f)),
                      tiny = meshFile("tiny.ply", tetrahedron(1e-30f)),
                      triangle = meshFile("triangle.ply", {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}});
    const std::string memory = "GiB of memory, and 4.0 GiB may be used", voxel = "below 2e-05, the smallest";
    // 7 * 10^9 voxels in the band
    requireRefused({"build", unit, "--resolution", "23000"}, memory);
    requireRefused({"seed", unit, "--resolution", "23000"}, memory);
    // 10^9
    requireRefused({"build", triangle, "--voxel-size", "5.5e-5"}, memory);
    requireRefused({"build", unit, "--resolution", "20", "--half-width", "1000"}, memory);
    for (const char* command : {"build", "seed"}) {
        requireRefused({command, unit, "--resolution", "1000000"}, voxel);
        requireRefused({command, tiny, "--resolution", "64"}, voxel);
        requireRefused({command, wide, "--resolution", "1000000"}, "2^28 cubes of 64^3 voxels");
        requireRefused({command, large, "--resolution", "64"}, "above 1e+15, the largest");
    }
    requireRefused({"build", large, "--voxel-size", "1"}, "index coordinates would leave 32 bits");
    requireRefused({"seed", large, "--voxel-size", "1"}, "out of range of these voxels");
}

TEST_CASE("the memory that a process may use limits its builds") {
    const auto buildAt = [](const std::string& resolution) {
        return run({"build", sphereFile().string(), "-o", scratch("limited.vdb"), "--resolution", resolution},
                   {.memoryLimit = 512L << 20});
    };
    CHECK(buildAt("300").status == 0);
    const Result r = buildAt("2400");
    CHECK(r.status == 1);
    CHECK(r.err.find("1.8 GiB of memory, and 0.5 GiB may be used") != std::string::npos);
}

#endif

TEST_CASE("coordinates of any magnitude are inspected") {
    for (const float size : {1e-30f, 1e-6f, 1e6f, 1e30f}) {
        const Result r = run({"inspect", meshFile("magnitude.ply", tetrahedron(size)), "--json"});
        CAPTURE(size, r.err);
        REQUIRE(r.status == 0);
        const double cube = double(size) * double(size) * double(size);
        CHECK(r.json()["volume"].get<double>() == Approx(cube / 6).epsilon(1e-5));
    }
}

TEST_CASE("thousands of components are one field") {
    std::vector<Mesh> parts;
    for (int x = 0; x < 20; ++x)
        for (int y = 0; y < 20; ++y)
            for (int z = 0; z < 20; ++z)
                parts.push_back(shapes::moved(tetrahedron(1), {2.f * float(x), 2.f * float(y), 2.f * float(z)}));
    const std::string mesh = meshFile("many.ply", shapes::join(parts)), field = scratch("many.vdb").string();
    const Result inspected = run({"inspect", mesh, "--json"});
    REQUIRE(inspected.status == 0);
    CHECK(inspected.json()["components"].get<int>() == 8000);
    CHECK(run({"build", mesh, "-o", field, "--resolution", "300", "--body"}).status == 0);
    const Result r = run({"query", field}, {.input = "10.2 10.2 10.2\n11.5 11.5 11.5\n38.2 38.2 38.2\n"});
    REQUIRE(r.status == 0);
    std::istringstream lines(r.out);
    std::vector<bool> inside;
    for (std::string line; std::getline(lines, line);) inside.push_back(std::stod(line) < 0);
    CHECK(inside == std::vector<bool>{true, false, true});
}
}  // namespace bilayer::limits_test
