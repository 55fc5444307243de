// SPDX-License-Identifier: Apache-2.0
// What can end the mesh of a `bilayer batch` ends that mesh alone; what ends the batch leaves nothing behind.
#include <signal.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <fstream>
#include <iterator>
#include <thread>

#include <bilayer/sdf/mesh_io.h>
#include <bilayer/sdf/vdb_io.h>
#include "demos/shared/shapes.h"
#include "tests/support/scene_files.h"
#include "tests/support/support.h"
#include "tests/tools/library.h"
#include "tests/tools/program.h"

namespace bilayer::batch_limits_test {
using namespace bilayer::test;

namespace fs = std::filesystem;

namespace {

constexpr int smallCount = 4;
// A sphere of this radius takes seconds and hundreds of megabytes at the voxel size of the library, a box nothing.
constexpr float hugeRadius = 60;

fs::path libraryWithSphere(const std::string& name, float radius) {
    const fs::path library = boxLibrary(name, smallCount);
    writeMesh(library / "sphere.ply", shapes::sphere(radius, 5));
    return library;
}

// Runs a batch in which only the sphere fails. Returns the sphere's record.
nlohmann::json sphereFailure(const fs::path& library, const std::string& output, const Words& options) {
    const fs::path fields = emptyFolder(output);
    const Result r = run(batchWords(library, fields, options));
    INFO(r.err);
    CHECK(r.status == 1);
    CHECK(r.errorLines() == 1);
    const auto records = recordsIn(r.out);
    CHECK(records.size() == smallCount + 1);
    CHECK(fieldsIn(fields).size() == smallCount);
    CHECK(leftovers(fields).empty());
    const nlohmann::json record = records.at("sphere.ply");
    INFO(record.dump());
    CHECK(record["outcome"] == "failed");
    return record;
}

std::map<std::string, nlohmann::json> recordsOf(const fs::path& output) {
    std::string lines;
    for (const auto& entry : fs::directory_iterator(output / ".bilayer/records")) lines += contents(entry.path());
    return recordsIn(lines);
}

// Whether a process ends within five seconds. The kernel ends the child of a killed process a moment later.
bool ends(pid_t process) {
    for (int i = 0; i < 500; ++i) {
        const std::string state = contents("/proc/" + std::to_string(process) + "/stat");
        if (state.empty() || state.find(") Z ") != std::string::npos) return true;
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return false;
}

// Whether all fields are whole.
void requireWhole(const fs::path& output) {
    for (const auto& [name, bytes] : fieldsIn(output)) CHECK_NOTHROW(readVdb(output / name));
}

}  // namespace

TEST_CASE("a mesh that takes too long is ended alone") {
    const auto record = sphereFailure(libraryWithSphere("slow", hugeRadius), "slow_fields", {"--time-limit", "0.7"});
    CHECK(record["reason"] == "time limit");
    CHECK(record["error"] == "took longer than the time limit of 0.7 s");
    CHECK(record["seconds"]["total"].get<double>() < 5);
    // what was known by then
    CHECK(record["triangles"] == shapes::sphere(hugeRadius, 5).triangles.size());
    CHECK(record["sourceHash"].get<std::string>().size() == 16);
    CHECK(record["estimatedBytes"].get<double>() > 1e6);
}

TEST_CASE("a mesh that needs too much memory is ended alone") {
    const auto record =
        sphereFailure(libraryWithSphere("memory", hugeRadius), "memory_fields", {"--memory-limit", "128"});
    CHECK(record["reason"] == "memory limit");
    CHECK(record["error"].get<std::string>().find("128 MiB") != std::string::npos);
    CHECK(record["peakBytes"].get<double>() < 400e6);
    CHECK(record["triangles"] == shapes::sphere(hugeRadius, 5).triangles.size());
}

TEST_CASE("an importer that lacks memory does not call a file empty or damaged") {
    const fs::path library = emptyFolder("importer"), output = emptyFolder("importer_fields");
    for (const SceneFile& file : cubeFiles()) std::ofstream(library / file.name, std::ios::binary) << file.bytes;
    std::size_t done = 0, failed = 0;
    for (int limit = 10; limit <= 100; limit += 10) {
        const Result r = run(batchWords(library, output, {"--memory-limit", std::to_string(limit)}));
        for (const auto& [name, record] : recordsIn(r.out)) {
            INFO(record.dump());
            if (record["outcome"] != "failed") {
                ++done;
                continue;
            }
            ++failed;
            const std::string error = record["error"];
            CHECK((record["reason"] == "memory limit" || error.find("may need more than") != std::string::npos));
        }
    }
    CHECK(done > 0);
    CHECK(failed > 0);
}

TEST_CASE("a crash ends one mesh alone") {
    const int signal = GENERATE(SIGSEGV, SIGABRT, SIGKILL);
    CAPTURE(signal);
    const fs::path library = emptyFolder("crash"), output = emptyFolder("crash_fields");
    writeMesh(library / "sphere.ply", shapes::sphere(hugeRadius, 5));
    writeMesh(library / "z.ply", shapes::box({0.5f, 0.5f, 0.5f}));
    const pid_t batch = start(batchWords(library, output, {"--threads", "1"}));
    const auto children = childrenOf(batch, 1);
    REQUIRE(children.size() == 1);
    // the first mesh is the sphere, which takes seconds
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    ::kill(children[0], signal);
    CHECK(wait(batch) == 1);
    const auto records = recordsOf(output);
    CHECK(records.at("z.ply")["outcome"] == "done");
    CHECK(records.at("sphere.ply")["outcome"] == "failed");
    CHECK(records.at("sphere.ply")["reason"] == "crash");
    CHECK(records.at("sphere.ply")["triangles"] == shapes::sphere(hugeRadius, 5).triangles.size());
    CHECK(records.at("sphere.ply")["error"].get<std::string>().find("signal " + std::to_string(signal)) !=
          std::string::npos);
    CHECK(leftovers(output).empty());
}

TEST_CASE("a mesh whose process ends is tried again if that process has converted others") {
    const int kills = GENERATE(1, 2);
    CAPTURE(kills);
    const fs::path library = boxLibrary("again", smallCount), output = emptyFolder("again_fields");
    writeMesh(library / "z.ply", shapes::sphere(hugeRadius / 2, 5));  // the last one takes a while
    const pid_t batch = start(batchWords(library, output, {"--threads", "1"}));
    while (fieldsIn(output).size() < smallCount && ::kill(batch, 0) == 0)
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    pid_t killed = 0;
    for (int i = 0; i < kills; ++i) {
        std::vector<pid_t> children;
        while ((children = childrenOf(batch, 1)).empty() || children[0] == killed)
            std::this_thread::sleep_for(std::chrono::milliseconds(2));
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
        ::kill(killed = children[0], SIGKILL);
    }
    CHECK(wait(batch) == kills - 1);
    const auto records = recordsOf(output);
    CHECK(records.size() == smallCount + 1);
    CHECK(records.at("z.ply")["outcome"] == (kills == 1 ? "done" : "failed"));
    CHECK(leftovers(output).empty());
}

TEST_CASE("the peak memory of a mesh is its own, not that of a mesh before it") {
    const fs::path library = emptyFolder("peaks"), output = emptyFolder("peaks_fields");
    writeMesh(library / "a.ply", shapes::sphere(hugeRadius / 2, 5));
    writeMesh(library / "b.ply", shapes::box({0.5f, 0.5f, 0.5f}));
    const Result r = run(batchWords(library, output, {"--threads", "1"}));
    REQUIRE(r.status == 0);
    const auto records = recordsIn(r.out);
    const double large = records.at("a.ply")["peakBytes"], small = records.at("b.ply")["peakBytes"];
    CAPTURE(large, small);
    CHECK(small < large / 2);
}

TEST_CASE("a process that converts meshes has no more threads than it may use") {
    const fs::path library = boxLibrary("threads", smallCount), output = emptyFolder("threads_fields");
    writeMesh(library / "z.ply", shapes::sphere(hugeRadius / 2, 5));  // the last one takes a while
    const pid_t batch = start(batchWords(library, output, {"--threads", "1"}));
    const auto children = childrenOf(batch, 1);
    REQUIRE(children.size() == 1);
    while (fieldsIn(output).size() < smallCount && ::kill(batch, 0) == 0)
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    const fs::directory_iterator threads("/proc/" + std::to_string(children[0]) + "/task");
    CHECK(std::distance(begin(threads), end(threads)) == 1);
    CHECK(wait(batch) == 0);
}

TEST_CASE("an interrupted batch leaves no half file, and continues where it was") {
    const int signal = GENERATE(SIGINT, SIGTERM, SIGKILL);
    CAPTURE(signal);
    const fs::path library = boxLibrary("interrupted", 40), output = emptyFolder("interrupted_fields"),
                   whole = emptyFolder("whole_fields");
    writeMesh(library / "z.ply", shapes::sphere(hugeRadius / 3, 5));  // the last one takes a while
    REQUIRE(run(batchWords(library, whole)).status == 0);
    const pid_t batch = start(batchWords(library, output));
    const auto children = childrenOf(batch, 1);
    while (fieldsIn(output).size() < 5 && ::kill(batch, 0) == 0 && !children.empty())
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    ::kill(batch, signal);
    CHECK(wait(batch) == 128 + signal);
    const std::size_t finished = fieldsIn(output).size();
    CHECK(finished >= 5);
    CHECK(finished <= 40);
    requireWhole(output);
    if (signal != SIGKILL) CHECK(leftovers(output).empty());
    for (const pid_t child : children) CHECK(ends(child));
    const Result r = run(batchWords(library, output));
    REQUIRE(r.status == 0);
    std::size_t skipped = 0;
    for (const auto& [name, record] : recordsIn(r.out)) skipped += record["outcome"] == "skipped";
    CHECK(skipped == finished);
    CHECK(fieldsIn(output) == fieldsIn(whole));
    CHECK(leftovers(output).empty());
}

TEST_CASE("no worker outlives its batch") {
    const fs::path library = libraryWithSphere("orphans", hugeRadius), output = emptyFolder("orphan_fields");
    const int signal = GENERATE(SIGTERM, SIGKILL);
    CAPTURE(signal);
    const pid_t batch =
        start({"batch", (library / "sphere.ply").string(), "-o", output.string(), "--voxel-size", "0.1"});
    const auto children = childrenOf(batch, 1);
    REQUIRE(children.size() == 1);
    ::kill(batch, signal);
    CHECK(wait(batch) == 128 + signal);
    CHECK(ends(children[0]));
    CHECK(fieldsIn(output).empty());
}

TEST_CASE("batches that overlap convert each mesh once") {
    const fs::path library = boxLibrary("overlap", 40), output = emptyFolder("overlap_fields"),
                   whole = emptyFolder("whole_fields");
    REQUIRE(run(batchWords(library, whole)).status == 0);
    std::vector<pid_t> batches;
    for (const char* shard : {"1/1", "1/1", "1/2"})
        batches.push_back(start(batchWords(library, output, {"--shard", shard})));
    for (const pid_t batch : batches) CHECK(wait(batch) == 0);
    CHECK(fieldsIn(output) == fieldsIn(whole));
    CHECK(leftovers(output).empty());
    std::map<std::string, int> conversions;
    for (const auto& entry : fs::directory_iterator(output / ".bilayer/records"))
        for (const auto& [name, record] : recordsIn(contents(entry.path())))
            conversions[name] += record["outcome"] == "done";
    CHECK(conversions.size() == 40);
    for (const auto& [name, count] : conversions) CHECK(count == 1);
}
}  // namespace bilayer::batch_limits_test
