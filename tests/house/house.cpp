// SPDX-License-Identifier: Apache-2.0
// Checks what may stand in files: forbidden text, their lengths, what pages name.
#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "tests/house/sources.h"

namespace bilayer::house_test {
using namespace bilayer::test;

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
    const std::vector<std::string> words{"besides?",        "aslant",
                                         "askew",           "creeps?",
                                         "creeping",        "trembl\\w*",
                                         "sinks? into",     "way out",
                                         "strays?",         "swirl",
                                         "wanders?",        "by and by",
                                         "as ever",         "last resort",
                                         "turned around",   "nobody knows",
                                         "pierc(e|es|ing)", "meets itself",
                                         "runs? both ways", "carries on",
                                         "no longer",       "falls back on all sides",
                                         "listener wants",  "nudges?",
                                         "foresees?",       "mends?",
                                         "tells us",        "walks aside",
                                         "in the ground"};
    // of identifiers: where min and max are meant, and names that were replaced
    const std::regex names(
        "\\b((most|least)[A-Z]\\w*|NoPassing|Stillness|NearPoints|LastResort|AngularMomentum|Wings)\\b");
    std::string all;
    for (const std::string& word : words) all += (all.empty() ? "" : "|") + word;
    const std::regex replaced("\\b(" + all + ")\\b", std::regex::icase);
    std::string wrong;
    const auto check = [&](const std::string& file, int number, const std::string& line) {
        if (file == "tests/house/house.cpp") return;
        if (std::regex_search(line, replaced) || std::regex_search(line, names))
            wrong += file + ":" + std::to_string(number) + " " + line + "\n";
    };
    eachLine(check);
    const fs::path root = BILAYER_SOURCES;
    // not the changelog, which states what replaces the old names
    std::vector<std::string> pages{"README.md", "CONTRIBUTING.md", "SECURITY.md"};
    for (const auto& entry : fs::recursive_directory_iterator(root / "docs"))
        if (entry.path().extension() == ".md") pages.push_back(fs::relative(entry.path(), root).generic_string());
    for (const std::string& page : pages) {
        std::istringstream text(contents(page));
        std::string line;
        for (int number = 1; std::getline(text, line); ++number) check(page, number, line);
    }
    CHECK(wrong == "");
    CHECK(pages.size() > 30);
}

TEST_CASE("no source file is long") {
    constexpr int maxLines = 400;
    const std::set<std::string> code{".h", ".cpp", ".cl", ".py", ".pyi", ".sh", ".js", ".cmake"};
    std::map<std::string, int> lines;
    eachLine([&](const std::string& file, int number, const std::string&) {
        if (code.count(fs::path(file).extension().string()) > 0) lines[file] = number;
    });
    const std::string run = contents("run");
    lines["run"] = int(std::count(run.begin(), run.end(), '\n'));
    std::string wrong;
    for (const auto& [file, count] : lines)
        if (count > maxLines) wrong += file + " has " + std::to_string(count) + " lines\n";
    CHECK(wrong == "");
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
