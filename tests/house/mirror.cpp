// SPDX-License-Identifier: Apache-2.0
// Each unit of a library or of the command line, X.h and X.cpp, has tests: tests/LIBRARY/X.cpp, or the files that the
// comment at the top of the unit names by a line "Tested by tests/....cpp." Such a file includes the header or uses a
// name that it declares. A unit that only other units use says through which name the test reaches it: "Tested by
// tests/....cpp through build()." The file that defines this name then includes the unit, directly or through others.
// "through the program" stands for the command line, which such a test runs.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cctype>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "tests/house/include_graph.h"
#include "tests/house/sources.h"

namespace bilayer::mirror_test {
using namespace bilayer::test;

namespace {

// The line of a unit that names its tests.
struct TestLine {
    std::set<std::string> files;
    std::string through;  // the name that the tests use; empty: one of the unit itself
};

// The line in the comment at the top of a file.
TestLine namedTests(const std::string& text) {
    TestLine tests;
    static const std::regex line(R"re(^// Tested by (tests/.*\.cpp)(?: through ([\w:]+|the program)(?:\(\))?)?\.$)re");
    static const std::regex path(R"re(tests/[a-zA-Z0-9_/]+\.cpp)re");
    for (std::size_t begin = 0; text.compare(begin, 2, "//") == 0;) {
        const std::size_t end = text.find('\n', begin);
        const std::string comment = text.substr(begin, end - begin);
        std::smatch match;
        if (std::regex_match(comment, match, line)) {
            tests.through = match[2].str();
            const std::string files = match[1].str();
            for (std::sregex_iterator named(files.begin(), files.end(), path), last; named != last; ++named)
                tests.files.insert(named->str());
        }
        if (end == std::string::npos) break;
        begin = end + 1;
    }
    return tests;
}

// The types, functions and constants that a header declares at namespace scope, where lines are not indented.
std::set<std::string> declaredNames(const std::string& text) {
    static const std::regex pattern(
        R"re((?:^|\n)(?:template <[^\n]*> )?(?:)re"
        R"re((?:struct|class|enum class|enum|union) (?:alignas\([^)\n]*\) )?(\w+)|using (\w+) =|)re"
        R"re(inline constexpr [\w:<>* ]+ (\w+)|[a-zA-Z](?:[\w:<>,&*\[\] ]*[ &*>])(\w+)\())re");
    std::set<std::string> names;
    for (std::sregex_iterator found(text.begin(), text.end(), pattern), last; found != last; ++found)
        for (std::size_t group = 1; group < found->size(); ++group)
            if ((*found)[group].matched) names.insert((*found)[group].str());
    return names;
}

// The words of a text: runs of letters, digits and underscores.
std::set<std::string> wordsOf(const std::string& text) {
    static const std::regex word(R"re(\w+)re");
    return {std::sregex_token_iterator(text.begin(), text.end(), word), {}};
}

// The last name of "Field::sample".
std::string lastName(const std::string& name) {
    return name.substr(name.rfind(':') + 1);
}

// Whether a file defines a type or a function at namespace scope, where lines are not indented.
bool defines(const std::string& text, const std::string& name) {
    const std::string last = lastName(name);
    for (std::size_t at = text.find(last); at != std::string::npos; at = text.find(last, at + 1)) {
        const std::size_t begin = at == 0 ? 0 : text.rfind('\n', at - 1) + 1;
        const std::string before = text.substr(begin, at - begin), after = text.substr(at + last.size(), 1);
        if (before.empty() || !std::isalpha(static_cast<unsigned char>(before.front()))) continue;
        if (std::string(" &*:").find(before.back()) == std::string::npos) continue;
        if (after == "(" && before.find_first_of("(;") == std::string::npos) return true;
        const std::size_t end = text.find_first_of("{;", at);
        const bool type = before.rfind("class ", 0) == 0 || before.rfind("struct ", 0) == 0;
        if (type && (after == " " || after == ":") && end != std::string::npos && text[end] == '{') return true;
    }
    return false;
}

// A test file with the helpers of its folder that it includes, as one text.
std::string withHelpers(const IncludeGraph& tests, const std::string& file) {
    std::string text;
    for (const std::string& included : includedBy(tests, file))
        if (fs::path(included).parent_path() == fs::path(file).parent_path()) text += contents(included);
    return text;
}

// Whether a test reaches a unit as the unit's line states.
bool reaches(const std::string& test, const std::string& unit, const std::string& header, const std::string& through) {
    if (test.find("\"" + unit + ".h\"") != std::string::npos) return true;
    if (test.find("<bilayer/" + unit + ".h>") != std::string::npos) return true;
    if (through == "the program") return test.find("\"tests/tools/program.h\"") != std::string::npos;
    const std::set<std::string> used = wordsOf(test);
    if (!through.empty()) return used.count(lastName(through)) > 0;
    const std::set<std::string> names = declaredNames(header);
    return std::any_of(names.begin(), names.end(), [&](const std::string& name) { return used.count(name) > 0; });
}

// Which units the code that defines a name may call, found once for each name.
class Callers {
  public:
    Callers() {
        for (const auto& [file, ignored] : graph_) texts_[file] = contents(file);
    }

