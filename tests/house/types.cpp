// SPDX-License-Identifier: Apache-2.0
// No two types of a library have one name, anonymous namespaces included: a name means one thing to readers, and two
// classes of one name in one namespace are one class to the linker.
#include <catch2/catch.hpp>
#include <map>
#include <regex>
#include <string>
#include <vector>

#include "sources.h"

using namespace bilayer::test;

namespace {

// The types that a file defines at namespace scope, where lines are not indented. A declaration without a body is none.
std::vector<std::string> typesIn(const std::string& text) {
    static const std::regex pattern(R"re((?:^|\n)(?:template <[^\n]*> )?(?:struct|class|union|enum class|enum) )re"
                                    R"re((?:alignas\([^)\n]*\) )?([\w:]+(?:<[^{;\n]*>)?))re");
    std::vector<std::string> types;
    for (std::sregex_iterator found(text.begin(), text.end(), pattern), last; found != last; ++found) {
        const std::size_t end = std::size_t(found->position() + found->length());
        const std::size_t next = text.find_first_of("{;", end);
        if (next != std::string::npos && text[next] == '{') types.push_back((*found)[1].str());
    }
    return types;
}

}  // namespace

TEST_CASE("no two types of a library have one name") {
    std::vector<std::string> libraries{"tools"};
    for (const auto& [library, ignored] : floors) libraries.push_back(library);
    std::string wrong;
    std::size_t count = 0;
    for (const std::string& library : libraries) {
        std::map<std::string, std::string> files;
        for (const std::string& file : codeIn(library))
            for (const std::string& type : typesIn(contents(file))) {
                ++count;
                const std::string& first = files.emplace(type, file).first->second;
                if (first != file) wrong += type + " is a type of " + first + " and of " + file + "\n";
            }
    }
    CHECK(wrong == "");
    CHECK(count > 200);
}

TEST_CASE("types with a body are found, and declarations are none") {
    const std::vector<std::string> expected{"A", "B::Data", "C", "D", "Hash<A>"};
    CHECK(typesIn("struct A {\n    struct Inner {};\n};\nclass E;\nstruct B::Data : A,\n    C {};\nenum class C : int "
                  "{ a };\n"
                  "template <class T>\nclass D final {};\nenum class F : int;\nstruct Hash<A> {};\n") == expected);
}
