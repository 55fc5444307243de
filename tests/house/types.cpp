// SPDX-License-Identifier: Apache-2.0
// No two types of a library have one name, anonymous namespaces included: a name means one thing to readers. No two
// types of one namespace in headers of all libraries have one name: two such classes are one class to the linker.
#include <catch2/catch.hpp>
#include <map>
#include <regex>
#include <string>
#include <vector>

#include "tests/house/sources.h"

namespace bilayer::types_test {
using namespace bilayer::test;

namespace {

// The namespace of the project that a text is in at a position, as it is written in the last line that opens one there.
std::string namespaceAt(const std::string& text, std::size_t position) {
    const std::string opening = "\nnamespace ";
    const std::size_t found = text.rfind(opening, position);
    if (found == std::string::npos) return "";
    const std::size_t begin = found + opening.size();
    return text.substr(begin, text.find(" {", begin) - begin);
}

struct Type {
    std::string name, space;  // its namespace
};

// The types that a file defines at namespace scope, where lines are not indented. A declaration without a body is none.
std::vector<Type> typesIn(const std::string& text) {
    static const std::regex pattern(R"re((?:^|\n)(?:template <[^\n]*> )?(?:struct|class|union|enum class|enum) )re"
                                    R"re((?:alignas\([^)\n]*\) )?([\w:]+(?:<[^{;\n]*>)?))re");
    std::vector<Type> types;
    for (std::sregex_iterator found(text.begin(), text.end(), pattern), last; found != last; ++found) {
        const std::size_t end = std::size_t(found->position() + found->length());
        const std::size_t next = text.find_first_of("{;", end);
        if (next != std::string::npos && text[next] == '{')
            types.push_back({(*found)[1].str(), namespaceAt(text, std::size_t(found->position()))});
    }
    return types;
}

// The libraries, and with them the folders of programs.
std::vector<std::string> librariesAnd(std::vector<std::string> folders) {
    for (const auto& [library, ignored] : floors) folders.push_back(library);
    return folders;
}

}  // namespace

TEST_CASE("no two types of a library have one name") {
    std::string wrong;
    std::size_t count = 0;
    for (const std::string& library : librariesAnd({"tools"})) {
        std::map<std::string, std::string> files;
        for (const std::string& file : codeIn(library))
            for (const Type& type : typesIn(contents(file))) {
                ++count;
                const std::string& first = files.emplace(type.name, file).first->second;
                if (first != file) wrong += type.name + " is a type of " + first + " and of " + file + "\n";
            }
    }
    CHECK(wrong == "");
    CHECK(count > 200);
}

TEST_CASE("no two types of one namespace have one name in the headers of all libraries") {
    std::map<std::string, std::string> files;
    std::string wrong;
    for (const std::string& library :
         librariesAnd({"tools", "integration/python", "integration/mpi", "demos", "bench"}))
        for (const std::string& file : codeIn(library)) {
            if (!file.ends_with(".h")) continue;
            for (const Type& type : typesIn(contents(file))) {
                const std::string name = type.space + "::" + type.name;
                const std::string& first = files.emplace(name, file).first->second;
                if (first != file) wrong += name + " is a type of " + first + " and of " + file + "\n";
            }
        }
    CHECK(wrong == "");
    CHECK(files.size() > 200);
}

TEST_CASE("what stands in a private folder of a library is in a detail namespace") {
    std::string wrong;
    std::size_t count = 0;
    for (const std::string& library : librariesAnd({}))
        for (const std::string& file : codeIn(library)) {
            if (!file.ends_with(".h") || file.find('/', library.size() + 1) == std::string::npos) continue;
            const std::string text = contents(file);
            static const std::regex opening(R"re(\nnamespace (bilayer[\w:]*) \{\n([^}]*))re");
            static const std::regex declarations(R"re((\s*(struct|class) \w+;)*\s*)re");
            for (std::sregex_iterator found(text.begin(), text.end(), opening), last; found != last; ++found) {
                ++count;
                const bool isDetail = (*found)[1].str().find("::detail") != std::string::npos;
                const bool isDeclared = std::regex_match((*found)[2].str(), declarations);
                if (!isDetail && !isDeclared) wrong += file + " opens " + (*found)[1].str() + "\n";
            }
        }
    CHECK(wrong == "");
    CHECK(count > 200);
}

TEST_CASE("types with a body are found, and declarations are none") {
    std::string found;
    for (const Type& type :
         typesIn("struct A {\n    struct Inner {};\n};\nclass E;\nstruct B::Data : A,\n    C {};\nenum class C : int "
                 "{ a };\n"
                 "template <class T>\nclass D final {};\nenum class F : int;\nstruct Hash<A> {};\nnamespace x::y "
                 "{\nstruct Z {\n"))
        found += type.space + ":" + type.name + " ";
    CHECK(found == ":A :B::Data :C :D :Hash<A> x::y:Z ");
}
}  // namespace bilayer::types_test
