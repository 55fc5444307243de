// SPDX-License-Identifier: Apache-2.0
// Output files of `bilayer` appear complete or not at all.
#include <signal.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <fstream>
#include <optional>
#include <set>
#include <thread>

#include <bilayer/sdf/vdb_io.h>
#include "sdf/io/atomic_file.h"
#include "tests/support/support.h"
#include "tests/tools/program.h"

namespace bilayer::files_test {
using namespace bilayer::detail;
using namespace bilayer::test;

namespace {

// An empty folder.
std::filesystem::path folder(const std::string& name) {
    const auto path = scratch(name);
    std::filesystem::remove_all(path);
    std::filesystem::create_directories(path);
    return path;
}

std::set<std::string> names(const std::filesystem::path& path) {
    std::set<std::string> found;
    for (const auto& entry : std::filesystem::directory_iterator(path)) found.insert(entry.path().filename());
    return found;
}

Words buildTo(const std::filesystem::path& output) {
    return {"build", sphereFile().string(), "-o", output.string(), "--voxel-size", "0.02"};
}

void requireFault(const Words& words, const Surroundings& surroundings = {}) {
    const Result r = run(words, surroundings);
    INFO(r.err);
    CHECK(r.status == 1);
    CHECK(r.errorLines() == 1);
}

}  // namespace

TEST_CASE("targets that are no files are refused") {
    const auto here = folder("targets");
    requireFault(buildTo(here / "missing" / "a.vdb"));
    requireFault(buildTo(here));
    requireFault(buildTo("/dev/full"));
    requireFault(buildTo("/dev/null"));
    requireFault({"seed", sphereFile().string(), "-o", (here / "missing" / "a.vdb").string(), "--voxel-size", "0.1"});
    CHECK(names(here).empty());
    CHECK(std::filesystem::is_character_file("/dev/null"));
}

TEST_CASE("a full disk leaves what was there") {
    const auto here = folder("full");
    const auto field = here / "a.vdb";
    REQUIRE(run(buildTo(field)).status == 0);
    const auto size = std::filesystem::file_size(field);
    const Surroundings full{.fileSizeLimit = 20000};
    requireFault({"build", sphereFile().string(), "-o", field.string(), "--voxel-size", "0.01"}, full);
    CHECK(std::filesystem::file_size(field) == size);
    for (const char* name : {"a.ply", "a.obj", "a.stl"})
        requireFault({"surface", field.string(), "-o", (here / name).string()}, full);
    requireFault({"seed", field.string(), "-o", (here / "liquid.vdb").string()}, full);
    requireFault({"export", field.string(), "-o", (here / "a.nvdb").string()}, full);
    CHECK(names(here) == std::set<std::string>{"a.vdb"});
}

TEST_CASE("a full standard output is an error") {
    requireFault({"inspect", sphereFile().string(), "--json"}, {.output = "/dev/full"});
}

TEST_CASE("a signal leaves no file") {
    const auto here = folder("interrupted");
    const std::string mesh = sphereFile("large.ply", 6).string();
    const auto kill = [&](Words words, int signal, int milliseconds) {
        words.insert(words.begin(), {"build", mesh, "-o", (here / "a.vdb").string()});
        const pid_t process = start(words);
        std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds));
        ::kill(process, signal);
        const int status = wait(process);
        INFO("after " << milliseconds << " ms: status " << status);
        if (status == 0) {
            CHECK_NOTHROW(readVdb(here / "a.vdb"));
            std::filesystem::remove(here / "a.vdb");
        } else {
            CHECK(status == 128 + signal);
            CHECK(names(here) == std::set<std::string>{});
        }
        return status != 0;
    };
    const std::string method = GENERATE("exact", "double-layer", "pseudonormal");
    CAPTURE(method);
    for (const int signal : {SIGINT, SIGTERM}) {
        // several moments: while reading, building, writing
        for (const int milliseconds : {50, 150, 300, 600})
            kill({"--method", method, "--resolution", "300"}, signal, milliseconds);
        // a wide band takes seconds, nearly all of them for the build
        CHECK(kill({"--method", method, "--resolution", "300", "--half-width", "30"}, signal, 400));
    }
}

TEST_CASE("a signal that comes when the file has its place is too late, once") {
    const auto here = folder("late");
    // the exit status of a process that gets this many signals after its first file
    const auto statusAfter = [&](int signals, bool beginsAnother) {
        const pid_t process = ::fork();
        if (process == 0) {
            removeAtomicFilesOnSignal();
            AtomicFile first(here / "a");
            first.commit();
            std::optional<AtomicFile> second;
            if (beginsAnother) second.emplace(here / "b");
            for (int i = 0; i < signals; ++i) ::raise(SIGTERM);
            ::_exit(0);
        }
        return wait(process);
    };
    CHECK(statusAfter(1, false) == 0);
    CHECK(statusAfter(2, false) == 128 + SIGTERM);
    CHECK(statusAfter(1, true) == 128 + SIGTERM);
    CHECK(names(here) == std::set<std::string>{"a"});
}

TEST_CASE("an atomic file takes its place only when committed") {
    const auto here = folder("atomic");
    const auto target = here / "a";
    std::ofstream(target) << "old";
    {
        AtomicFile file(target);
        std::ofstream(file.temporary()) << "new";
        CHECK(names(here).size() == 2);
    }
    CHECK(names(here) == std::set<std::string>{"a"});
    CHECK(std::filesystem::file_size(target) == 3);
    std::filesystem::permissions(target, std::filesystem::perms(0640));
    std::filesystem::create_symlink("a", here / "link");
    AtomicFile file(here / "link");
    std::ofstream(file.temporary()) << "newer";
    file.commit();
    CHECK(names(here) == std::set<std::string>{"a", "link"});
    CHECK(std::filesystem::is_symlink(here / "link"));
    CHECK(std::filesystem::file_size(target) == 5);
    CHECK(std::filesystem::status(target).permissions() == std::filesystem::perms(0640));
}

TEST_CASE("a reader that goes away ends a query quietly") {
    const std::string field = scratch("pipe.vdb").string();
    REQUIRE(run({"build", sphereFile().string(), "-o", field, "--voxel-size", "0.1"}).status == 0);
    std::string points;
    for (int i = 0; i < 100000; ++i) points += "0 0 0\n";
    const std::string command = std::string(BILAYER_PROGRAM) + " query " + field + " < " +
                                textFile("points.txt", points).string() + " 2> " + scratch("pipe.err").string() +
                                " | head -1";
    CHECK(std::system((command + " > /dev/null").c_str()) == 0);
    CHECK(std::filesystem::file_size(scratch("pipe.err")) == 0);
}
}  // namespace bilayer::files_test
