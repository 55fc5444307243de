// SPDX-License-Identifier: Apache-2.0
// The first inputs of each check: small valid files in each style that a reader knows, and recipes.
#include <fmt/format.h>

#include <cstring>
#include <string>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include <bilayer/sdf/vdb_io.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "tests/fuzz/checks.h"
#include "tests/support/scene_files.h"
#include "tests/support/support.h"

namespace bilayer::test {
namespace {

using Seeds = std::vector<std::string>;

std::string written(const char* name, const Mesh& mesh) {
    const std::filesystem::path path = scratch(name);
    writeMesh(path, mesh);
    return contentsOf(path);
}

/// The bytes of a literal, zeros included.
template <std::size_t size>
std::string raw(const char (&bytes)[size]) {
    return {bytes, size - 1};
}

std::string utf16(const std::string& text) {
    std::string bytes;
    for (const char c : text) bytes += std::string{c, '\0'};
    return bytes;
}

Mesh smallBox() {
    return shapes::box({1, 2, 3});
}

Seeds objSeeds() {
    return {written("seed.obj", smallBox()),
            "# comment\nmtllib a.mtl\no box\nv 0 0 0 1\nv 1 0 0 1 0 0\nv 1e0 +1.0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n"
            "f 1/1/1 2//1 3/1 4\nf -4 -3 \\\n -1\nl 1 2\nfo 1 2 3\n",
            "\xef\xbb\xbfv 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nv 0 0 1\r\nf 1 2 3\r\nf 1 2 4 3\r\n",
            "v 1000000 0 0\nv 1000001 0 0\nv 1000000 1 0\nf 1 2 3\n",
            "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 1 0\nv 0 4 0\nv 1 1 0\nf 1 2 3 4 5 6\nf 6 5 4 3 2 1\n",
            utf16("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")};
}

Seeds plySeeds() {
    const std::string head = "ply\nformat {} 1.0\ncomment made by hand\n", vertices = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n";
    return {written("seed.ply", smallBox()),
            "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
            "element face 2\nproperty list uchar int vertex_indices\nend_header\n" +
                vertices + "3 0 1 2\n4 0 1 2 3\n",
            "ply\rformat ascii 1.0\relement face 1\rproperty list int uint vertex_index\relement vertex 4\r"
            "property double x\rproperty double y\rproperty double z\rproperty uchar red\rend_header\r3 0 1 3\r"
            "0 0 0 1\r1 0 0 2\r0 1 0 3\r0 0 1 4\r",
            "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
            "element tristrips 1\nproperty list int int vertex_indices\nend_header\n" +
                vertices + "6 0 1 2 -1 3 1\n",
            "ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty short x\nproperty char y\n"
            "property ushort z\nelement face 1\nproperty list uchar float vertex_indices\nproperty list uchar short w\n"
            "end_header\n" +
                raw("\0\1\0\0\0\0\2\1\0\0\0\3\0\1\0") + raw("\3\0\0\0\0\x3f\x80\0\0\x40\0\0\0\1\0\7")};
}

Seeds stlSeeds() {
    const std::string facet =
        "facet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1 0 0\n  vertex 0 1 0\n"
        " endloop\nendfacet\n";
    return {written("seed.stl", shapes::sphere(1, 0)), "solid a\n" + facet + "endsolid a\n",
            "# comment\nSOLID\n" + facet + facet + "ENDSOLID\nsolid b\n" + facet + "endsolid b\nrest\n"};
}

Seeds offSeeds() {
    const std::string points = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n", faces = "3 0 1 2\n4 0 1 3 2\n";
    return {"OFF\n4 2 0\n" + points + faces, "OFF 4 2\n" + points + faces, "OFF\n# comment\n4 2 0\n\n" + points + faces,
            "COFF\n3 1 0\n0 0 0 1 0 0 1\n1 0 0 1 0 0 1\n0 1 0 1 0 0 1\n3 0 1 2 255 0 0\n",
            "STNOFF 3 1 0 0 0 0 0 0 1 0 0 1 0 0 0 0 1 1 0 0 1 0 0 0 1 0 1 3 0 1 2\n"};
}

Seeds rawSeeds() {
    return {"0 0 0 1 0 0 0 1 0\n0 0 0 0 1 0 0 0 1\n", "box\n0.5 0.5 0.5 0 0 0 1 0 0 0 1 0\n# end\n",
            "0 0 0 1 0 0 0 1 0 wood\n"};
}

/// A triangle with a sparse accessor, a skin, instances and nodes; `bin` empty: the buffer is in the text.
std::string gltfText(bool hasData) {
    return fmt::format(
        R"({{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0,"skin":0,"children":[1],)"
        R"("extensions":{{"EXT_mesh_gpu_instancing":{{"attributes":{{"TRANSLATION":0}}}}}}}},)"
        R"({{"mesh":0,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,2,0,0,1]}}],"skins":[{{"joints":[0,1]}}],)"
        R"("meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"mode":4}}]}}],)"
        R"("accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","sparse":{{"count":1,)"
        R"("indices":{{"bufferView":1,"componentType":5121}},"values":{{"bufferView":0}}}}}},)"
        R"({{"bufferView":1,"componentType":5121,"count":3,"type":"SCALAR"}}],)"
        R"("bufferViews":[{{"buffer":0,"byteLength":36}},{{"buffer":0,"byteOffset":36,"byteLength":3}}],)"
        R"("buffers":[{{"byteLength":39{}}}]}})",
        hasData
            ? R"(,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAEC")"
            : "");
}

