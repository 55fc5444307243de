// The kernel files by themselves: valid OpenCL C 1.2 to a compiler that is not the device's.
#include <catch2/catch.hpp>
#include <cstdlib>
#include <string>

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
    const std::string options = GENERATE("", "-D TRIANGLES=1");
    const auto [file, mapping] = GENERATE(table<std::string, std::string>({{"double_layer.cl", ""},
                                                                           {"double_layer.cl", " -D ROW_PER_ITEM"},
                                                                           {"prism.cl", ""},
                                                                           {"prism.cl", " -D GROUP_PER_BLOCK"}}));
    CAPTURE(options, file, mapping);
    const std::string command = compile + options + mapping, path = " '" BILAYER_KERNELS + file + "'";
    CHECK(std::system((command + path).c_str()) == 0);
    CHECK_FALSE(runs(command + " -D kernel=nonsense" + path));
}
