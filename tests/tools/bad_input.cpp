// SPDX-License-Identifier: Apache-2.0
// `bilayer` on input that it must reject: status 1 and one line that names the cause.
#include <sys/stat.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <fstream>

#include "tests/support/support.h"
#include "tests/tools/program.h"

namespace bilayer::bad_input_test {
using namespace bilayer::test;

namespace {

// Checks for status 1, one line on stderr with `culprit` in it, nothing on stdout.
void requireFault(const Words& words, const std::string& culprit, const Surroundings& surroundings = {}) {
    std::string command;
    for (const std::string& word : words) command += word + " ";
    const Result r = run(words, surroundings);
    INFO(command << "\n" << r.err);
    CHECK(r.status == 1);
    CHECK(r.errorLines() == 1);
    CHECK(r.err.find(culprit) != std::string::npos);
    CHECK(r.out.empty());
}

std::filesystem::path cut(const std::filesystem::path& path, const std::string& name, double part) {
    const std::filesystem::path copy = scratch(name);
    std::filesystem::copy_file(path, copy, std::filesystem::copy_options::overwrite_existing);
    std::filesystem::resize_file(copy, std::uintmax_t(part * double(std::filesystem::file_size(copy))));
    return copy;
}

}  // namespace

TEST_CASE("meshes that cannot be read") {
    requireFault(rejectedBuild(scratch("absent.obj")), "absent.obj");
    requireFault({"inspect", scratch("absent.obj").string()}, "absent.obj");
    requireFault(rejectedBuild(scratch("")), scratch("").string());
    requireFault(rejectedBuild(textFile("empty.obj", "")), "empty.obj");
    requireFault(rejectedBuild(textFile("points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n")), "points.obj");
    requireFault(rejectedBuild(textFile("noise.ply", "ply\nformat nonsense\n")), "noise.ply");
    requireFault(rejectedBuild(textFile("unknown.xyz", "1 2 3\n")), "unknown.xyz");
    requireFault(rejectedBuild(cut(sphereFile(), "cut.ply", 0.6)), "cut.ply");
    requireFault(rejectedBuild(textFile("nan.obj", "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n")), "nan.obj");
    requireFault(rejectedBuild(textFile("range.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 7\n")), "range.obj");
    CHECK_FALSE(std::filesystem::exists(rejectedOutput()));
}

TEST_CASE("scenes that cannot be read") {
    using namespace std::string_literals;
    requireFault(rejectedBuild(textFile("noise.3mf", "PK\3\4 and no archive")), "noise.3mf: ");
    requireFault(rejectedBuild(textFile("noise.glb", "glTF\2\0\0\0"s)), "noise.glb: ");
    requireFault({"inspect", textFile("new.gltf", R"({"asset":{"version":"2.0"},"extensionsRequired":["NEW_shape"]})")},
                 "new.gltf: requires the glTF extension NEW_shape");
    // an importer that crashes in Assimp 5.2
    requireFault({"inspect", textFile("nameless.dae",
                                      "<COLLADA version=\"1.4.1\"><library_images><image id=\"i\">"
                                      "<init_from/></image></library_images></COLLADA>")},
                 "nameless.dae: ");
    CHECK_FALSE(std::filesystem::exists(rejectedOutput()));
}

TEST_CASE("fields that cannot be read") {
    const std::string field = scratch("whole.vdb").string();
    REQUIRE(run({"build", sphereFile().string(), "-o", field, "--voxel-size", "0.1"}).status == 0);
    for (const double part : {0.0, 0.001, 0.3, 0.9, 0.999}) {
        const std::string broken = cut(field, "cut.vdb", part).string();
        requireFault({"info", broken}, "cut.vdb");
        requireFault({"query", broken}, "cut.vdb");
        requireFault({"surface", broken, "-o", scratch("cut.obj").string()}, "cut.vdb");
        requireFault({"seed", broken, "-o", rejectedOutput()}, "cut.vdb");
        requireFault({"export", broken, "-o", scratch("cut.nvdb").string()}, "cut.vdb");
    }
    requireFault({"info", scratch("absent.vdb").string()}, "absent.vdb");
    requireFault({"info", textFile("text.vdb", "not a grid").string()}, "text.vdb");
    const Result half = run({"query", field}, {.input = "0 0 0\n0 0 zero\n"});
    CHECK(half.status == 1);
    CHECK(half.err.find("line 2") != std::string::npos);
    CHECK(half.errorLines() == 1);
    requireFault({"export", scratch("absent.vdb").string(), "-o", scratch("cut.nvdb").string()}, "absent.vdb");
    requireFault({"export", field, "-o", scratch("missing/a.nvdb").string()}, "missing/a.nvdb");
    CHECK_FALSE(std::filesystem::exists(scratch("cut.obj")));
    CHECK_FALSE(std::filesystem::exists(scratch("cut.nvdb")));
    CHECK_FALSE(std::filesystem::exists(rejectedOutput()));
}

TEST_CASE("existing paths that are not files are distinguished from missing ones") {
    const std::filesystem::path here = scratch("odd");
    std::filesystem::create_directories(here);
    const std::string field = (here / "field.vdb").string();
    REQUIRE(run({"build", sphereFile().string(), "-o", field, "--voxel-size", "0.1"}).status == 0);
    for (const std::string ending : {".obj", ".ply", ".stl", ".off", ".gltf", ".vdb"}) {
        const std::filesystem::path fifo = here / ("fifo" + ending), folder = here / ("folder" + ending),
                                    device = here / ("device" + ending), dangling = here / ("dangling" + ending),
                                    toFifo = here / ("link" + ending);
        REQUIRE(mkfifo(fifo.c_str(), 0600) == 0);
        std::filesystem::create_directory(folder);
        std::filesystem::create_symlink("/dev/zero", device);
        std::filesystem::create_symlink(here / "absent", dangling);
        std::filesystem::create_symlink(fifo, toFifo);
        const bool isField = ending == ".vdb";
        const auto refusesAll = [&](const std::string& path, const std::string& why) {
            const std::string culprit = path + ": " + why;
            requireFault({"seed", path, "-o", rejectedOutput(), "--voxel-size", "0.1"}, culprit);
            if (isField) {
                for (const char* command : {"info", "query"}) requireFault({command, path}, culprit);
                requireFault({"surface", path, "-o", scratch("a.obj").string()}, culprit);
                requireFault({"export", path, "-o", scratch("a.nvdb").string()}, culprit);
                requireFault({"seed", field, "-o", rejectedOutput(), "--into", path}, culprit);
            } else {
                requireFault(rejectedBuild(path), culprit);
                requireFault({"inspect", path}, culprit);
            }
        };
        for (const auto& odd : {fifo, folder, device, toFifo}) refusesAll(odd.string(), "not a regular file");
        refusesAll(dangling.string(), "no such file");
        refusesAll((here / ("absent" + ending)).string(), "no such file");
        refusesAll((here / "field.vdb" / ("inside" + ending)).string(), "no such file");
    }
    // special files that a mesh refers to are not opened either
    REQUIRE(mkfifo((here / "fifo.mtl").c_str(), 0600) == 0);
    std::ofstream(here / "material.obj") << "mtllib fifo.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    CHECK(run({"inspect", (here / "material.obj").string()}).status == 0);
    CHECK_FALSE(std::filesystem::exists(rejectedOutput()));
}

TEST_CASE("a small file that announces gigabytes takes no memory for them") {
    const auto path = corpusMesh("../cases/small-file-gigabytes.vdb");
    if (!path) return;
    for (const char* command : {"info", "query"}) {
        const Result r = run({command, path->string()});
        INFO(r.err);
        CHECK(r.status == 1);
        CHECK(r.errorLines() == 1);
        CHECK(r.err.find("a name of") != std::string::npos);
        CHECK(r.peakMemory < std::size_t(100) << 20);
    }
}

TEST_CASE("the built file of a body of any size can be read") {
    const std::string field = scratch("size.vdb").string();
    for (const std::string size : {"1e-3", "1", "1e7", "1e10"}) {
        const auto mesh = textFile("size.obj", "v 0 0 0\nv " + size + " 0 0\nv 0 " + size + " 0\nv 0 0 " + size +
                                                   "\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
        CAPTURE(size);
        REQUIRE(run({"build", mesh.string(), "-o", field, "--resolution", "16", "--body"}).status == 0);
        const Result read = run({"info", field});
        INFO(read.err);
        CHECK(read.status == 0);
    }
}

TEST_CASE("points that cannot be parsed") {
    const std::string field = scratch("points.vdb").string();
    REQUIRE(run({"build", sphereFile().string(), "-o", field, "--voxel-size", "0.1"}).status == 0);
    for (const char* line :
         {"", "1 2", "1 2 3 4", "1,2,3", "1 2 nan", "1 2 inf", "1 2 1e99", "a b c", "1 2 3x", "0x1 0 0"})
        requireFault({"query", field}, "line 1", {.input = std::string(line) + "\n"});
}

TEST_CASE("voxel sizes beyond any machine's memory are rejected at once") {
    const auto start = std::chrono::steady_clock::now();
    for (const char* size : {"1e-9", "1e-12", "1e-30"})
        requireFault(rejectedBuild(sphereFile(), {"--voxel-size", size}), "voxel");
    requireFault(rejectedBuild(sphereFile(), {"--resolution", "1e9"}), "voxel");
    requireFault({"seed", sphereFile().string(), "-o", rejectedOutput(), "--voxel-size", "1e-9"}, "voxel");
    CHECK(std::chrono::steady_clock::now() - start < std::chrono::seconds(30));
    CHECK_FALSE(std::filesystem::exists(rejectedOutput()));
}

TEST_CASE("bodies that cannot become liquid are rejected by name") {
    const std::string sheet = textFile("sheet.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").string();
    requireFault({"seed", sheet, "-o", rejectedOutput(), "--voxel-size", "0.05"}, sheet + ": ");
    requireFault({"seed", sphereFile().string(), sheet, "-o", rejectedOutput(), "--voxel-size", "0.05"}, sheet + ": ");
    const std::string field = scratch("sheet.vdb").string();
    REQUIRE(run({"build", sheet, "-o", field, "--voxel-size", "0.1", "--sign", "flood"}).status == 0);
    requireFault({"seed", field, "-o", rejectedOutput()}, field + ": ");
    requireFault({"seed", field, "-o", rejectedOutput(), "--voxel-size", "0.05"}, field + ": ");
    CHECK_FALSE(std::filesystem::exists(rejectedOutput()));
}

TEST_CASE("devices that are not there") {
    requireFault(rejectedBuild(sphereFile(), {"--voxel-size", "0.1", "--method", "double-layer", "--backend", "opencl",
                                              "--device", "no such device"}),
                 "no such device");
}
}  // namespace bilayer::bad_input_test
