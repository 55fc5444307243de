// SPDX-License-Identifier: Apache-2.0
// `bilayer` without a command, and `bilayer devices`.
#include <nanovdb/util/IO.h>

#include <catch2/catch.hpp>

#include "tests/tools/program.h"

namespace bilayer::main_test {
using namespace bilayer::test;

TEST_CASE("help and version") {
    CHECK(run({"--help"}).status == 0);
    const std::string versions = run({"--version"}).out;
    CHECK(versions.rfind("bilayer " BILAYER_VERSION "\n", 0) == 0);
    // tests/docs/third_party.py compares the names with docs/third-party.md
    for (const char* part : {"compiler", "OpenVDB", "NanoVDB", "tinygltf", "Boost"})
        CHECK(versions.find(std::string("\n") + part + "  ") != std::string::npos);
    for (const char* command : {"build", "batch", "inspect", "info", "query", "surface", "export", "seed", "devices"}) {
        const Result r = run({command, "--help"});
        CHECK(r.status == 0);
        CHECK_FALSE(r.out.empty());
    }
}

TEST_CASE("devices reports no device") {
    CHECK(run({"devices", "--json"}).json()["devices"].is_array());
    CHECK(run({"devices"}).status == 0);
    const Result none = run({"devices"}, {.variables = {"OCL_ICD_VENDORS=/nonexistent"}});
    CHECK(none.status == 0);
    CHECK(none.out == "no OpenCL device\n");
}
}  // namespace bilayer::main_test