template <class Value>
void append(std::string& bytes, Value value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

std::string glb(std::string text, const std::string& binary) {
    text.resize((text.size() + 3) / 4 * 4, ' ');
    std::string file = "glTF";
    append(file, std::uint32_t(2));
    append(file, std::uint32_t(12 + 8 + text.size() + 8 + binary.size()));
    append(file, std::uint32_t(text.size()));
    file += "JSON" + text;
    append(file, std::uint32_t(binary.size()));
    return file + raw("BIN\0") + binary;
}

std::string triangleGlb() {
    std::string binary;
    for (const float x : {0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 0.f, 1.f, 0.f}) append(binary, x);
    return glb(gltfText(false), binary + raw("\0\1\2\0"));
}

/// A skinned strip, a fan of quantised positions, two scenes and a turned node.
std::string skinnedGlb() {
    const char* const text =
        R"({"asset":{"version":"2.0"},"extensionsUsed":["KHR_mesh_quantization","KHR_materials_unlit"],)"
        R"("extensionsRequired":["KHR_mesh_quantization"],"scene":1,"scenes":[{"nodes":[1]},{"nodes":[0,1]}],)"
        R"("nodes":[{"mesh":0,"skin":0},{"mesh":1,"rotation":[0,0,1,0],"scale":[1,-2,1],"translation":[0,0,1]}],)"
        R"("skins":[{"joints":[1,0],"inverseBindMatrices":4}],"meshes":[{"primitives":[{"attributes":{"POSITION":0,)"
        R"("JOINTS_0":2,"WEIGHTS_0":3},"indices":1,"mode":5}]},{"primitives":[{"attributes":{"POSITION":5},"mode":6}]}],)"
        R"("accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"},)"
        R"({"bufferView":1,"componentType":5123,"count":4,"type":"SCALAR"},)"
        R"({"bufferView":2,"componentType":5121,"count":4,"type":"VEC4"},)"
        R"({"bufferView":3,"componentType":5121,"normalized":true,"count":4,"type":"VEC4"},)"
        R"({"bufferView":4,"componentType":5126,"count":2,"type":"MAT4"},)"
        R"({"bufferView":5,"componentType":5122,"normalized":true,"count":4,"type":"VEC3"}],)"
        R"("bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":8},)"
        R"({"buffer":0,"byteOffset":56,"byteLength":16},{"buffer":0,"byteOffset":72,"byteLength":16},)"
        R"({"buffer":0,"byteOffset":88,"byteLength":128},{"buffer":0,"byteOffset":216,"byteLength":32,"byteStride":8}],)"
        R"("buffers":[{"byteLength":248}]})";
    std::string binary;
    for (const float x : {0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 0.f, 1.f, 0.f, 1.f, 1.f, 1.f}) append(binary, x);
    for (const std::uint16_t index : {0, 1, 2, 3}) append(binary, index);
    binary += raw("\0\1\0\0\1\0\0\0\0\1\0\0\1\0\0\0");
    binary += raw("\xff\0\0\0\x80\x7f\0\0\xff\0\0\0\xff\0\0\0");
    for (int i = 0; i < 32; ++i) append(binary, i % 16 % 5 == 0 ? 1.f : 0.f);
    for (int i = 0; i < 16; ++i) append(binary, std::int16_t(i * i * 1000));
    return glb(text, binary);
}

Seeds gltfSeeds() {
    return {gltfText(true), triangleGlb(), skinnedGlb()};
}

/// The first byte is the number of the format; see checkScenes(). Small bytes behind a header are counts and sizes.
Seeds sceneSeeds() {
    std::string smallBytes;
    for (int i = 0; i < 400; ++i) smallBytes += char(i % 9);
    Seeds seeds;
    char format = 0;
    for (const SceneFile& file : sceneFiles()) {
        seeds.push_back(format + file.bytes);
        seeds.push_back(format++ + file.bytes + smallBytes);
    }
    for (const SceneFile& part : parts3mf()) seeds.push_back(format++ + part.bytes);
    return seeds;
}

/// A dense array of distances, clamped to the band, as other programs write it.
openvdb::FloatGrid::Ptr denseGrid(const LevelSet& levelSet) {
    const openvdb::FloatGrid::Ptr grid = levelSet.grids().distance->deepCopy();
    grid->removeMeta(metadata::interiorWidth);
    grid->removeMeta(metadata::version);
    for (auto leaf = grid->tree().beginLeaf(); leaf; ++leaf) leaf->setValuesOn();
    return grid;
}

Seeds vdbSeeds() {
    Mesh mesh = shapes::box({0.2f, 0.15f, 0.1f});
    const BuildOptions options{.voxelSize = 0.2f, .exteriorWidthVoxels = 1, .interiorWidthVoxels = 1};
    const LevelSet plain = build(mesh, options);
    mesh.origin = {5e6, 1e5, -200};
    const LevelSet far = build(mesh, options);
    const std::filesystem::path path = scratch("seed.vdb");
    constexpr std::size_t checksumSize = 23;  // without it, as in files of other programs
    Seeds seeds;
    const auto keep = [&] {
        const std::string file = contentsOf(path);
        seeds.push_back(file.substr(0, file.size() - checksumSize));
    };
    writeVdb(path, withBody(far, mesh));
    keep();
    writeVdb(path, plain, {.halfFloat = true});
    keep();
    writeGrids(path, {denseGrid(plain)});
    keep();
    return seeds;
}

/// Recipes are any bytes: some that differ early.
Seeds recipeSeeds() {
    Seeds seeds;
    for (int kind = 0; kind < 12; ++kind) {
        std::string recipe;
        for (int i = 0; i < 120; ++i) recipe += char(i < 4 ? kind * (i + 1) : (kind * 31 + i * i * 7) % 251);
        seeds.push_back(recipe);
    }
    return seeds;
}

}  // namespace

