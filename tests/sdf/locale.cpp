// SPDX-License-Identifier: Apache-2.0
// The locale of the program that calls the library changes no file and no number: decimal commas and grouped digits.
#include <catch2/catch.hpp>
#include <clocale>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <locale>
#include <string>
#include <vector>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/inspect.h>
#include <bilayer/sdf/mesh_io.h>
#include <bilayer/sdf/nanovdb.h>
#include <bilayer/sdf/vdb_io.h>
#include "demos/shared/shapes.h"
#include "tests/support/same_fields.h"
#include "tests/support/support.h"

namespace bilayer::locale_test {
namespace {

struct Commas : std::numpunct<char> {
    char do_decimal_point() const override { return ','; }
    char do_thousands_sep() const override { return '.'; }
    std::string do_grouping() const override { return "\3"; }
};

// Sets decimal commas for C++'s streams, and for C's functions where a German locale can be made.
class CommaLocale {
  public:
    CommaLocale() : streams_(std::locale::global(std::locale(std::locale(), new Commas))) {
        const std::string folder = test::scratch("locales").string();
        std::filesystem::create_directories(folder);
        ::setenv("LOCPATH", folder.c_str(), 1);
        const std::string make = "localedef -i de_DE -f UTF-8 '" + folder + "/de_DE.UTF-8' >/dev/null 2>&1";
        if (std::system(make.c_str()) != 0 || !std::setlocale(LC_ALL, "de_DE.UTF-8"))
            WARN("localedef makes no German locale: C's functions keep their decimal points");
        else
            REQUIRE(std::localeconv()->decimal_point == std::string(","));
    }
    ~CommaLocale() {
        std::setlocale(LC_ALL, "C");
        std::locale::global(streams_);
        ::unsetenv("LOCPATH");
    }

  private:
    std::locale streams_;
};

// What the library makes of a mesh: the bytes of each file, and texts with numbers.
std::vector<std::string> everythingOf(const Mesh& mesh) {
    std::vector<std::string> all;
    for (const char* ending : {".obj", ".ply", ".stl"}) {
        const std::filesystem::path path = test::scratch(std::string("locale") + ending);
        writeMesh(path, mesh);
        all.push_back(test::contentsOf(path));
        const Mesh again = readMesh(path);
        CHECK(again.triangles.size() == mesh.triangles.size());
        all.push_back(std::to_string(inspect(again).triangles));
    }
    const LevelSet field = build(mesh, {.voxelSize = 100.5f});
    writeVdb(test::scratch("locale.vdb"), field);
    const LevelSet read = readVdb(test::scratch("locale.vdb"));  // the file itself has a random identifier
    CHECK(test::sameTrees(*read.grids().distance, *field.grids().distance));
    CHECK(read.errorBound() == field.errorBound());
    CHECK(read.voxelSize() == field.voxelSize());
    writeNanoVdb(test::scratch("locale.nvdb"), field);
    all.push_back(test::contentsOf(test::scratch("locale.nvdb")));
    try {
        (void)build(mesh, {.voxelSize = 1.5e-6f});
    } catch (const std::invalid_argument& error) {
        all.push_back(error.what());
    }
    return all;
}

Mesh readText(const char* name, const std::string& text) {
    const std::filesystem::path path = test::scratch(name);
    std::ofstream(path, std::ios::binary) << text;
    return readMesh(path);
}

}  // namespace

TEST_CASE("decimal commas in the locale change no file and no text") {
    const Mesh mesh = shapes::moved(shapes::sphere(1234.567f, 3), {0.125f, 98765.4f, -1.5e-3f});
    const std::vector<std::string> expected = everythingOf(mesh);
    const CommaLocale commas;
    CHECK(everythingOf(mesh) == expected);
}

TEST_CASE("decimal points in text files are read in a locale of decimal commas") {
    const std::string points = "1000.25 0 0\n0.5 1 0\n-0.125 0 1e-2\n";
    const CommaLocale commas;
    const Mesh meshes[] = {
        readText("point.obj", "v 1000.25 0 0\nv 0.5 1 0\nv -0.125 0 1e-2\nf 1 2 3\n"),
        readText("point.off", "OFF\n3 1 0\n" + points + "3 0 1 2\n"),
        readText("point.raw", "1000.25 0 0 0.5 1 0 -0.125 0 1e-2\n"),
        readText("point.ply",
                 "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty "
                 "float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n" +
                     points + "3 0 1 2\n"),
        readText("point.stl",
                 "solid a\nfacet normal 0 0 1\nouter loop\nvertex 1000.25 0 0\nvertex 0.5 1 0\nvertex "
                 "-0.125 0 1e-2\nendloop\nendfacet\nendsolid\n"),
        readText("point.gltf",
                 R"({"asset":{"version":"2.0"},"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,"scale":[1000.25,0.5,1]}],)"
                 R"("meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"accessors":[{"bufferView":0,)"
                 R"("componentType":5126,"count":3,"type":"VEC3"}],"bufferViews":[{"buffer":0,"byteLength":36}],)"
                 R"("buffers":[{"byteLength":36,"uri":"data:application/octet-stream;base64,)"
                 R"(AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]})")};
    for (const Mesh& mesh : meshes) {
        REQUIRE(mesh.triangles.size() == 1);
        const Bounds box = bounds(mesh);
        CHECK(box.upper.x == 1000.25f);
        CHECK((box.upper.y == 1 || box.upper.y == 0.5f));
    }
}
}  // namespace bilayer::locale_test
