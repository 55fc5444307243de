// SPDX-License-Identifier: Apache-2.0
// Checks which folder includes which, between the libraries and inside each.
#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/house/include_graph.h"
#include "tests/house/sources.h"

namespace bilayer::includes_test {
using namespace bilayer::test;

namespace {

// The libraries, and the programs on top of them: each may include itself and the listed ones.
const std::map<std::string, std::set<std::string>> allowed{
    {"sdf", {}},
    {"collider", {"sdf"}},
    {"cl", {"collider", "sdf"}},
    {"integration/bullet", {"collider", "sdf"}},
    {"integration/fluid", {"collider", "sdf"}},
    {"integration/python", {"integration/fluid", "collider", "cl", "sdf"}},
    {"integration/mpi", {}},
    {"tools", {"integration/bullet", "integration/fluid", "integration/mpi", "collider", "cl", "sdf"}},
    {"demos", {"integration/bullet", "integration/fluid", "collider", "cl", "sdf"}},
    {"bench", {"demos", "integration/bullet", "integration/fluid", "collider", "cl", "sdf"}},
};

// The library or program folder that contains a path, or nothing.
std::string room(const std::string& path) {
    for (const auto& [name, ignored] : allowed)
        if (path.rfind(name + "/", 0) == 0) return name;
    return {};
}

// The folder of a file within its library, "io/formats" for one; empty for a file directly in it.
std::string folderIn(const std::string& library, const std::string& path) {
    const std::string rest = path.substr(library.size() + 1);
    const std::size_t end = rest.rfind('/');
    return end == std::string::npos ? "" : rest.substr(0, end);
}

// The layer of a folder in its library. Throws for an unknown folder.
std::size_t floorOf(const std::string& library, const std::string& folder) {
    const std::vector<std::string>& all = floors.at(library);
    const auto found = std::find(all.begin(), all.end(), folder);
    if (found == all.end()) throw std::invalid_argument(library + " has no floor " + folder);
    return std::size_t(found - all.begin());
}

// The highest layer that stands in the same folder of the library: "contact" for "contact/body".
std::size_t highestFloorWith(const std::string& library, const std::string& folder) {
    const std::vector<std::string>& all = floors.at(library);
    const std::string first = folder.substr(0, folder.find('/'));
    std::size_t highest = floorOf(library, folder);
    for (std::size_t i = highest; i < all.size(); ++i)
        if (all[i] == first || all[i].rfind(first + "/", 0) == 0) highest = i;
    return highest;
}

// The layer of a file in its library: that of its folder. Public headers have a listed one, and their source files the
// highest one of its folder; all others that stand directly in the library's folder are above all folders.
std::size_t floorOfFile(const std::string& library, const std::string& path) {
    const std::string folder = folderIn(library, path);
    if (!folder.empty()) return floorOf(library, folder);
    const auto listed = publicFloors.find(path.substr(0, path.rfind('.')) + ".h");
    if (listed == publicFloors.end()) return floors.at(library).size();
    return path.ends_with(".h") ? floorOf(library, listed->second) : highestFloorWith(library, listed->second);
}

bool isPublicHeader(const std::string& path) {
    const std::string library = room(path);
    return floors.count(library) && folderIn(library, path).empty() && path.ends_with(".h");
}

// The fault of an include line, or nothing.
std::string complaint(const std::string& file, const std::string& line) {
    const Include include = includeOf(line);
    const std::string &included = include.path, from = room(file), to = room(included);
    if (included.empty()) return {};
    if (included.find("../") != std::string::npos) return "includes by a relative path";
    if (isPublicHeader(included) != (include.bilayer && !include.quoted) && (include.bilayer || !to.empty()))
        return "includes " + included + " otherwise than public headers as <bilayer/...> and others as \"...\"";
    if (include.quoted && to.empty() && included.rfind("tests/", 0) != 0 && !file.ends_with(".cl"))
        return "includes " + included + " otherwise than from the root";
    if (from.empty()) return {};
    // the ground truth of the tests is also the reference of the accuracy benchmark
    if (from == "bench" && included.rfind("tests/support/", 0) == 0) return {};
    if (included.rfind("tests/", 0) == 0) return "includes tests";
    if (to.empty()) return {};
    if (to != from && !allowed.at(from).count(to)) return "includes " + to + " from " + from;
    if (isPublicHeader(file) && !isPublicHeader(included)) return "a public header includes a private one";
    if (to != from || !floors.count(from)) return {};
    if (file.ends_with(".cl") || floorOfFile(from, included) <= floorOfFile(from, file)) return {};
    return "includes " + included + " above it";
}

}  // namespace

TEST_CASE("no include runs upward") {
    int includes = 0;
    std::string wrong;
    eachLine([&](const std::string& file, int number, const std::string& line) {
        includes += line.rfind("#include", 0) == 0;
        const std::string text = complaint(file, line);
        if (!text.empty()) wrong += file + ":" + std::to_string(number) + " " + text + "\n";
    });
    CHECK(wrong == "");
    CHECK(includes > 100);
}

TEST_CASE("the rule itself finds what it should") {
    CHECK(complaint("sdf/a.h", "#include <bilayer/cl/device.h>") != "");
    CHECK(complaint("sdf/a.h", "#include <bilayer/collider/field.h>") != "");
    CHECK(complaint("sdf/a.h", "#include \"sdf/mesh/topology.h\"") != "");
    CHECK(complaint("sdf/a.h", "#include \"sdf/mesh.h\"") != "");
    CHECK(complaint("sdf/a.cpp", "#include <bilayer/sdf/mesh/topology.h>") != "");
    CHECK(complaint("sdf/mesh/a.cpp", "#include \"sdf/sign/winding.h\"") != "");
    CHECK(complaint("collider/field/layout/a.h", "#include \"collider/contact/body/body.h\"") != "");
    CHECK(complaint("sdf/leaf/a.h", "#include <bilayer/sdf/build.h>") != "");
    CHECK(complaint("sdf/bvh/a.h", "#include <bilayer/sdf/inspect.h>") != "");
    CHECK(complaint("sdf/mesh.cpp", "#include \"sdf/mesh/topology.h\"") != "");
    CHECK(complaint("sdf/mesh.h", "#include <bilayer/sdf/inspect.h>") != "");
    CHECK(complaint("collider/field/tiled/a.cpp", "#include <bilayer/collider/contact.h>") != "");
    CHECK(complaint("collider/a.cpp", "  # include <bilayer/integration/fluid/seed.h>") != "");
    CHECK(complaint("integration/fluid/a.cpp", "#include <bilayer/integration/bullet/shape.h>") != "");
    CHECK(complaint("collider/a.cpp", "#include <bilayer/cl/field.h>") != "");
    CHECK(complaint("sdf/a.cpp", "#include \"demos/shared/shapes.h\"") != "");
    CHECK(complaint("sdf/a.cpp", "#include \"tests/support/support.h\"") != "");
    CHECK(complaint("collider/field/zero/a.h", "#include \"collider/field/queries/field_rays.h\"") != "");
    CHECK(complaint("collider/field.cpp", "#include \"collider/contact/body/body.h\"") != "");
    CHECK(complaint("collider/field.cpp", "#include \"collider/field/queries/field_rays.h\"") == "");
    CHECK(complaint("sdf/level_set.cpp", "#include \"tiles/tiling.h\"") != "");
    CHECK(complaint("sdf/grid/a.h", "#include \"assemble.h\"") != "");
    CHECK(complaint("tests/sdf/a.cpp", "#include \"outlines.h\"") != "");
    CHECK(complaint("sdf/fill/a.cpp", "#include \"sdf/io/input_file.h\"") != "");
    CHECK(complaint("sdf/io/a.cpp", "#include \"sdf/io/formats/stl_records.h\"") != "");
    CHECK(complaint("sdf/io/formats/a.cpp", "#include \"sdf/io/input_file.h\"") == "");
    CHECK(complaint("cl/kernels/a.cl", "#include \"layout.cl\"") == "");
    CHECK(complaint("cl/a.cpp", "#include <bilayer/sdf/build.h>") == "");
    CHECK(complaint("cl/a.cpp", "#include \"sdf/sign/winding.h\"") == "");
    CHECK(complaint("sdf/sign/a.cpp", "#include \"sdf/mesh/topology.h\"") == "");
    CHECK(complaint("sdf/a.cpp", "#include \"sdf/grid/assemble.h\"") == "");
    CHECK(complaint("sdf/a.h", "#include <bilayer/sdf/mesh.h>") == "");
    CHECK(complaint("sdf/sign/a.h", "#include <bilayer/sdf/level_set.h>") == "");
    CHECK(complaint("sdf/a.h", "#include <bilayer/sdf/build.h>") == "");
    CHECK(complaint("tools/a.cpp", "#include <bilayer/integration/fluid/seed.h>") == "");
    CHECK(complaint("sdf/a.cpp", "#include <vector>") == "");
    CHECK_THROWS_AS(complaint("sdf/attic/a.cpp", "#include \"sdf/mesh/topology.h\""), std::invalid_argument);
}

TEST_CASE("no files include each other in a circle") {
    const IncludeGraph graph = includeGraph(folders);
    CHECK(graph.size() > 500);
    std::string circle;
    for (const std::string& file : findCycle(graph)) circle += file + "\n";
    CHECK(circle == "");
}

TEST_CASE("circles, and all files that a file reaches, are found") {
    const IncludeGraph tree{{"a.h", {"b.h", "c.h"}}, {"b.h", {"d.h"}}, {"b.cpp", {"b.h", "e.h"}},
                            {"c.h", {"d.h"}},        {"d.h", {}},      {"e.h", {}}};
    CHECK(findCycle(tree).empty());
    CHECK(includedBy(tree, "a.h") == std::set<std::string>{"a.h", "b.h", "c.h", "d.h"});
    CHECK(includedBy(callGraph(tree), "a.h").count("e.h") == 1);
    CHECK(includedBy(callGraph(tree), "c.h").count("e.h") == 0);
    IncludeGraph circle = tree;
    circle["d.h"].insert("b.h");
    CHECK(findCycle(circle) == std::vector<std::string>{"b.h", "d.h", "b.h"});
}

TEST_CASE("public headers are few, the options stand at the bottom, and building reads no files") {
    std::size_t headers = 0;
    for (const auto& [library, ignored] : floors)
        for (const auto& entry : fs::directory_iterator(fs::path(BILAYER_SOURCES) / library))
            headers += entry.path().extension() == ".h";
    CHECK(headers <= 30);
    for (const auto& [header, folder] : publicFloors) {
        CAPTURE(header, folder);
        CHECK(fs::exists(fs::path(BILAYER_SOURCES) / header));
    }
    const IncludeGraph graph = includeGraph({"sdf"});
    CHECK(includedBy(graph, "sdf/options.h") == std::set<std::string>{"sdf/options.h"});
    std::string reading;
    const auto filesUsedBy = [&](const IncludeGraph& uses, const std::string& start) {
        for (const std::string& file : includedBy(uses, start))
            if (file.rfind("sdf/io/", 0) == 0 || file == "sdf/mesh_io.h" || file == "sdf/vdb_io.h")
                reading += start + " reaches " + file + "\n";
    };
    filesUsedBy(graph, "sdf/build.h");
    for (const auto& [file, ignored] : graph)
        for (const char* folder : {"sdf/leaf/", "sdf/bvh/", "sdf/mesh/", "sdf/sign/", "sdf/fill/"})
            if (file.rfind(folder, 0) == 0) filesUsedBy(callGraph(graph), file);
    filesUsedBy(callGraph(graph), "sdf/grid/field_build.h");
    CHECK(reading == "");
}
}  // namespace bilayer::includes_test
