// `bilayer` on input that it must refuse: status 1 and one line that names the cause, or status 2.
#include <fmt/format.h>
#include <sys/stat.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <fstream>
#include <memory>

#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/vdb_io.h>
#include "sdf/base/openvdb.h"
#include "tests/support/support.h"
#include "tests/tools/program.h"

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

// Checks for status 2, a message on stderr with `culprit` in it, nothing on stdout.
void requireUsage(const Words& words, const std::string& culprit = "") {
    std::string command;
    for (const std::string& word : words) command += word + " ";
    const Result r = run(words);
    INFO(command << "\n" << r.err);
    CHECK(r.status == 2);
    CHECK_FALSE(r.err.empty());
    CHECK(r.err.find(culprit) != std::string::npos);
    CHECK(r.out.empty());
}

std::string output() {
    return scratch("refused.vdb").string();
}

Words buildOf(const std::filesystem::path& mesh, Words options = {"--voxel-size", "0.1"}) {
    Words words{"build", mesh.string(), "-o", output()};
    words.insert(words.end(), options.begin(), options.end());
    return words;
}

std::filesystem::path cut(const std::filesystem::path& path, const std::string& name, double part) {
    const std::filesystem::path copy = scratch(name);
    std::filesystem::copy_file(path, copy, std::filesystem::copy_options::overwrite_existing);
    std::filesystem::resize_file(copy, std::uintmax_t(part * double(std::filesystem::file_size(copy))));
    return copy;
}

}  // namespace

TEST_CASE("meshes that cannot be read") {
    requireFault(buildOf(scratch("absent.obj")), "absent.obj");
    requireFault({"inspect", scratch("absent.obj").string()}, "absent.obj");
    requireFault(buildOf(scratch("")), scratch("").string());
    requireFault(buildOf(textFile("empty.obj", "")), "empty.obj");
    requireFault(buildOf(textFile("points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n")), "points.obj");
    requireFault(buildOf(textFile("noise.ply", "ply\nformat nonsense\n")), "noise.ply");
    requireFault(buildOf(textFile("unknown.xyz", "1 2 3\n")), "unknown.xyz");
    requireFault(buildOf(cut(sphereFile(), "cut.ply", 0.6)), "cut.ply");
    requireFault(buildOf(textFile("nan.obj", "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n")), "nan.obj");
    requireFault(buildOf(textFile("range.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 7\n")), "range.obj");
    CHECK_FALSE(std::filesystem::exists(output()));
}

TEST_CASE("scenes that cannot be read") {
    using namespace std::string_literals;
    requireFault(buildOf(textFile("noise.3mf", "PK\3\4 and no archive")), "noise.3mf: ");
    requireFault(buildOf(textFile("noise.glb", "glTF\2\0\0\0"s)), "noise.glb: ");
    requireFault({"inspect", textFile("new.gltf", R"({"asset":{"version":"2.0"},"extensionsRequired":["NEW_shape"]})")},
                 "new.gltf: requires the glTF extension NEW_shape");
    // an importer that crashes in Assimp 5.2
    requireFault({"inspect", textFile("nameless.dae",
                                      "<COLLADA version=\"1.4.1\"><library_images><image id=\"i\">"
                                      "<init_from/></image></library_images></COLLADA>")},
                 "nameless.dae: ");
    CHECK_FALSE(std::filesystem::exists(output()));
}

