// SPDX-License-Identifier: Apache-2.0
// `bilayer` with arbitrary arguments: options of the help, in any order, with any values. BILAYER_FUZZ multiplies them.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <regex>
#include <string>
#include <vector>

#include "tests/support/random.h"
#include "tests/support/support.h"
#include "tests/tools/library.h"
#include "tests/tools/program.h"

namespace bilayer::arguments_test {
using namespace bilayer::test;

namespace {

constexpr const char* commands[] = {"build", "batch",   "merge",  "inspect", "info",
                                    "query", "surface", "export", "seed",    "devices"};
// No value asks for much work.
const Words values{"0",     "1",          "-1",
                   "16",    "0.5",        "0,5",
                   "nan",   "inf",        "1e30",
                   "1e-30", "2147483648", "1e400",
                   "1/2",   "2x2x1",      "x",
                   "",      "-",          "--",
                   "=",     "\n",         "%s",
                   "\xff",  "exact",      "flood",
                   "auto",  "world",      "a.vdb",
                   "b.ply", "c",          "double-layer",
                   "prism", "opencl",     "18446744073709551616"};

class RandomWords {
  public:
    RandomWords(unsigned seed, const Words& files) : random_(seed), files_(files) {
        for (const char* command : commands) options_.push_back(optionsOf(command));
    }

    Words next() {
        const std::size_t command = below(std::size(commands));
        Words words;
        if (below(20) > 0) words.push_back(commands[command]);
        if (below(4) > 0) words.push_back(one(files_));
        if (below(2) > 0) words.insert(words.end(), {"-o", one({"out.vdb", "out.ply", "out.nvdb", "out", "."})});
        if (below(2) > 0) words.insert(words.end(), {"--voxel-size", "0.1"});
        for (std::size_t count = below(6); count > 0; --count) {
            const Words& known = options_[below(4) > 0 ? command : below(options_.size())];
            if (below(4) > 0) words.push_back(one(known));
            if (below(4) > 0) words.push_back(one(below(6) > 0 ? values : files_));
        }
        return words;
    }

  private:
    static Words optionsOf(const std::string& command) {
        const std::string help = run({command, "--help"}).out;
        static const std::regex option("--[a-z][a-z-]*");
        const Words found{std::sregex_token_iterator(help.begin(), help.end(), option), {}};
        REQUIRE_FALSE(found.empty());
        return found;
    }
    std::size_t below(std::size_t count) { return std::min(std::size_t(random_(0, double(count))), count - 1); }
    const std::string& one(const Words& words) { return words[below(words.size())]; }

    Random random_;
    Words files_;
    std::vector<Words> options_;
};

}  // namespace

TEST_CASE("whatever the arguments are, the program does what they say or names what is wrong") {
    const unsigned seed = bilayer::test::seed();
    CAPTURE(seed);
    const std::string mesh = sphereFile().string(), field = fieldFile();
    const Words files{mesh, field, "no such file", ".", "/dev/null", "/dev/full", "/"};
    RandomWords random(seed, files);
    const char* const factor = std::getenv("BILAYER_FUZZ");
    const unsigned long count = 60 * (factor ? std::strtoul(factor, nullptr, 10) : 1);
    std::array<unsigned long, 3> ofStatus{};
    // all three statuses occur in the long run
    const auto occurred = [&] { return std::count(ofStatus.begin(), ofStatus.end(), 0ul) == 0; };
    for (unsigned long i = 0; i < count || (!occurred() && i < 50 * count); ++i) {
        const Words words = random.next();
        const Result r =
            run(words, {.input = "0 0 0\n", .folder = emptyFolder("arguments").string(), .maxSeconds = 60});
        CAPTURE(words, r.status, r.err);
        REQUIRE((r.status >= 0 && r.status <= 2));
        ++ofStatus[r.status];
        if (r.status == 1) CHECK(r.errorLines() == 1);
        if (r.status == 2) CHECK_FALSE(r.err.empty());
        CHECK(r.err.size() < 2000);
    }
    CHECK(occurred());
    // inputs stay what they are
    CHECK(run({"inspect", mesh}).status == 0);
    CHECK(run({"info", field}).status == 0);
}
}  // namespace bilayer::arguments_test
