// SPDX-License-Identifier: Apache-2.0
// Each unit of a library, X.h and X.cpp, has tests: tests/LIBRARY/X.cpp, or the file that the comment at the top of the
// unit names by a line "Tested by tests/...cpp."
#include <catch2/catch.hpp>
#include <map>
#include <regex>
#include <set>
#include <string>

#include "sources.h"

using namespace bilayer::test;

namespace {

// The test files that the comment at the top of a file names.
std::set<std::string> namedTests(const std::string& text) {
    std::set<std::string> tests;
    static const std::regex line(R"re(^// Tested by tests/.*\.cpp\.$)re"), path(R"re(tests/[a-zA-Z0-9_/]+\.cpp)re");
    for (std::size_t begin = 0; text.compare(begin, 2, "//") == 0;) {
        const std::size_t end = text.find('\n', begin);
        const std::string comment = text.substr(begin, end - begin);
        if (std::regex_match(comment, line))
            for (std::sregex_iterator named(comment.begin(), comment.end(), path), last; named != last; ++named)
                tests.insert(named->str());
        if (end == std::string::npos) break;
        begin = end + 1;
    }
    return tests;
}

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
    for (const auto& [library, ignored] : floors) {
        std::map<std::string, std::set<std::string>> units;  // with the tests that they name
        for (const std::string& file : codeIn(library))
            units[file.substr(0, file.rfind('.'))].merge(namedTests(contents(file)));
        count += units.size();
        for (const auto& [unit, named] : units) {
            if (named.empty() && !fs::exists(root / ownTest(library, unit)))
                wrong +=
                    unit + ": there is no " + ownTest(library, unit) + ", and its header has no line \"Tested by\"\n";
            for (const std::string& test : named)
                if (!fs::exists(root / test)) wrong += unit + " names " + test + ", which does not exist\n";
        }
    }
    CHECK(wrong == "");
    CHECK(count > 100);
}

TEST_CASE("a line that names tests is found in the comment at the top, and only there") {
    const std::set<std::string> both{"tests/sdf/exact.cpp", "tests/sdf/flood.cpp"};
    CHECK(namedTests("// A unit.\n// Tested by tests/sdf/exact.cpp and tests/sdf/flood.cpp.\n#pragma once\n") == both);
    CHECK(namedTests("// A unit.\n#pragma once\n// Tested by tests/sdf/exact.cpp.\n").empty());
    CHECK(ownTest("integration/bullet", "integration/bullet/detail/convex") == "tests/bullet/convex.cpp");
}
