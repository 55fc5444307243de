// SPDX-License-Identifier: Apache-2.0
// `bilayer batch`: which meshes it converts, what it skips, and what it says.
#include <algorithm>
#include <catch2/catch.hpp>
#include <fstream>

#include <bilayer/sdf/mesh_io.h>
#include <bilayer/sdf/vdb_io.h>
#include "demos/shared/shapes.h"
#include "tests/support/support.h"
#include "tests/tools/gltf_triangle.h"
#include "tests/tools/library.h"
#include "tests/tools/program.h"

namespace bilayer::batch_test {
using namespace bilayer::test;

namespace fs = std::filesystem;

namespace {

constexpr int meshCount = 24;

void requireUsage(const Words& words, const std::string& culprit) {
    const Result r = run(words);
    std::string command;
    for (const std::string& word : words) command += word + " ";
    INFO(command << "\n" << r.err);
    CHECK(r.status == 2);
    CHECK(r.err.find(culprit) != std::string::npos);
    CHECK(r.out.empty());
}

std::map<std::string, nlohmann::json> convertAll(const Words& words, const Surroundings& surroundings = {}) {
    const Result r = run(words, surroundings);
    INFO(r.err);
    REQUIRE(r.status == 0);
    CHECK(r.err.empty());
    return recordsIn(r.out);
}

std::size_t countOf(const std::map<std::string, nlohmann::json>& records, const std::string& outcome) {
    return std::size_t(std::count_if(records.begin(), records.end(),
                                     [&](const auto& entry) { return entry.second["outcome"] == outcome; }));
}

}  // namespace

TEST_CASE("a batch makes the fields that single builds make") {
    const fs::path library = boxLibrary("library", meshCount), output = emptyFolder("fields");
    const auto records = convertAll(batchWords(library, output));
    CHECK(countOf(records, "done") == meshCount);
    const auto fields = fieldsIn(output);
    CHECK(fields.size() == meshCount);
    CHECK(leftovers(output).empty());
    for (const auto& [name, record] : records) {
        CAPTURE(name, record.dump());
        CHECK(record["triangles"] == 48);
        CHECK(record["sign"] == "normals");
        CHECK(record["signReason"] == "closed and oriented");
        CHECK(record["signConflicts"] == 0);
        CHECK(record["peakBytes"].get<double>() > 1e6);
        for (const char* part : {"read", "build", "write", "hash", "total"})
            CHECK(record["seconds"][part].get<double>() >= 0);
        for (const char* hash : {"sourceHash", "optionsHash", "meshHash"})
            CHECK(record[hash].get<std::string>().size() == 16);
        CHECK(fields.contains(name + ".vdb"));
    }
    const fs::path single = scratch("single.vdb");
    REQUIRE(run({"build", (library / "a/2.ply").string(), "-o", single.string(), "--voxel-size", "0.1"}).status == 0);
    const LevelSet alone = readVdb(single), batched = readVdb(output / "a/2.ply.vdb");
    CHECK(alone.activeVoxels() == batched.activeVoxels());
    CHECK(alone.meshHash() == batched.meshHash());
    const std::string ask = "0 0 0\n0.45 0.1 0.2\n0.6 0 0\n";
    CHECK(run({"query", single.string()}, {.input = ask}).out ==
          run({"query", (output / "a/2.ply.vdb").string()}, {.input = ask}).out);
}

TEST_CASE("the bytes of a batch do not depend on threads and shards") {
    const fs::path library = boxLibrary("library", meshCount);
    const fs::path one = emptyFolder("one"), two = emptyFolder("two"), shards = emptyFolder("shards");
    convertAll(batchWords(library, one, {"--threads", "1"}));
    convertAll(batchWords(library, two, {"--threads", "2"}));
    for (const char* shard : {"1/3", "2/3", "3/3"}) convertAll(batchWords(library, shards, {"--shard", shard}));
    CHECK(fieldsIn(one) == fieldsIn(two));
    CHECK(fieldsIn(one) == fieldsIn(shards));
}

TEST_CASE("shards are disjoint, complete and stable") {
    const fs::path output = emptyFolder("sharded");
    // returns the shard of each mesh
    const auto shardsOf = [&](const fs::path& library) {
        std::map<std::string, int> shards;
        for (int shard = 1; shard <= 4; ++shard)
            for (const auto& [name, record] :
                 convertAll(batchWords(library, output, {"--shard", std::to_string(shard) + "/4"}))) {
                CHECK(record["shard"] == std::to_string(shard) + "/4");
                CHECK(shards.emplace(name, shard).second);
            }
        return shards;
    };
    const auto few = shardsOf(boxLibrary("few", meshCount));
    const auto many = shardsOf(boxLibrary("many", 2 * meshCount));
    CHECK(few.size() == meshCount);
    CHECK(many.size() == 2 * meshCount);
    std::set<int> used;
    for (const auto& [name, shard] : few) {
        CHECK(many.at(name) == shard);
        used.insert(shard);
    }
    CHECK(used.size() == 4);
}

TEST_CASE("the shard of a name is the same in every version and on every machine") {
    const fs::path library = emptyFolder("names"), output = emptyFolder("named");
    for (const char* name : {"armadillo", "bunny", "dragon", "fandisk", "happy", "igea", "lucy", "teapot"})
        writeMesh(library / (std::string(name) + ".obj"), shapes::box({0.5f, 0.5f, 0.5f}));
    const auto records = convertAll(batchWords(library, output, {"--shard", "1/3"}));
    std::set<std::string> names;
    for (const auto& [name, record] : records) names.insert(name);
    CHECK(names == std::set<std::string>{"dragon.obj", "happy.obj", "teapot.obj"});
}

TEST_CASE("the shard of an array task is the default") {
    const fs::path library = boxLibrary("library", meshCount);
    const auto taskNames = [&](const std::vector<std::string>& variables) {
        std::set<std::string> names;
        for (const auto& [name, record] :
             convertAll(batchWords(library, emptyFolder("task")), {.variables = variables}))
            names.insert(name);
        return names;
    };
    const auto shardNames = [&](const char* shard) {
        std::set<std::string> names;
        for (const auto& [name, record] : convertAll(batchWords(library, emptyFolder("task"), {"--shard", shard})))
            names.insert(name);
        return names;
    };
    const auto task = [](const char* id, const char* count, const char* min, const char* max) {
        return std::vector<std::string>{
            std::string("SLURM_ARRAY_TASK_ID=") + id, std::string("SLURM_ARRAY_TASK_COUNT=") + count,
            std::string("SLURM_ARRAY_TASK_MIN=") + min, std::string("SLURM_ARRAY_TASK_MAX=") + max};
    };
    CHECK(taskNames(task("0", "4", "0", "3")) == shardNames("1/4"));
    CHECK(taskNames(task("3", "4", "0", "3")) == shardNames("4/4"));
    CHECK(taskNames(task("14", "3", "10", "18")) == shardNames("2/3"));
    CHECK(taskNames(task("7", "1", "7", "7")) == shardNames("1/1"));
    const Words words = batchWords(library, emptyFolder("task"));
    for (const auto& uneven : {task("2", "3", "1", "4"), task("9", "4", "0", "3"), task("x", "4", "0", "3")}) {
        const Result r = run(words, {.variables = uneven});
        CHECK(r.status == 2);
        CHECK(r.err.find("SLURM_ARRAY_TASK_ID") != std::string::npos);
    }
}

TEST_CASE("finished work is skipped by content, not by name or time") {
    const fs::path library = boxLibrary("library", 6), output = emptyFolder("skipped");
    const Words words = batchWords(library, output);
    CHECK(countOf(convertAll(words), "done") == 6);
    CHECK(countOf(convertAll(words), "skipped") == 6);

    SECTION("a new time is no new content") {
        fs::last_write_time(library / "a/0.ply", fs::file_time_type::clock::now() + std::chrono::hours(1));
        CHECK(countOf(convertAll(words), "skipped") == 6);
    }
    SECTION("a mesh that changed is built again, even if it looks older") {
        const auto before = fs::last_write_time(library / "a/0.ply");
        writeMesh(library / "a/0.ply", shapes::box({0.5f, 0.5f, 0.9f}, 2));
        fs::last_write_time(library / "a/0.ply", before - std::chrono::hours(1));
        const auto records = convertAll(words);
        CHECK(countOf(records, "skipped") == 5);
        CHECK(records.at("a/0.ply")["outcome"] == "done");
    }
    SECTION("other options build all again, other threads do not") {
        CHECK(countOf(convertAll(batchWords(library, output, {"--threads", "1"})), "skipped") == 6);
        CHECK(countOf(convertAll(batchWords(library, output, {"--half-float"})), "done") == 6);
        CHECK(countOf(convertAll(words), "done") == 6);
    }
    SECTION("a field with a wrong byte, a truncated one and a missing one are built again") {
        const auto whole = fieldsIn(output);
        const fs::path field = output / "a/0.ply.vdb";
        std::string bytes = contents(field);
        bytes[bytes.size() / 2] = char(bytes[bytes.size() / 2] ^ 1);
        std::ofstream(field, std::ios::binary) << bytes;
        fs::resize_file(output / "a/2.ply.vdb", 1000);
        fs::remove(output / "b/1.ply.vdb");
        fs::copy_file(output / "a/4.ply.vdb", output / "b/3.ply.vdb", fs::copy_options::overwrite_existing);
        const auto records = convertAll(words);
        CHECK(countOf(records, "done") == 4);
        CHECK(countOf(records, "skipped") == 2);
        CHECK(fieldsIn(output) == whole);
    }
}

TEST_CASE("a .gltf file with changed buffers is another mesh") {
    const fs::path library = emptyFolder("gltf"), output = emptyFolder("gltf_fields");
    writeGltf(library, "t", 1, 1);
    writeGltfTriangle(library, "t", 1);
    const Words words = batchWords(library, output, {"--sign", "flood"});
    CHECK(countOf(convertAll(words), "done") == 1);
    CHECK(countOf(convertAll(words), "skipped") == 1);
    writeGltfTriangle(library, "t", 0.75f);
    CHECK(countOf(convertAll(words), "done") == 1);
}

TEST_CASE("meshes are given by name, by a list or by a tree") {
    const fs::path library = boxLibrary("library", 3);
    const std::string list =
        textFile("list.txt", (library / "a/0.ply").string() + "\n\n" + (library / "b/1.ply").string() + "\r\n" +
                                 (library / "a/0.ply").string() + "\n")
            .string();
    const Words options{"--voxel-size", "0.1", "--json"};
    const auto convert = [&](Words words, const std::string& input = {}) {
        const fs::path output = emptyFolder("given");
        words.insert(words.begin(), "batch");
        words.insert(words.end(), {"-o", output.string()});
        words.insert(words.end(), options.begin(), options.end());
        convertAll(words, {.input = input});
        return fieldsIn(output).size();
    };
    CHECK(convert({(library / "a/0.ply").string()}) == 1);
    CHECK(convert({"--list", list}) == 2);
    CHECK(convert({"--list", "-"}, contents(list)) == 2);
    CHECK(convert({"--tree", library.string()}) == 3);
    // an absolute path is a name without its first slash
    CHECK(fs::exists(scratch("given") / (library / "a/0.ply").relative_path()) == false);
    convert({(library / "a/0.ply").string()});
    CHECK(fs::exists(scratch("given") / ((library / "a/0.ply").relative_path().string() + ".vdb")));
}

TEST_CASE("a bad mesh fails alone, and its record names the reason") {
    const fs::path library = boxLibrary("bad", 4), output = emptyFolder("bad_fields");
    std::ofstream(library / "a/empty.obj");
    std::ofstream(library / "b/range.obj") << "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 7\n";
    fs::create_symlink("absent.ply", library / "b/dangling.ply");
    fs::create_symlink("loop.ply", library / "b/loop.ply");
    const Result r = run(batchWords(library, output));
    CHECK(r.status == 1);
    CHECK(r.errorLines() == 1);
    CHECK(r.err.find("4 of 8 meshes failed") != std::string::npos);
    CHECK(r.err.find("empty.obj") != std::string::npos);
    const auto records = recordsIn(r.out);
    CHECK(countOf(records, "done") == 4);
    for (const char* name : {"a/empty.obj", "b/range.obj", "b/dangling.ply", "b/loop.ply"}) {
        CAPTURE(name);
        CHECK(records.at(name)["outcome"] == "failed");
        CHECK(records.at(name)["reason"] == "error");
        CHECK(records.at(name)["error"].get<std::string>().find(name) != std::string::npos);
    }
    CHECK(fieldsIn(output).size() == 4);
    CHECK(leftovers(output).empty());
}

TEST_CASE("a large mesh is built alone by all threads") {
    const fs::path library = boxLibrary("mixed", 3), output = emptyFolder("mixed_fields");
    writeMesh(library / "large.ply", shapes::sphere(20));
    const auto records = convertAll(batchWords(library, output, {"--large-memory", "8", "--threads", "2"}));
    CHECK(countOf(records, "done") == 4);
    CHECK(records.at("large.ply")["alone"] == true);
    CHECK(records.at("large.ply")["threads"] == 2);
    CHECK(records.at("large.ply")["estimatedBytes"].get<double>() > 8 * (1 << 20));
    CHECK(records.at("a/0.ply")["alone"] == false);
    CHECK(records.at("a/0.ply")["estimatedBytes"].get<double>() < 8 * (1 << 20));
}

TEST_CASE("outputs that cannot be written are errors") {
    const fs::path library = boxLibrary("library", 2), output = emptyFolder("blocked");
    fs::create_directories(output / "a/0.ply.vdb" / "full");
    const Result r = run(batchWords(library, output));
    CHECK(r.status == 1);
    const auto records = recordsIn(r.out);
    CHECK(records.at("a/0.ply")["outcome"] == "failed");
    CHECK(records.at("a/0.ply")["error"].get<std::string>().find("a/0.ply.vdb") != std::string::npos);
    CHECK(records.at("b/1.ply")["outcome"] == "done");
    const std::string file = textFile("no_folder", "").string();
    const Result none = run(batchWords(library, file));
    CHECK(none.status == 1);
    CHECK(none.errorLines() == 1);
    CHECK(none.err.find(file) != std::string::npos);
}

TEST_CASE("wrong usage of batch") {
    const std::string mesh = sphereFile().string(), output = scratch("usage").string();
    const auto with = [&](const Words& options) {
        Words words{"batch", mesh, "-o", output, "--voxel-size", "0.1"};
        words.insert(words.end(), options.begin(), options.end());
        return words;
    };
    requireUsage({"batch"}, "--list");
    requireUsage({"batch", "-o", output, "--voxel-size", "0.1"}, "--list");
    requireUsage({"batch", mesh, "--voxel-size", "0.1"}, "--output");
    requireUsage({"batch", mesh, "-o", output}, "--resolution");
    requireUsage(with({"--resolution", "10"}), "voxel");
    requireUsage(with({"--list", "a.txt"}), "--list");
    requireUsage({"batch", "--tree", scratch("absent").string(), "-o", output, "--voxel-size", "0.1"}, "--tree");
    for (const char* shard : {"0/2", "3/2", "1", "1/", "/2", "-1/2", "1/2/3", "a/b", "1/0"})
        requireUsage(with({"--shard", shard}), "--shard");
    for (const char* value : {"0", "-1", "nan", "x"}) {
        requireUsage(with({"--time-limit", value}), "--time-limit");
        requireUsage(with({"--memory-limit", value}), "--memory-limit");
        requireUsage(with({"--large-memory", value}), "--large-memory");
    }
    requireUsage(with({"--method", "magic"}), "--method");
    requireUsage(with({"--method", "prism"}), "--backend opencl");
    requireUsage(with({"--report", output}), "--report");
    CHECK_FALSE(fs::exists(output));
    CHECK(run({"batch", "--help"}).status == 0);
    const Result absent = run({"batch", "--list", scratch("absent.txt").string(), "-o", output, "--voxel-size", "1"});
    CHECK(absent.status == 1);
    CHECK(absent.err.find("absent.txt") != std::string::npos);
}
}  // namespace bilayer::batch_test
