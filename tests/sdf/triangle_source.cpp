// SPDX-License-Identifier: Apache-2.0
// Triangles from files that are not read whole, and their files of tiles.
#include <bilayer/sdf/mesh_io.h>

#include <catch2/catch.hpp>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "demos/shared/shapes.h"
#include "sdf/tiles/tile_sort.h"
#include "sdf/tiles/triangle_source.h"
#include "tests/support/support.h"

namespace bilayer::triangle_source_test {
using namespace bilayer::detail;
using Catch::Contains;

namespace {

std::vector<TileTriangle> allOf(const TriangleSource& source) {
    std::vector<TileTriangle> all;
    source.forEach([&](std::span<const TileTriangle> batch) { all.insert(all.end(), batch.begin(), batch.end()); });
    return all;
}

// More triangles than a batch, one of them collapsed, and vertices that no triangle uses.
Mesh largeMesh() {
    Mesh mesh = shapes::sphere(1, 7);
    mesh.points.push_back({3, 3, 3});
    mesh.triangles.insert(mesh.triangles.begin() + 100, glm::uvec3(4, 4, 9));
    return mesh;
}

void writeBytes(const std::filesystem::path& path, const std::string& bytes) {
    std::ofstream(path, std::ios::binary) << bytes;
}

bool same(const std::vector<TileTriangle>& a, const std::vector<TileTriangle>& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(TileTriangle)) == 0;
}

}  // namespace

TEST_CASE("the triangles of a file are those of the mesh that is read whole") {
    for (const char* name : {"large.stl", "large.ply"}) {
        CAPTURE(name);
        const std::filesystem::path path = test::scratch(name);
        writeMesh(path, largeMesh());
        const Mesh mesh = readMesh(path);
        const auto file = trianglesOfFile(path), memory = trianglesOf(mesh);
        REQUIRE(file);
        CHECK(same(allOf(*file), allOf(*memory)));
        CHECK(file->facts().box.lower == memory->facts().box.lower);
        CHECK(file->facts().box.upper == memory->facts().box.upper);
        CHECK(file->facts().triangles == mesh.triangles.size());
        CHECK(file->facts().hash == 0);
        CHECK(memory->facts().hash == hash(mesh));
    }
}

TEST_CASE("files that must be read whole are recognised") {
    const std::filesystem::path obj = test::scratch("whole.obj"), far = test::scratch("far.ply"),
                                text = test::scratch("text.stl");
    writeMesh(obj, shapes::sphere(1, 2));
    CHECK(!trianglesOfFile(obj));
    Mesh moved = shapes::sphere(1, 2);
    moved.origin = {1e7, 0, 0};
    writeMesh(far, moved);  // with doubles
    CHECK(!trianglesOfFile(far));
    writeBytes(text, "solid a\nendsolid a\n");
    CHECK(!trianglesOfFile(text));
}

TEST_CASE("damaged files are refused by name") {
    const std::filesystem::path stl = test::scratch("damaged.stl"), ply = test::scratch("damaged.ply");
    writeMesh(stl, shapes::sphere(1, 2));
    writeMesh(ply, shapes::sphere(1, 2));
    const std::string facets = test::contentsOf(stl), faces = test::contentsOf(ply);
    const auto refused = [](const std::filesystem::path& path, const std::string& bytes, const std::string& why) {
        writeBytes(path, bytes);
        CHECK_THROWS_WITH(trianglesOfFile(path), Contains(path.filename().string()) && Contains(why));
    };
    const float nan = std::numeric_limits<float>::quiet_NaN(), far = 1e6f;
    std::string broken = facets;
    std::memcpy(&broken[84 + 50 * 7 + 12], &nan, sizeof nan);
    refused(stl, broken, "triangle 7, counted from 0, has a coordinate that is not finite");
    for (std::size_t i = 84; i < facets.size(); i += 50)
        for (std::size_t k = 0; k < 3; ++k) {
            float x = 0;
            std::memcpy(&x, &facets[i + 12 + 12 * k], sizeof x);
            x += far;
            std::memcpy(&broken[i + 12 + 12 * k], &x, sizeof x);
        }
    refused(stl, broken, "so far from zero");
    refused(ply, faces.substr(0, faces.size() - 3), "ends within its faces");
    refused(ply, faces.substr(0, 600), "ends within its vertices");
    broken = faces;
    broken[faces.size() - 1] = 0x70;
    refused(ply, broken, "has a corner beyond the 162 vertices");
}

TEST_CASE("triangles are sorted into one file per tile, in order") {
    const Mesh mesh = shapes::sphere(1, 6);
    const BuildOptions options{.voxelSize = 0.01f, .sign = Sign::normals};
    Tiling tiling(bounds(mesh), options, {3, 2, 2});
    const auto source = trianglesOf(mesh);
    const auto fileOf = [](std::size_t tile) { return test::scratch("tile" + std::to_string(tile)); };
    const std::vector<TileLoad> loads = sortTriangles(*source, tiling, options.voxelSize, fileOf);
    double area = 0;
    for (std::size_t tile = 0; tile < tiling.size(); ++tile) {
        std::vector<TileTriangle> expected;
        for (const TileTriangle& t : allOf(*source)) {
            const auto at = [&](int k) { return glm::dvec3(t.corners[k]) * (1.0 / double(options.voxelSize)); };
            tiling.forEachTileOf({at(0), at(1), at(2)}, [&](std::size_t of) {
                if (of == tile) expected.push_back(t);
            });
        }
        CHECK(same(readTileTriangles(fileOf(tile), loads[tile]), expected));
        if (expected.empty()) continue;
        const TileLoad more{loads[tile].triangles + 1, 0, loads[tile].hash},
            fewer{loads[tile].triangles - 1, 0, loads[tile].hash};
        for (const TileLoad& other : {more, fewer})
            CHECK_THROWS_WITH(readTileTriangles(fileOf(tile), other), Contains("is damaged"));
        std::fstream file(fileOf(tile), std::ios::binary | std::ios::in | std::ios::out);
        const auto at = std::streamoff(std::filesystem::file_size(fileOf(tile)) / 2);
        file.seekg(at);
        const auto byte = char(file.get() ^ 1);
        file.seekp(at);
        file.put(byte);
        file.close();
        CHECK_THROWS_WITH(readTileTriangles(fileOf(tile), loads[tile]), Contains("is damaged"));
        area += loads[tile].area;
    }
    // all of the sphere, and what two tiles share
    const double whole = 4 * 3.14159 * 100 * 100;
    CHECK(area > 0.99 * whole);
    CHECK(area < 1.5 * whole);
    // few large triangles: each tile counts only the parts in its reach
    const auto large = trianglesOf(shapes::box({2, 2, 2}));
    Tiling parts(large->facts().box, options, {4, 4, 4});
    double sum = 0;
    for (const TileLoad& load : sortTriangles(*large, parts, options.voxelSize, fileOf)) sum += load.area;
    CHECK(sum > 0.99 * 6 * 400 * 400);
    CHECK(sum < 3 * 6 * 400 * 400);
}
}  // namespace bilayer::triangle_source_test