const std::vector<FuzzCheck>& fuzzChecks() {
    static const std::vector<FuzzCheck> checks{
        {"obj",
         2000,
         checkObj,
         objSeeds,
         {"v ", "f ", "vt ", "vn ", "l ", "fo ", "-1", "/", "//", "\\\n", "\r\n", "1e38", "nan", "1e-46", "99999999"}},
        {"ply",
         2000,
         checkPly,
         plySeeds,
         {"element face ", "element vertex ", "element tristrips ", "property list ", "uchar ", "int ", "double ",
          "float ", "vertex_indices", "vertex_index", "end_header\n", "binary_little_endian", "binary_big_endian",
          "ascii", "-1", "4294967295", "18446744073709551615", "\r\n"}},
        {"stl", 2000, checkStl, stlSeeds, {"facet", "endfacet", "vertex ", "solid ", "endsolid", "outer loop", "nan"}},
        {"off", 2000, checkOff, offSeeds, {"OFF", "COFF", "NOFF", "STOFF", "4OFF", "nOFF", "BINARY", "#", "99999999"}},
        {"raw", 2000, checkRaw, rawSeeds, {" 0 0 0", "1 0 0 ", "#", "inf", "1e39"}},
        {"gltf",
         4000,
         checkGltf,
         gltfSeeds,
         {"\"bufferView\"",
          "\"sparse\"",
          "\"count\"",
          "\"type\"",
          "\"VEC3\"",
          "\"MAT4\"",
          "\"SCALAR\"",
          "5121",
          "5123",
          "5125",
          "5126",
          "\"normalized\":true",
          "\"byteStride\":",
          "\"matrix\"",
          "\"rotation\"",
          "\"scale\"",
          "\"mode\":5",
          "\"mode\":6",
          "\"children\"",
          "\"JOINTS_0\"",
          "\"WEIGHTS_0\"",
          "18446744073709551615",
          "1e999",
          "-1"}},
        {"scenes", 8000, checkScenes, sceneSeeds},
        {"scene_parts", 300, checkSceneParts, recipeSeeds},
        {"build", 200, checkBuild, recipeSeeds},
        {"inspect", 200, checkInspect, recipeSeeds},
        {"vdb",
         100000,
         checkVdb,
         vdbSeeds,
         {"NonlinearFrustumMap", "UniformScaleMap", "AffineMap", "Tree_bool_5_4_3", "Tree_string_5_4_3", "float",
          "string", "vec3s", "__delayedload", "Tree_float_5_4_3_HalfFloat", "Tree_ptdataidx32_5_4_3"}},
        {"vdb_entries", 200, checkVdbEntries, recipeSeeds},
        {"tiles", 200, checkTiles, recipeSeeds},
        {"queries", 300, checkQueries, recipeSeeds},
        {"contacts", 200, checkContacts, recipeSeeds},
        {"rebuild", 200, checkRebuild, recipeSeeds},
    };
    return checks;
}

}  // namespace bilayer::test
