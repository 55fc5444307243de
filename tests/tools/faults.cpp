// SPDX-License-Identifier: Apache-2.0
// `bilayer` on a machine at fault: disks that fail, little memory, closed streams, processes that are killed or meet.
// Each run ends by itself, with one line if it fails, and what was there stays until a whole file takes its place.
#include <signal.h>

#include <catch2/catch.hpp>
#include <cerrno>
#include <chrono>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <bilayer/sdf/vdb_io.h>
#include "tests/support/random.h"
#include "tests/support/support.h"
#include "tests/tools/library.h"
#include "tests/tools/program.h"

namespace bilayer::faults_test {
using namespace bilayer::test;

namespace fs = std::filesystem;

namespace {

std::set<std::string> namesIn(const fs::path& folder) {
    std::set<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder)) names.insert(entry.path().filename());
    return names;
}

Words buildTo(const fs::path& output, const std::string& voxelSize = "0.1") {
    return {"build", sphereFile().string(), "-o", output.string(), "--voxel-size", voxelSize};
}

// One line on stderr with status 1, or nothing with status 0.
void requireOrderlyEnd(const Result& r) {
    INFO(r.err);
    CHECK((r.status == 0 || r.status == 1));
    CHECK(r.errorLines() == std::size_t(r.status));
}

}  // namespace

TEST_CASE("whichever write fails, the old file stays and no part of a new one") {
    if (isSanitized()) return;
    const std::string field = scratch("coarse.vdb").string();
    REQUIRE(run(buildTo(field, "0.2")).status == 0);
    const fs::path folder = emptyFolder("failing_writes");
    const auto fails = [&](const std::string& name, Words words) {
        const fs::path output = folder / name;
        words.insert(words.end(), {"-o", output.string()});
        int failed = 0;
        for (const std::string call : {"write", "rename"}) {
            textFile("failing_writes/" + name, "old");
            for (int number = 1;; ++number) {
                CAPTURE(name, call, number);
                const std::string fault = call + " " + std::to_string(number) + " " + std::to_string(ENOSPC);
                const Result r = run(words, {.variables = {"LD_PRELOAD=" BILAYER_FAIL_CALL, "BILAYER_FAIL=" + fault}});
                requireOrderlyEnd(r);
                CHECK(namesIn(folder) == std::set<std::string>{name});
                if (r.status == 0) break;
                ++failed;
                CHECK(r.err.find(name) != std::string::npos);
                CHECK(fs::file_size(output) == 3);
                if (number > 100) FAIL("no end of failures");
            }
        }
        CHECK(failed >= 2);
        CHECK(fs::file_size(output) > 3);
        fs::remove(output);
    };
    fails("a.vdb", {"build", sphereFile().string(), "--voxel-size", "0.2", "--body", "--triangles"});
    for (const char* name : {"a.obj", "a.ply", "a.stl"}) fails(name, {"surface", field});
    fails("a.nvdb", {"export", field});
    fails("liquid.vdb", {"seed", field});
}

TEST_CASE("a killed process leaves the old file or the new one") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const fs::path folder = emptyFolder("killed"), output = folder / "a.vdb";
    REQUIRE(run(buildTo(output)).status == 0);
    for (int i = 0; i < 12; ++i) {
        const int signal = i % 3 == 0 ? SIGTERM : i % 3 == 1 ? SIGINT : SIGKILL;
        const pid_t process = start(buildTo(output, i % 2 ? "0.05" : "0.1"));
        std::this_thread::sleep_for(std::chrono::microseconds(int(random(0, 150000))));
        ::kill(process, signal);
        const int status = wait(process);
        CAPTURE(i, signal, status);
        CHECK((status == 0 || status == 128 + signal));
        CHECK_NOTHROW(readVdb(output));
        if (signal != SIGKILL) CHECK(namesIn(folder) == std::set<std::string>{"a.vdb"});
        for (const std::string& name : namesIn(folder))
            if (name != "a.vdb") fs::remove(folder / name);
    }
}

