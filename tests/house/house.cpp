// SPDX-License-Identifier: Apache-2.0
// Checks the include dependencies between folders, and forbidden text in files.
#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "sources.h"

namespace bilayer::house_test {
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

// The folder of a file within its library; empty for a file directly in it.
std::string folderIn(const std::string& library, const std::string& path) {
    const std::string rest = path.substr(library.size() + 1);
    const std::size_t end = rest.find('/');
    return end == std::string::npos ? "" : rest.substr(0, end);
}

// The layer of a folder in its library. Throws for an unknown folder.
std::size_t floorOf(const std::string& library, const std::string& folder) {
    const std::vector<std::string>& all = floors.at(library);
    const auto found = std::find(all.begin(), all.end(), folder);
    if (found == all.end()) throw std::invalid_argument(library + " has no floor " + folder);
    return std::size_t(found - all.begin());
}

// The layer of a file in its library: that of its folder. Public headers and their source files have a listed one; all
// others that stand directly in the library's folder are above all folders.
std::size_t floorOfFile(const std::string& library, const std::string& path) {
    std::string folder = folderIn(library, path);
    if (folder.empty()) {
        const auto listed = publicFloors.find(path.substr(0, path.rfind('.')) + ".h");
        if (listed == publicFloors.end()) return floors.at(library).size();
        folder = listed->second;
    }
    return floorOf(library, folder);
}

bool isPublicHeader(const std::string& path) {
    const std::string library = room(path);
    return floors.count(library) && folderIn(library, path).empty() && path.ends_with(".h");
}

// The fault of an include line, or nothing.
std::string complaint(const std::string& file, const std::string& line) {
    static const std::regex pattern(R"re(^\s*#\s*include\s*(["<])(bilayer/)?([^">]+)[">])re");
    std::smatch match;
    if (!std::regex_search(line, match, pattern)) return {};
    const std::string included = match[3].str(), from = room(file), to = room(included);
    if (included.find("../") != std::string::npos) return "includes by a relative path";
    if (isPublicHeader(included) != (match[2].matched && match[1] == "<") && (match[2].matched || !to.empty()))
        return "includes " + included + " otherwise than public headers as <bilayer/...> and others as \"...\"";
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
    CHECK(complaint("collider/field/a.h", "#include \"collider/contact/body.h\"") != "");
    CHECK(complaint("sdf/leaf/a.h", "#include <bilayer/sdf/build.h>") != "");
    CHECK(complaint("sdf/bvh/a.h", "#include <bilayer/sdf/inspect.h>") != "");
    CHECK(complaint("sdf/mesh.cpp", "#include \"sdf/mesh/topology.h\"") != "");
    CHECK(complaint("sdf/mesh.h", "#include <bilayer/sdf/inspect.h>") != "");
    CHECK(complaint("collider/field/a.cpp", "#include <bilayer/collider/contact.h>") != "");
    CHECK(complaint("collider/a.cpp", "  # include <bilayer/integration/fluid/seed.h>") != "");
    CHECK(complaint("integration/fluid/a.cpp", "#include <bilayer/integration/bullet/shape.h>") != "");
    CHECK(complaint("collider/a.cpp", "#include <bilayer/cl/field.h>") != "");
    CHECK(complaint("sdf/a.cpp", "#include \"demos/shared/shapes.h\"") != "");
    CHECK(complaint("sdf/a.cpp", "#include \"tests/support/support.h\"") != "");
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

TEST_CASE("public headers are few, the options stand at the bottom, and building reads no files") {
    const auto includesOf = [](const std::string& header) {
        std::set<std::string> all;
        std::ifstream stream(fs::path(BILAYER_SOURCES) / header);
        static const std::regex pattern(R"re(^#include <bilayer/([^>]+)>)re");
        std::smatch match;
        for (std::string line; std::getline(stream, line);)
            if (std::regex_search(line, match, pattern)) all.insert(match[1].str());
        return all;
    };
    std::size_t headers = 0;
    for (const auto& [library, ignored] : floors)
        for (const auto& entry : fs::directory_iterator(fs::path(BILAYER_SOURCES) / library))
            headers += entry.path().extension() == ".h";
    CHECK(headers <= 30);
    for (const auto& [header, folder] : publicFloors) {
        CAPTURE(header, folder);
        CHECK(fs::exists(fs::path(BILAYER_SOURCES) / header));
    }
    CHECK(includesOf("sdf/options.h").empty());
    CHECK(includesOf("sdf/build.h") == std::set<std::string>{"sdf/level_set.h", "sdf/mesh.h", "sdf/options.h"});
}

TEST_CASE("the code has no leftovers and no paths of somebody's machine") {
    // assembled here, so that this file does not match itself
    const std::regex leftover(std::string("\\b(TO") + "DO|FIX" + "ME|X" + "XX)\\b");
    const std::regex machine(std::string("/(ho") + "me|wo" + "rk|Us" + "ers|ro" + "ot)/(?!someone)[a-zA-Z]");
    std::string wrong;
    eachLine([&](const std::string& file, int number, const std::string& line) {
        if (std::regex_search(line, leftover) || std::regex_search(line, machine))
            wrong += file + ":" + std::to_string(number) + " " + line + "\n";
    });
    CHECK(wrong == "");
}

TEST_CASE("no word of our own stands in sources and docs where the field has one") {
    // assembled here, so that this file does not match itself
    const std::regex replaced(std::string("\\b(besi") + "des?|asla" + "nt|aske" + "w|last re" + "sort|way ou" +
                                  "t|stra" + "ys?|swi" + "rl|wand" + "ers?|by and b" + "y|turned aro" + "und|as eve" +
                                  "r|nobody kn" + "ows|pier" + "c(e|es|ing)|meets its" + "elf)\\b",
                              std::regex::icase);
    std::string wrong;
    const auto check = [&](const std::string& file, int number, const std::string& line) {
        if (std::regex_search(line, replaced)) wrong += file + ":" + std::to_string(number) + " " + line + "\n";
    };
    eachLine(check);
    const fs::path root = BILAYER_SOURCES;
    int pages = 0;
    for (const auto& entry : fs::recursive_directory_iterator(root / "docs")) {
        if (entry.path().extension() != ".md") continue;
        const std::string page = fs::relative(entry.path(), root).generic_string();
        std::istringstream text(contents(page));
        std::string line;
        for (int number = 1; std::getline(text, line); ++number) check(page, number, line);
        ++pages;
    }
    CHECK(wrong == "");
    CHECK(pages > 30);
}

TEST_CASE("no source file is long") {
    constexpr std::ptrdiff_t maxLines = 400;
    for (const char* folder : {"sdf", "collider", "cl", "integration", "tools", "demos", "bench", "tests"})
        for (const std::string& file : codeIn(folder)) {
            const std::string text = contents(file);
            CAPTURE(file);
            CHECK(std::count(text.begin(), text.end(), '\n') <= maxLines);
        }
}

TEST_CASE("code compiled for several instruction sets is in anonymous namespaces") {
    // two classes of one name in one namespace are one class to the linker
    int found = 0;
    std::string wrong;
    std::map<std::string, std::string> before;
    eachLine([&](const std::string& file, int, const std::string& line) {
        std::string& last = before[file];
        if (file.ends_with(".cpp") && last.ends_with("::HWY_NAMESPACE {") && last.rfind("namespace ", 0) == 0) {
            if (line.empty() || line.rfind("namespace hn", 0) == 0) return;
            ++found;
            if (line != "namespace {") wrong += file + "\n";
        }
        last = line;
    });
    CHECK(wrong == "");
    CHECK(found >= 12);
}

TEST_CASE("docs/api.md lists each public header once, and no page names a missing source file") {
    const fs::path root = BILAYER_SOURCES;
    const std::string api = contents("docs/api.md");
    for (const auto& [library, ignored] : floors)
        for (const auto& entry : fs::directory_iterator(root / library)) {
            if (entry.path().extension() != ".h") continue;
            const std::string name = "`" + library + "/" + entry.path().filename().string() + "`";
            CAPTURE(name);
            const std::size_t first = api.find("| " + name + " |");
            CHECK(first != std::string::npos);
            CHECK(api.find("| " + name + " |", first + 1) == std::string::npos);
        }
    static const std::regex source(
        R"re((?:^|[`( ])((?:sdf|collider|cl|integration|tests|tools|demos|bench)/[a-zA-Z0-9_/]+\.(?:h|cpp|cl)))re");
    for (const auto& entry : fs::recursive_directory_iterator(root / "docs")) {
        if (entry.path().extension() != ".md") continue;
        const std::string page = contents(fs::relative(entry.path(), root).generic_string());
        for (std::sregex_iterator named(page.begin(), page.end(), source), end; named != end; ++named) {
            CAPTURE(entry.path().filename().string(), (*named)[1].str());
            CHECK(fs::exists(root / (*named)[1].str()));
        }
    }
}

TEST_CASE("a test that is a command has its programs built before it runs") {
    // bilayer_command_test() makes the programs that a command names part of what ./run test builds; add_test() does
    // not
    std::string wrong;
    int found = 0;
    eachLine([&](const std::string& file, int, const std::string& line) {
        if (fs::path(file).filename() != "CMakeLists.txt") return;
        found += line.find("bilayer_command_test(") != std::string::npos;
        if (line.find("add_test(") != std::string::npos && file != "tests/CMakeLists.txt") wrong += file + "\n";
    });
    CHECK(wrong == "");
    CHECK(found >= 6);
}
}  // namespace bilayer::house_test
