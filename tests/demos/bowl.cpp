// The demo itself, small: three bodies for a second.
#include <fmt/core.h>

#include <catch2/catch.hpp>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "sdf/vdb_io.h"
#include "tests/support/support.h"

using namespace bilayer;

TEST_CASE("the bowl demo writes its field and its recording, and prints its table") {
    const auto out = test::scratch("bowl"), log = test::scratch("bowl.txt");
    const std::string command = std::string(BILAYER_BOWL) + " --bodies 3 --seconds 1 --resolution 32 --out '" +
                                out.string() + "' > '" + log.string() + "'";
    REQUIRE(std::system(command.c_str()) == 0);
    std::ifstream file(log);
    const std::string table{std::istreambuf_iterator<char>(file), {}};
    for (const char* row : {"build the fields", "simulated", "a step", "contacts a step", "deepest penetration"})
        CHECK(table.find(row) != std::string::npos);
    CHECK(std::filesystem::file_size(out / "bowl.html") > 500'000);
    const bool bunny = std::filesystem::exists(out / "bunny.vdb");
    CHECK(readVdb(out / (bunny ? "bunny.vdb" : "knot.vdb")).activeVoxels() > 1000);
    for (const char* wrong : {"--bodies 0", "--seconds nan"})
        CHECK(std::system(fmt::format("{} {} 2>/dev/null", BILAYER_BOWL, wrong).c_str()) != 0);
}
