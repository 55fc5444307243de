// SPDX-License-Identifier: Apache-2.0
// The kernel files alone must be valid OpenCL C 1.2 for a compiler other than the device's.
#include <catch2/catch.hpp>
#include <cstdlib>
#include <string>

namespace bilayer::kernel_test {
namespace {

bool runs(const std::string& command) {
    return std::system(("(" + command + ") >/dev/null 2>&1").c_str()) == 0;
}

}  // namespace

TEST_CASE("every kernel compiles offline in every mapping without a warning") {
    if (!runs("clang-14 --version")) {
        WARN("skipped: clang-14 is not installed");
        return;
    }
    const std::string compile =
        "clang-14 -x cl -cl-std=CL1.2 -Xclang -finclude-default-header -Wall -Wextra -Werror -fsyntax-only ";
    const std::string file =
        GENERATE("exact.cl", "double_layer.cl", "prism.cl", "field.cl", "point_sampler.cl", "field_build.cl");
    const std::string options =
        GENERATE(as<std::string>(), "", "-D GROUP_PER_BLOCK") + GENERATE(as<std::string>(), "", " -D TRIANGLES=1") +
        GENERATE(as<std::string>(), "", " -D PAPER_CUBE=1") + GENERATE(as<std::string>(), "", " -D ON_PROCESSOR=1");
    CAPTURE(options, file);
    const std::string command = compile + options, path = " '" BILAYER_KERNELS + file + "'";
    CHECK(std::system((command + path).c_str()) == 0);
    CHECK_FALSE(runs(command + " -D kernel=nonsense" + path));
}
}  // namespace bilayer::kernel_test
