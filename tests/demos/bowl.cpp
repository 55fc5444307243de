// SPDX-License-Identifier: Apache-2.0
// The demo itself, small: three bodies for one second.
#include <fmt/core.h>

#include <catch2/catch.hpp>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include <bilayer/sdf/vdb_io.h>
#include "tests/support/support.h"

namespace bilayer::bowl_test {
TEST_CASE(
    "the bowl demo writes its field and its recording, prints its table, and reports whether its criteria are met") {
    const auto out = test::scratch("bowl"), log = test::scratch("bowl.txt");
    const auto play = [&](double seconds) {
        return WEXITSTATUS(std::system(fmt::format("{} --bodies 3 --seconds {} --resolution 32 --out '{}' > '{}'",
                                                   BILAYER_BOWL, seconds, out.string(), log.string())
                                           .c_str()));
    };
    CHECK(play(0.5) == 3);  // they are still falling
    REQUIRE(play(30) == 0);
    const std::string table = test::contentsOf(log);
    for (const char* row : {"build the fields", "simulated", "a step", "contacts a step", "deepest penetration"})
        CHECK(table.find(row) != std::string::npos);
    CHECK(std::filesystem::file_size(out / "bowl.html") > 500'000);
    const bool bunny = std::filesystem::exists(out / "bunny.vdb");
    CHECK(readVdb(out / (bunny ? "bunny.vdb" : "knot.vdb")).activeVoxels() > 1000);
    for (const char* wrong : {"--bodies 0", "--seconds nan"})
        CHECK(WEXITSTATUS(std::system(fmt::format("{} {} 2>/dev/null", BILAYER_BOWL, wrong).c_str())) == 2);
}
}  // namespace bilayer::bowl_test
