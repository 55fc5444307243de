// SPDX-License-Identifier: Apache-2.0
// Runs the checks of the fuzzers without sanitizers: on their first inputs, on the inputs in tests/fuzz/corpus, and on
// random changes of both. BILAYER_FUZZ multiplies the changes.
#include <catch2/catch.hpp>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "tests/fuzz/checks.h"
#include "tests/support/damage.h"
#include "tests/support/support.h"

namespace bilayer::replay_test {
using namespace bilayer::test;

namespace {

std::vector<std::string> inputsOf(const FuzzCheck& check) {
    std::vector<std::string> inputs = check.seeds();
    const std::filesystem::path folder = std::filesystem::path(BILAYER_CORPUS) / check.name;
    if (std::filesystem::exists(folder))
        for (const auto& entry : std::filesystem::directory_iterator(folder))
            inputs.push_back(contentsOf(entry.path()));
    return inputs;
}

/// Where the input of a failure stays, for the fuzzer to read it.
std::filesystem::path inputOf(const FuzzCheck& check) {
    return std::filesystem::temp_directory_path() / (std::string("bilayer-") + check.name + ".input");
}

/// Returns whether the answers for an input are right. The input is kept until then: a crash may end the process.
bool isRight(const FuzzCheck& check, const std::string& input) {
    std::ofstream(inputOf(check), std::ios::binary) << input;
    std::string wrong;
    try {
        check.run({reinterpret_cast<const std::uint8_t*>(input.data()), input.size()});
    } catch (const WrongAnswer& answer) {
        wrong = answer.what();
    } catch (const std::exception& error) {
        wrong = std::string("an error that is not documented: ") + error.what();
    }
    if (wrong.empty()) return true;
    FAIL_CHECK(wrong << "\nthe input is in " << inputOf(check).string());
    return false;
}

void replay(const std::string& name, std::size_t changes) {
    const unsigned seed = bilayer::test::seed();
    CAPTURE(name, seed);
    if (const char* const factor = std::getenv("BILAYER_FUZZ")) changes *= std::strtoul(factor, nullptr, 10);
    for (const FuzzCheck& check : fuzzChecks()) {
        if (check.name != name) continue;
        const std::vector<std::string> inputs = inputsOf(check);
        REQUIRE_FALSE(inputs.empty());
        for (const std::string& input : inputs)
            if (!isRight(check, input)) return;
        Damage damage(seed, check.words);
        for (std::size_t i = 0; i < changes; ++i) {
            std::string input = damage.of(inputs[damage.below(inputs.size())]);
            if (input.size() > check.maxSize) input.resize(check.maxSize);
            if (!isRight(check, input)) return;
        }
        std::filesystem::remove(inputOf(check));
        return;
    }
    FAIL("no check of this name");
}

}  // namespace

TEST_CASE("damaged mesh files are read or refused in plain words, and what is read can be written") {
    replay(GENERATE("obj", "ply", "stl", "off", "raw"), 500);
}

TEST_CASE("damaged glTF scenes are read or refused") {
    replay("gltf", 1000);
}

TEST_CASE("damaged files of scenes are read or refused in plain words") {
    replay("scenes", 800);
}

TEST_CASE("scenes are converted as a count over their nodes says, and edited answers of importers are refused") {
    replay("scene_parts", 1000);
}

TEST_CASE("reports on structured meshes have the counts of all edges, in any order of triangles") {
    replay("inspect", 1000);
}

TEST_CASE("fields of structured meshes, clean or not, are those of brute force") {
    replay("build", 100);
}

TEST_CASE("damaged .vdb files are refused or can be queried") {
    replay("vdb", 500);
}

TEST_CASE("fields with edited entries and voxels are refused or can be queried") {
    replay("vdb_entries", 200);
}

TEST_CASE("edited fields in tiles are refused or can be queried") {
    replay("tiles", 300);
}

TEST_CASE("queries with any numbers have valid answers") {
    replay("queries", 1000);
}

TEST_CASE("contacts and distances of bodies in any pose are valid") {
    replay("contacts", 1000);
}

TEST_CASE("rebuilt fields after any edits are those built in full") {
    replay("rebuild", 40);
}
}  // namespace bilayer::replay_test