TEST_CASE("fields that cannot be read") {
    const std::string field = scratch("whole.vdb").string();
    REQUIRE(run({"build", sphereFile().string(), "-o", field, "--voxel-size", "0.1"}).status == 0);
    for (const double part : {0.0, 0.001, 0.3, 0.9, 0.999}) {
        const std::string broken = cut(field, "cut.vdb", part).string();
        requireFault({"info", broken}, "cut.vdb");
        requireFault({"query", broken}, "cut.vdb");
        requireFault({"surface", broken, "-o", scratch("cut.obj").string()}, "cut.vdb");
        requireFault({"seed", broken, "-o", output()}, "cut.vdb");
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
    CHECK_FALSE(std::filesystem::exists(output()));
}

TEST_CASE("what is there, but no file, is told from what is not there") {
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
            requireFault({"seed", path, "-o", output(), "--voxel-size", "0.1"}, culprit);
            if (isField) {
                for (const char* command : {"info", "query"}) requireFault({command, path}, culprit);
                requireFault({"surface", path, "-o", scratch("a.obj").string()}, culprit);
                requireFault({"export", path, "-o", scratch("a.nvdb").string()}, culprit);
                requireFault({"seed", field, "-o", output(), "--into", path}, culprit);
            } else {
                requireFault(buildOf(path), culprit);
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
    CHECK_FALSE(std::filesystem::exists(output()));
}

TEST_CASE("a small file that tells of gigabytes takes no memory for them") {
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

TEST_CASE("what is built of a body of any size can be read") {
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

TEST_CASE("bodies that are damaged") {
    const auto path = scratch("body.vdb"), broken = scratch("broken_body.vdb");
    REQUIRE(run({"build", sphereFile().string(), "-o", path.string(), "--voxel-size", "0.1", "--body"}).status == 0);
    auto grids = std::make_shared<bilayer::Grids>(bilayer::readVdb(path).grids());
    grids->points = nullptr;
    bilayer::writeVdb(broken, bilayer::LevelSet(grids));
    requireFault({"info", broken.string()}, "broken_body.vdb: the body is damaged: it has no surface points");
    requireFault({"info", broken.string(), "--json"}, "broken_body.vdb");
    // its field is still valid
    CHECK(run({"query", broken.string()}, {.input = "0 0 0\n"}).status == 0);
}

TEST_CASE("points that cannot be parsed") {
    const std::string field = scratch("points.vdb").string();
    REQUIRE(run({"build", sphereFile().string(), "-o", field, "--voxel-size", "0.1"}).status == 0);
    for (const char* line :
         {"", "1 2", "1 2 3 4", "1,2,3", "1 2 nan", "1 2 inf", "1 2 1e99", "a b c", "1 2 3x", "0x1 0 0"})
        requireFault({"query", field}, "line 1", {.input = std::string(line) + "\n"});
}

TEST_CASE("voxel sizes that no machine can serve are refused at once") {
    const auto start = std::chrono::steady_clock::now();
    for (const char* size : {"1e-9", "1e-12", "1e-30"})
        requireFault(buildOf(sphereFile(), {"--voxel-size", size}), "voxel");
    requireFault(buildOf(sphereFile(), {"--resolution", "1e9"}), "voxel");
    requireFault({"seed", sphereFile().string(), "-o", output(), "--voxel-size", "1e-9"}, "voxel");
    CHECK(std::chrono::steady_clock::now() - start < std::chrono::seconds(30));
    CHECK_FALSE(std::filesystem::exists(output()));
}

TEST_CASE("what cannot become liquid is named") {
    const std::string sheet = textFile("sheet.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").string();
    requireFault({"seed", sheet, "-o", output(), "--voxel-size", "0.05"}, sheet + ": ");
    requireFault({"seed", sphereFile().string(), sheet, "-o", output(), "--voxel-size", "0.05"}, sheet + ": ");
    const std::string field = scratch("sheet.vdb").string();
    REQUIRE(run({"build", sheet, "-o", field, "--voxel-size", "0.1", "--sign", "flood"}).status == 0);
    requireFault({"seed", field, "-o", output()}, field + ": ");
    requireFault({"seed", field, "-o", output(), "--voxel-size", "0.05"}, field + ": ");
    CHECK_FALSE(std::filesystem::exists(output()));
}

TEST_CASE("devices that are not there") {
    requireFault(buildOf(sphereFile(), {"--voxel-size", "0.1", "--method", "double-layer", "--backend", "opencl",
                                        "--device", "no such device"}),
                 "no such device");
}

TEST_CASE("wrong usage") {
    const std::string mesh = sphereFile().string();
    requireUsage(
        {"build", mesh, "-o", output(), "--voxel-size", "0.1", "--backend", "opencl", "--method", "pseudonormal"},
        "--method pseudonormal: needs --backend tbb");
    requireUsage({"build", mesh, "-o", output(), "--voxel-size", "0.1", "--mapping", "group"}, "need --backend opencl");
    requireUsage({});
    requireUsage({"unknown"});
    requireUsage({"build"});
    requireUsage({"build", mesh, "--voxel-size", "0.1"});
    requireUsage(buildOf(mesh, {}));
    requireUsage(buildOf(mesh, {"--voxel-size", "0.1", "--resolution", "10"}));
    for (const char* size : {"0", "-1", "nan", "inf", "wide"}) requireUsage(buildOf(mesh, {"--voxel-size", size}));
    for (const char* count : {"0", "-3", "nan"}) requireUsage(buildOf(mesh, {"--resolution", count}));
    for (const Words& options :
         {Words{"--nonsense"}, Words{"--method", "magic"}, Words{"--sign", "magic"}, Words{"--backend", "cuda"},
          Words{"--device", "x"}, Words{"--device-memory", "100"}, Words{"--threads", "0"}, Words{"--half-width", "0"},
          Words{"--exterior-width", "3"}, Words{"--half-width", "3", "--exterior-width", "3", "--interior-width", "3"},
          Words{"--gap", "-1"}, Words{"--gap", "101"}, Words{"--half-width", "1001"}, Words{"--half-width", "1e-4"},
          Words{"--band-unit", "furlongs"}, Words{"--band-unit", "world"}}) {
        Words words = buildOf(mesh);
        words.insert(words.end(), options.begin(), options.end());
        requireUsage(words, options.front());
    }
    requireUsage({"build", mesh, "-o", mesh, "--voxel-size", "0.1"}, "would overwrite " + mesh);
    requireUsage({"surface", "a.vdb", "-o", "a.xyz"});
    requireUsage({"export", "a.vdb"});
    requireUsage({"export", "a.vdb", "-o", "a.vdb"}, ".nvdb");
    requireUsage({"seed", mesh, "-o", output()});
    requireUsage({"seed", mesh, "-o", mesh, "--voxel-size", "0.1"}, "would overwrite " + mesh);
    requireUsage({"seed", mesh, "-o", output(), "--voxel-size", "0.1", "--rotate", "0", "0", "0", "1"});
    requireUsage({"seed", mesh, "-o", output(), "--voxel-size", "0.1", "--seed", "1"});
    for (const char* mode : {"intersect", "subtract"})
        requireUsage({"seed", mesh, "-o", output(), "--voxel-size", "0.1", "--mode", mode}, "needs --into");
    CHECK_FALSE(std::filesystem::exists(output()));
}

TEST_CASE("bodies and scenes that are told by halves are wrong usage") {
    const std::string mesh = sphereFile().string();
    requireUsage(buildOf(mesh, {"--voxel-size", "0.1", "--margin", "0.1"}), "--margin: needs --body");
    requireUsage(buildOf(mesh, {"--voxel-size", "0.1", "--point-spacing", "1"}), "--point-spacing: needs --body");
    requireUsage(buildOf(mesh, {"--voxel-size", "0.1", "--no-mesh"}), "--no-mesh: needs --body");
    requireUsage(buildOf(mesh, {"--voxel-size", "0.1", "--contacts", "edges"}), "--contacts: needs --body");
    requireUsage(buildOf(mesh, {"--voxel-size", "0.1", "--body", "--no-mesh", "--contacts", "edges"}), "excludes");
    requireUsage(buildOf(mesh, {"--voxel-size", "0.1", "--body", "--contacts", "thumb"}), "--contacts");
    for (const char* word : {"0", "-1", "nan", "inf", "x"}) {
        requireUsage(buildOf(mesh, {"--voxel-size", "0.1", "--body", "--margin", word}), "--margin");
        requireUsage(buildOf(mesh, {"--voxel-size", "0.1", "--body", "--point-spacing", word}), "--point-spacing");
        for (const char* option : {"--thickness", "--gap", "--voxel-size", "--mass-ratio"})
            requireUsage({"inspect", mesh, "--dt", "1/60", "--speed", "1", option, word}, option);
    }
    for (const char* word : {"-1", "nan", "inf", "x"})
        for (const char* option : {"--spin", "--margin"})
            requireUsage({"inspect", mesh, "--dt", "1/60", "--speed", "1", option, word}, option);
    for (const char* word : {"0", "-1", "nan", "x", "1/", "/60", "1/0", "1/x", "1/60/2", "-1/60"})
        requireUsage({"inspect", mesh, "--speed", "1", "--dt", word}, "--dt");
    requireUsage({"inspect", mesh, "--dt", "1/60"}, "--speed");
    requireUsage({"inspect", mesh, "--speed", "1"}, "--dt");
    requireUsage({"inspect", mesh, "--gap", "1"}, "--dt");
}

TEST_CASE("widths in the mesh's unit must come to as many voxels as others") {
    const std::string mesh = sphereFile().string();
    const auto refused = [&](Words options, const std::string& culprit) {
        options.insert(options.end(), {"--band-unit", "world"});
        requireUsage(buildOf(mesh, options), culprit);
    };
    refused({"--voxel-size", "0.125", "--half-width", "250"}, "--half-width: 250 is 2000 voxels of 0.125");
    refused({"--voxel-size", "0.125", "--half-width", "1e-5"}, "--half-width: 1e-05 is 8e-05 voxels of 0.125");
    refused({"--voxel-size", "0.125", "--exterior-width", "1", "--interior-width", "250"}, "--interior-width: 250 is");
    refused({"--voxel-size", "0.125", "--exterior-width", "250", "--interior-width", "1"}, "--exterior-width: 250 is");
    refused({"--resolution", "10", "--half-width", "250"}, "--half-width: 250 is");
    CHECK_FALSE(std::filesystem::exists(output()));
}

TEST_CASE("options that belong to other methods are wrong usage") {
    const std::string mesh = sphereFile().string();
    const auto with = [&](Words options) {
        options.insert(options.begin(), {"--voxel-size", "0.1"});
        return buildOf(mesh, options);
    };
    for (const Words& option : {Words{"--delta", "0.5"}, Words{"--epsilon", "1"}, Words{"--neighbourhood", "2"},
                                Words{"--max-subdivision", "32"}}) {
        requireUsage(with(option), option[0] + ": needs --method double-layer");
        requireUsage(with({"--method", "exact", option[0], option[1]}), option[0] + ": needs --method double-layer");
        requireUsage(with({"--method", "pseudonormal", option[0], option[1]}),
                     option[0] + ": needs --method double-layer");
        requireUsage(with({"--method", "double-layer", option[0], "0"}), option[0]);
    }
    for (const char* sign : {"normals", "winding", "flood"})
        requireUsage(with({"--method", "double-layer", "--sign", sign}), "--sign: is not for --method double-layer");
    requireUsage(with({"--method", "double-layer", "--gap", "2"}), "--gap: needs");
    for (const Words& words : {Words{}, Words{"--backend", "tbb"}, Words{"--sign", "normals"}}) {
        Words options{"--method", "prism"};
        options.insert(options.end(), words.begin(), words.end());
        requireUsage(with(options), "--method prism: needs --backend opencl");
    }
    const auto prism = [&](Words options) {
        options.insert(options.begin(), {"--method", "prism", "--backend", "opencl"});
        return with(options);
    };
    for (const char* sign : {"normals", "winding", "flood"})
        requireUsage(prism({"--sign", sign}), "--sign: is not for --method prism");
    requireUsage(prism({"--gap", "2"}), "--gap: needs");
    requireUsage(prism({"--delta", "0.5"}), "--delta: needs --method double-layer");
    for (const char* sign : {"normals", "winding"}) requireUsage(with({"--sign", sign, "--gap", "2"}), "--gap: needs");
    CHECK_FALSE(std::filesystem::exists(output()));
}

TEST_CASE("ranges in the help are those that are taken") {
    const Result help = run({"build", "--help"});
    REQUIRE(help.status == 0);
    const struct {
        const char *option, *low, *high, *below, *above;
    } ranges[] = {{"--delta", "0.1", "4", "0.0999", "4.001"},
                  {"--epsilon", "0.0001", "10000", "0.000099", "10001"},
                  {"--neighbourhood", "1", "64", "0", "65"},
                  {"--max-subdivision", "1", "1024", "0", "1025"},
                  {"--gap", "0", "100", "-0.001", "100.1"}};
    for (const auto& range : ranges) {
        CAPTURE(range.option);
        const std::size_t at = help.out.find(range.option);
        REQUIRE(at != std::string::npos);
        const std::string line = help.out.substr(at, help.out.find('\n', at) - at);
        CAPTURE(line);
        CHECK((line.find(fmt::format("{}..{}", range.low, range.high)) != std::string::npos ||
               line.find(fmt::format("[{} - {}]", range.low, range.high)) != std::string::npos));
        const auto with = [&](const std::string& value) {
            const Words method =
                range.option == std::string("--gap") ? Words{"--sign", "flood"} : Words{"--method", "double-layer"};
            return buildOf(sphereFile(), {"--voxel-size", "0.2", method[0], method[1], range.option, value});
        };
        for (const char* value : {range.low, range.high}) {
            CAPTURE(value);
            CHECK(run(with(value)).status == 0);
        }
        for (const char* value : {range.below, range.above}) requireUsage(with(value), range.option);
    }
    std::filesystem::remove(output());
}

TEST_CASE("what is no number is wrong usage wherever a number is expected") {
    const std::string mesh = sphereFile().string();
    for (const char* word : {"nan", "-nan", "inf", "1e400", "x"}) {
        for (const char* option : {"--half-width", "--gap", "--threads", "--device-memory"})
            requireUsage(buildOf(mesh, {"--voxel-size", "0.1", option, word}), option);
        requireUsage(buildOf(mesh, {"--voxel-size", "0.1", "--exterior-width", word, "--interior-width", "3"}),
                     "--exterior-width");
        requireUsage(buildOf(mesh, {"--voxel-size", "0.1", "--exterior-width", "3", "--interior-width", word}),
                     "--interior-width");
        for (const char* option : {"--delta", "--epsilon", "--neighbourhood", "--max-subdivision"})
            requireUsage(buildOf(mesh, {"--voxel-size", "0.1", "--method", "double-layer", option, word}), option);
        for (const char* option : {"--isovalue", "--adaptivity"})
            requireUsage({"surface", "a.vdb", "-o", "a.ply", option, word}, option);
        for (const char* option : {"--voxel-size", "--resolution", "--half-width", "--particles"})
            requireUsage({"seed", mesh, "-o", output(), option, word}, option);
        requireUsage({"seed", mesh, "-o", output(), "--voxel-size", "0.1", "--translate", "0", word, "0"},
                     "--translate");
        requireUsage({"seed", mesh, "-o", output(), "--voxel-size", "0.1", "--rotate", "0", "0", "1", word},
                     "--rotate");
    }
    CHECK_FALSE(std::filesystem::exists(output()));
}

TEST_CASE("an input is never overwritten") {
    const std::string field = scratch("kept.vdb").string();
    REQUIRE(run({"build", sphereFile().string(), "-o", field, "--voxel-size", "0.1"}).status == 0);
    const auto when = std::filesystem::last_write_time(field);
    requireUsage({"seed", field, "-o", field}, "would overwrite " + field);
    requireUsage({"seed", sphereFile().string(), field, "-o", field, "--voxel-size", "0.1"}, "would overwrite");
    const auto link = scratch("kept.ply");
    std::filesystem::remove(link);
    std::filesystem::create_symlink(field, link);
    requireUsage({"surface", field, "-o", link.string()}, "would overwrite");
    const auto nano = scratch("kept.nvdb");
    std::filesystem::remove(nano);
    std::filesystem::create_symlink(field, nano);
    requireUsage({"export", field, "-o", nano.string()}, "would overwrite");
    CHECK(std::filesystem::last_write_time(field) == when);
}