TEST_CASE("closed standard streams do no harm") {
    const std::string field = fieldFile(), whole = contents(field);
    const fs::path folder = emptyFolder("closed"), output = folder / "a.ply";
    REQUIRE(run({"surface", field, "-o", output.string()}).status == 0);
    const std::string surface = contents(output);
    for (int streams = 1; streams < 8; ++streams) {
        CAPTURE(streams);
        std::vector<int> closed;
        for (int stream = 0; stream < 3; ++stream)
            if (streams >> stream & 1) closed.push_back(stream);
        fs::remove(output);
        const Result r = run({"surface", field, "-o", output.string()}, {.closed = closed});
        // its report cannot be printed
        CHECK(r.status == (streams & 2 ? 1 : 0));
        CHECK(contents(output) == surface);
        const Result query = run({"query", field}, {.input = "0 0 0\n", .closed = closed});
        CHECK(query.status == (streams & 3 ? 1 : 0));
        if (!(streams & 4)) CHECK(query.errorLines() == std::size_t(query.status));
        CHECK(contents(field) == whole);
    }
}

TEST_CASE("a standard input that cannot be read is an error") {
    const Result r = run({"query", fieldFile()}, {.inputPath = "/"});
    CHECK(r.status == 1);
    CHECK(r.errorLines() == 1);
    CHECK(r.err.find("standard input") != std::string::npos);
}

TEST_CASE("two processes on one output leave one whole file") {
    const fs::path folder = emptyFolder("two"), output = folder / "a.vdb";
    for (int i = 0; i < 3; ++i) {
        const pid_t first = start(buildTo(output, "0.05")), second = start(buildTo(output, "0.06"));
        CHECK(wait(first) == 0);
        CHECK(wait(second) == 0);
        const float voxel = readVdb(output).voxelSize();
        CHECK((voxel == 0.05f || voxel == 0.06f));
        CHECK(namesIn(folder) == std::set<std::string>{"a.vdb"});
    }
}

TEST_CASE("outputs may have any name") {
    const fs::path folder = emptyFolder("names");
    // 255 bytes are the longest name of the usual file systems
    for (const std::string& name : {std::string("a b.vdb"), std::string("a\nb.vdb"), std::string("-a.vdb"),
                                    std::string("\xff\xfe.vdb"), std::string("'\"$(a).vdb"), std::string("*.vdb"),
                                    std::string(251, 'n') + ".vdb", std::string("\u00e4.vdb")}) {
        CAPTURE(name);
        const Result r = run({"build", sphereFile().string(), "--voxel-size", "0.1", "--json", "-o", folder / name});
        INFO(r.err);
        REQUIRE(r.status == 0);
        CHECK_NOTHROW(r.json());
        CHECK(run({"info", folder / name}).status == 0);
        CHECK(namesIn(folder) == std::set<std::string>{name});
        fs::remove(folder / name);
    }
}

TEST_CASE("little memory ends a build with one line") {
    if (isSanitized()) return;
    // the program alone needs about 120 MiB of address space
    for (const long mebibytes : {140, 160, 180, 200, 240, 300, 400, 600}) {
        CAPTURE(mebibytes);
        const Surroundings little{.memoryLimit = mebibytes << 20};
        requireOrderlyEnd(run(buildTo(scratch("little.vdb"), "0.01"), little));
        requireOrderlyEnd(run({"inspect", sphereFile("many.ply", 6).string()}, little));
    }
}

TEST_CASE("a sparse file is refused in time") {
    constexpr std::uintmax_t size = std::uintmax_t(200) << 20;
    for (const char* ending : {".obj", ".ply", ".stl", ".off", ".raw", ".gltf", ".vdb"}) {
        const fs::path path = textFile(std::string("sparse") + ending, "");
        fs::resize_file(path, size);
        const Result r = run({std::string(ending) == ".vdb" ? "info" : "inspect", path.string()});
        CAPTURE(ending, r.err);
        CHECK(r.status == 1);
        CHECK(r.errorLines() == 1);
        CHECK(r.peakMemory < 2 * size);
        fs::remove(path);
    }
}

TEST_CASE("without a home everything works") {
    CHECK(run(buildTo(scratch("homeless.vdb")), {.variables = {"HOME", "XDG_CACHE_HOME", "USER", "PATH", "LANG"}})
              .status == 0);
}
}  // namespace bilayer::faults_test
