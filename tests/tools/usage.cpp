// SPDX-License-Identifier: Apache-2.0
// Wrong usage of `bilayer`: status 2 and a message that names the option.
#include <sys/stat.h>

#include <fmt/format.h>
#include <catch2/catch.hpp>

#include <bilayer/sdf/grids.h>
#include "sdf/base/openvdb.h"
#include "tests/support/damage.h"
#include "tests/support/support.h"
#include "tests/tools/program.h"

namespace bilayer::usage_test {
using namespace bilayer::test;

namespace {

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

}  // namespace

TEST_CASE("wrong usage") {
    const std::string mesh = sphereFile().string();
    requireUsage({"build", mesh, "-o", rejectedOutput(), "--voxel-size", "0.1", "--backend", "opencl", "--method",
                  "pseudonormal"},
                 "--method pseudonormal: needs --backend tbb");
    requireUsage({"build", mesh, "-o", rejectedOutput(), "--voxel-size", "0.1", "--mapping", "group"},
                 "need --backend opencl");
    requireUsage({});
    requireUsage({"unknown"}, "there is no command 'unknown'; the commands are build, ");
    requireUsage({mesh}, "there is no command '" + mesh);
    requireUsage({"build"});
    requireUsage({"build", mesh, "--voxel-size", "0.1"});
    requireUsage(rejectedBuild(mesh, {}));
    requireUsage(rejectedBuild(mesh, {"--voxel-size", "0.1", "--resolution", "10"}));
    for (const char* size : {"0", "-1", "nan", "inf", "wide"})
        requireUsage(rejectedBuild(mesh, {"--voxel-size", size}));
    for (const char* count : {"0", "-3", "nan"}) requireUsage(rejectedBuild(mesh, {"--resolution", count}));
    for (const Words& options :
         {Words{"--nonsense"}, Words{"--method", "magic"}, Words{"--sign", "magic"}, Words{"--backend", "cuda"},
          Words{"--device", "x"}, Words{"--device-memory", "100"}, Words{"--threads", "0"}, Words{"--half-width", "0"},
          Words{"--exterior-width", "3"}, Words{"--half-width", "3", "--exterior-width", "3", "--interior-width", "3"},
          Words{"--gap", "-1"}, Words{"--gap", "101"}, Words{"--half-width", "1001"}, Words{"--half-width", "1e-4"},
          Words{"--band-unit", "furlongs"}, Words{"--band-unit", "world"}}) {
        Words words = rejectedBuild(mesh);
        words.insert(words.end(), options.begin(), options.end());
        requireUsage(words, options.front());
    }
    requireUsage({"build", mesh, "-o", mesh, "--voxel-size", "0.1"}, "would overwrite " + mesh);
    requireUsage({"surface", "a.vdb", "-o", "a.xyz"});
    requireUsage({"export", "a.vdb"});
    requireUsage({"export", "a.vdb", "-o", "a.vdb"}, ".nvdb");
    requireUsage({"seed", mesh, "-o", rejectedOutput()});
    requireUsage({"seed", mesh, "-o", mesh, "--voxel-size", "0.1"}, "would overwrite " + mesh);
    requireUsage({"seed", mesh, "-o", rejectedOutput(), "--voxel-size", "0.1", "--rotate", "0", "0", "0", "1"});
    requireUsage({"seed", mesh, "-o", rejectedOutput(), "--voxel-size", "0.1", "--seed", "1"});
    for (const char* mode : {"intersect", "subtract"})
        requireUsage({"seed", mesh, "-o", rejectedOutput(), "--voxel-size", "0.1", "--mode", mode}, "needs --into");
    CHECK_FALSE(std::filesystem::exists(rejectedOutput()));
}

TEST_CASE("incomplete options of bodies and scenes are wrong usage") {
    const std::string mesh = sphereFile().string();
    requireUsage(rejectedBuild(mesh, {"--voxel-size", "0.1", "--margin", "0.1"}), "--margin: needs --body");
    requireUsage(rejectedBuild(mesh, {"--voxel-size", "0.1", "--point-spacing", "1"}), "--point-spacing: needs --body");
    requireUsage(rejectedBuild(mesh, {"--voxel-size", "0.1", "--no-mesh"}), "--no-mesh: needs --body");
    requireUsage(rejectedBuild(mesh, {"--voxel-size", "0.1", "--contacts", "exact"}), "--contacts: needs --body");
    requireUsage(rejectedBuild(mesh, {"--voxel-size", "0.1", "--body", "--no-mesh", "--contacts", "exact"}),
                 "excludes");
    requireUsage(rejectedBuild(mesh, {"--voxel-size", "0.1", "--body", "--contacts", "thumb"}), "--contacts");
    for (const char* word : {"0", "-1", "nan", "inf", "x"}) {
        requireUsage(rejectedBuild(mesh, {"--voxel-size", "0.1", "--body", "--margin", word}), "--margin");
        requireUsage(rejectedBuild(mesh, {"--voxel-size", "0.1", "--body", "--point-spacing", word}),
                     "--point-spacing");
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

TEST_CASE("widths in the mesh's unit have the same limits in voxels") {
    const std::string mesh = sphereFile().string();
    const auto refused = [&](Words options, const std::string& culprit) {
        options.insert(options.end(), {"--band-unit", "world"});
        requireUsage(rejectedBuild(mesh, options), culprit);
    };
    refused({"--voxel-size", "0.125", "--half-width", "250"}, "--half-width: 250 is 2000 voxels of 0.125");
    refused({"--voxel-size", "0.125", "--half-width", "1e-5"}, "--half-width: 1e-05 is 8e-05 voxels of 0.125");
    refused({"--voxel-size", "0.125", "--exterior-width", "1", "--interior-width", "250"}, "--interior-width: 250 is");
    refused({"--voxel-size", "0.125", "--exterior-width", "250", "--interior-width", "1"}, "--exterior-width: 250 is");
    refused({"--resolution", "10", "--half-width", "250"}, "--half-width: 250 is");
    CHECK_FALSE(std::filesystem::exists(rejectedOutput()));
}

TEST_CASE("options that belong to other methods are wrong usage") {
    const std::string mesh = sphereFile().string();
    const auto with = [&](Words options) {
        options.insert(options.begin(), {"--voxel-size", "0.1"});
        return rejectedBuild(mesh, options);
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
    CHECK_FALSE(std::filesystem::exists(rejectedOutput()));
}

TEST_CASE("ranges in the help are the accepted ones") {
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
            return rejectedBuild(sphereFile(), {"--voxel-size", "0.2", method[0], method[1], range.option, value});
        };
        for (const char* value : {range.low, range.high}) {
            CAPTURE(value);
            CHECK(run(with(value)).status == 0);
        }
        for (const char* value : {range.below, range.above}) requireUsage(with(value), range.option);
    }
    std::filesystem::remove(rejectedOutput());
}

TEST_CASE("NaN and text are wrong usage wherever a number is expected") {
    const std::string mesh = sphereFile().string();
    for (const char* word : {"nan", "-nan", "inf", "1e400", "x"}) {
        for (const char* option : {"--half-width", "--gap", "--threads", "--device-memory"})
            requireUsage(rejectedBuild(mesh, {"--voxel-size", "0.1", option, word}), option);
        requireUsage(rejectedBuild(mesh, {"--voxel-size", "0.1", "--exterior-width", word, "--interior-width", "3"}),
                     "--exterior-width");
        requireUsage(rejectedBuild(mesh, {"--voxel-size", "0.1", "--exterior-width", "3", "--interior-width", word}),
                     "--interior-width");
        for (const char* option : {"--delta", "--epsilon", "--neighbourhood", "--max-subdivision"})
            requireUsage(rejectedBuild(mesh, {"--voxel-size", "0.1", "--method", "double-layer", option, word}),
                         option);
        for (const char* option : {"--isovalue", "--adaptivity"})
            requireUsage({"surface", "a.vdb", "-o", "a.ply", option, word}, option);
        for (const char* option : {"--voxel-size", "--resolution", "--half-width", "--particles"})
            requireUsage({"seed", mesh, "-o", rejectedOutput(), option, word}, option);
        requireUsage({"seed", mesh, "-o", rejectedOutput(), "--voxel-size", "0.1", "--translate", "0", word, "0"},
                     "--translate");
        requireUsage({"seed", mesh, "-o", rejectedOutput(), "--voxel-size", "0.1", "--rotate", "0", "0", "1", word},
                     "--rotate");
    }
    CHECK_FALSE(std::filesystem::exists(rejectedOutput()));
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

TEST_CASE("empty words are wrong usage wherever they stand") {
    const Words words{"build", sphereFile().string(), "-o", rejectedOutput(), "--union", "--resolution", "10"};
    for (std::size_t at = 0; at <= words.size(); ++at) {
        Words with = words;
        with.insert(with.begin() + std::ptrdiff_t(at), "");
        requireUsage(with, fmt::format("argument {} is empty", at + 1));
    }
}

TEST_CASE("any words end a command in an orderly way") {
    const unsigned seed = bilayer::test::seed();
    CAPTURE(seed);
    Damage damage(seed);
    const std::string mesh = sphereFile().string(), field = fieldFile(), output = scratch("words").string();
    const Words numbers{"0",   "1",   "-1",    "0.1", "1e-30", "1e30", "1e999",
                        "nan", "inf", "0x1p3", "1,5", "",      " ",    "9999999999999999999"};
    const Words options{
        "--voxel-size",    "--resolution", "--half-width", "--exterior-width", "--interior-width", "--gap", "--margin",
        "--point-spacing", "--threads",    "--isovalue",   "--method",         "--sign",           "--dt",  "--speed"};
    const Words others{"--body",
                       "--triangles",
                       "--json",
                       "--report",
                       "--union",
                       "--half-float",
                       "exact",
                       "winding",
                       "--",
                       "-",
                       "-o",
                       "\n",
                       "\xff",
                       "=",
                       "--voxel-size=0.1",
                       "--method=exact",
                       "double-layer",
                       "flood"};
    const auto any = [&](const Words& words) { return words[damage.below(words.size())]; };
    for (int i = 0; i < 80; ++i) {
        const std::string command = any({"build", "build", "inspect", "info", "query", "surface", "export", "seed"});
        Words words{command, damage.below(2) ? mesh : field, "-o", output + any({".vdb", ".ply", ".obj", ".nvdb", ""})};
        if (command == "inspect" || command == "info" || command == "query") words.resize(2);
        for (std::size_t count = damage.below(4); count > 0; --count) {
            words.push_back(any(options));
            words.push_back(any(damage.below(3) ? Words{"0.1", "0.5", "2"} : numbers));
        }
        if (damage.below(2)) words.insert(words.begin() + std::ptrdiff_t(damage.below(words.size() + 1)), any(others));
        const Result r = run(words);
        INFO(fmt::format("{}", fmt::join(words, " | ")) << "\n" << r.err);
        CHECK((r.status >= 0 && r.status <= 2));
        if (r.status == 1) CHECK(r.errorLines() == 1);
        if (r.status == 2) CHECK_FALSE(r.err.empty());
    }
}
}  // namespace bilayer::usage_test
