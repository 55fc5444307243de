// The order of the house: who may include whom, and what must not stand in its files.
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;

// A folder may include itself and these, and nothing of the house beside.
const std::map<std::string, std::set<std::string>> allowed{
    {"sdf", {}},
    {"cl", {"sdf"}},
    {"collider", {"sdf"}},
    {"integration/bullet", {"collider", "sdf"}},
    {"integration/fluid", {"collider", "sdf"}},
    {"tools", {"integration/bullet", "integration/fluid", "collider", "cl", "sdf"}},
    {"demos", {"integration/bullet", "integration/fluid", "collider", "cl", "sdf"}},
    {"bench", {"demos", "integration/bullet", "integration/fluid", "collider", "cl", "sdf"}},
};

const std::vector<std::string> folders{"sdf", "cl", "collider", "integration", "tools", "demos", "bench", "tests"};

// The room of the house that a path lies in, or nothing.
std::string room(const std::string& path) {
    for (const auto& [name, ignored] : allowed)
        if (path.rfind(name + "/", 0) == 0) return name;
    return {};
}

bool isSource(const fs::path& path) {
    static const std::set<std::string> endings{".h", ".cpp", ".cl", ".py", ".sh", ".js", ".html", ".cmake", ".txt"};
    return endings.count(path.extension().string()) > 0;
}

template <class Visit>
void eachLine(Visit visit) {
    const fs::path root = BILAYER_SOURCES;
    for (const std::string& folder : folders) {
        if (!fs::exists(root / folder)) continue;
        for (const auto& entry : fs::recursive_directory_iterator(root / folder)) {
            if (!entry.is_regular_file() || !isSource(entry.path())) continue;
            std::ifstream stream(entry.path());
            const std::string name = fs::relative(entry.path(), root).generic_string();
            std::string line;
            for (int number = 1; std::getline(stream, line); ++number) visit(name, number, line);
        }
    }
}

// What is wrong with an include line, or nothing.
std::string complaint(const std::string& file, const std::string& line) {
    static const std::regex pattern(R"re(^\s*#\s*include\s*["<](?:bilayer/)?([^">]+)[">])re");
    std::smatch match;
    if (!std::regex_search(line, match, pattern)) return {};
    const std::string from = room(file), to = room(match[1].str());
    if (match[1].str().find("../") != std::string::npos) return "includes by a relative path";
    if (from.empty()) return {};
    // the truth that tests go by is also what the benchmark of accuracy measures against
    if (from == "bench" && match[1].str().rfind("tests/support/", 0) == 0) return {};
    if (match[1].str().rfind("tests/", 0) == 0) return "includes tests";
    if (to.empty() || to == from || allowed.at(from).count(to)) return {};
    return "includes " + to + " from " + from;
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
    CHECK(complaint("sdf/a.h", "#include \"cl/device.h\"") != "");
    CHECK(complaint("sdf/a.h", "#include <bilayer/collider/field.h>") != "");
    CHECK(complaint("collider/a.cpp", "  # include \"integration/fluid/seed.h\"") != "");
    CHECK(complaint("integration/fluid/a.cpp", "#include \"integration/bullet/shape.h\"") != "");
    CHECK(complaint("cl/a.cpp", "#include \"collider/field.h\"") != "");
    CHECK(complaint("cl/a.cpp", "#include \"sdf/build.h\"") == "");
    CHECK(complaint("tools/a.cpp", "#include \"integration/fluid/seed.h\"") == "");
    CHECK(complaint("sdf/a.cpp", "#include \"demos/shared/shapes.h\"") != "");
    CHECK(complaint("sdf/a.cpp", "#include <vector>") == "");
    CHECK(complaint("sdf/a.cpp", "#include \"tests/support/support.h\"") != "");
}

TEST_CASE("nothing is left to do, and no path of somebody's machine stands in the code") {
    // put together here, so that this file does not find itself
    const std::regex leftover(std::string("\\b(TO") + "DO|FIX" + "ME|X" + "XX)\\b");
    const std::regex machine(std::string("/(ho") + "me|wo" + "rk|Us" + "ers|ro" + "ot)/(?!someone)[a-zA-Z]");
    std::string wrong;
    eachLine([&](const std::string& file, int number, const std::string& line) {
        if (std::regex_search(line, leftover) || std::regex_search(line, machine))
            wrong += file + ":" + std::to_string(number) + " " + line + "\n";
    });
    CHECK(wrong == "");
}