    bool reach(const std::string& name, const std::string& unit) {
        const auto [found, first] = reached_.emplace(name, std::set<std::string>{});
        if (first)
            for (const auto& [file, text] : texts_)
                if (name == "the program" ? file.rfind("tools/main", 0) == 0 : defines(text, name))
                    found->second.merge(includedBy(graph_, file));
        return found->second.count(unit + ".h") > 0 || found->second.count(unit + ".cpp") > 0;
    }

  private:
    IncludeGraph graph_ = callGraph(includeGraph({"sdf", "collider", "cl", "integration", "tools", "tests/support"}));
    std::map<std::string, std::string> texts_;
    std::map<std::string, std::set<std::string>> reached_;
};

// The test file of a unit's own name: "sdf/fill/exact" has "tests/sdf/exact.cpp".
std::string ownTest(const std::string& library, const std::string& unit) {
    const auto last = [](const std::string& path) { return path.substr(path.rfind('/') + 1); };
    return "tests/" + last(library) + "/" + last(unit) + ".cpp";
}

}  // namespace

TEST_CASE("each unit has a test file of its name, or names the one that covers it") {
    const fs::path root = BILAYER_SOURCES;
    std::string wrong;
    std::size_t count = 0;
    Callers callers;
    const IncludeGraph tests = callGraph(includeGraph({"tests"}));
    std::vector<std::string> folders{"tools"};
    for (const auto& [library, ignored] : floors) folders.push_back(library);
    for (const std::string& library : folders) {
        std::map<std::string, TestLine> units;
        for (const std::string& file : codeIn(library)) {
            const TestLine line = namedTests(contents(file));
            TestLine& all = units[file.substr(0, file.rfind('.'))];
            all.files.insert(line.files.begin(), line.files.end());
            if (!line.through.empty()) all.through = line.through;
        }
        count += units.size();
        for (const auto& [unit, line] : units) {
            const std::string own = ownTest(library, unit);
            if (line.files.empty() && !fs::exists(root / own))
                wrong += unit + ": there is no " + own + ", and its header has no line \"Tested by\"\n";
            for (const std::string& test : line.files.empty() ? std::set{own} : line.files)
                if (!fs::exists(root / test))
                    wrong += unit + " names " + test + ", which does not exist\n";
                else if (contents(test).find("TEST_CASE(") == std::string::npos)
                    wrong += test + ", of " + unit + ", has no test\n";
                else if (!reaches(withHelpers(tests, test), unit, contents(unit + ".h"), line.through))
                    wrong += unit + " has " + test + ", which neither includes it nor uses a name of it\n";
                else if (!line.through.empty() && !callers.reach(line.through, unit))
                    wrong += unit + " is not included by what defines " + line.through + "\n";
        }
    }
    CHECK(wrong == "");
    CHECK(count > 100);
}

TEST_CASE("a line that names tests is found in the comment at the top, and only there") {
    const std::set<std::string> both{"tests/sdf/exact.cpp", "tests/sdf/flood.cpp"};
    CHECK(namedTests("// A unit.\n// Tested by tests/sdf/exact.cpp and tests/sdf/flood.cpp.\n#pragma once\n").files ==
          both);
    CHECK(namedTests("// A unit.\n#pragma once\n// Tested by tests/sdf/exact.cpp.\n").files.empty());
    CHECK(namedTests("// Tested by tests/sdf/exact.cpp through Field::sample().\n").through == "Field::sample");
    CHECK(ownTest("integration/bullet", "integration/bullet/detail/convex") == "tests/bullet/convex.cpp");
}

TEST_CASE("a test reaches a unit that it includes, names, or uses through the stated name") {
    const std::string header =
        "struct Tree {\n    int size() const;\n};\nvoid grow(Tree& tree);\n"
        "inline constexpr int maxDepth = 3;\n";
    CHECK(declaredNames(header) == std::set<std::string>{"Tree", "grow", "maxDepth"});
    CHECK(reaches("#include \"sdf/bvh/tree.h\"\n", "sdf/bvh/tree", header, ""));
    CHECK(reaches("grow(oak);\n", "sdf/bvh/tree", header, ""));
    CHECK_FALSE(reaches("growAll(oak.size());\n", "sdf/bvh/tree", header, ""));
    CHECK(reaches("build(mesh);\n", "sdf/bvh/tree", header, "build"));
    CHECK_FALSE(reaches("rebuild(mesh);\n", "sdf/bvh/tree", header, "build"));
    CHECK(defines("Tree Forest::grow(int years) {\n", "Forest::grow"));
    CHECK(defines("// A tree.\nclass Tree final : public Plant {\n", "Tree"));
    CHECK_FALSE(defines("class Tree;\nvoid f() {\n    grow(3);\n}\n", "grow"));
    CHECK_FALSE(defines("class Tree;\n", "Tree"));
    Callers callers;
    CHECK(callers.reach("inspect", "sdf/mesh/wall_thickness"));
    CHECK(callers.reach("readMesh", "sdf/io/formats/obj_reader"));
    CHECK_FALSE(callers.reach("inspect", "sdf/io/atomic_file"));
    CHECK_FALSE(callers.reach("readMesh", "sdf/fill/exact"));
}
}  // namespace bilayer::mirror_test
