// SPDX-License-Identifier: Apache-2.0
#include "bench/ratios.h"

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "tests/support/support.h"

namespace bilayer::ratios_test {
using bench::Ratios;

TEST_CASE("ratios are those of the rounds that both builders have") {
    const std::filesystem::path file = test::scratch("ratios.json");
    Ratios ratios("some");
    CLI::App app;
    ratios.addOption(app);
    app.parse("--ratios " + file.string());
    ratios.add("a / b", {6, 8, 10}, {3, 2});
    ratios.write();
    std::ifstream in(file);
    const auto content = nlohmann::json::parse(in);
    CHECK(content["benchmark"] == "some");
    CHECK(content["ratios"] == nlohmann::json{{"a / b", {2.0, 4.0}}});
    CHECK(content["cores"] >= 1);
    CHECK(!content["processor"].get<std::string>().empty());
}

TEST_CASE("ratios are written only where they are asked for, and a file that cannot be written is named") {
    CHECK_NOTHROW(Ratios("some").write());
    Ratios ratios("some");
    CLI::App app;
    ratios.addOption(app);
    app.parse("--ratios /dev/full");
    CHECK_THROWS_WITH(ratios.write(), "cannot write /dev/full");
}
}  // namespace bilayer::ratios_test
