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
    const std::string options = GENERATE("", "-D ROW_PER_ITEM", "-D TRIANGLES=1", "-D ROW_PER_ITEM -D TRIANGLES=1");
    const std::string file = GENERATE("double_layer.cl", "prism.cl");
    CAPTURE(options, file);
    const std::string path = " '" BILAYER_KERNELS + file + "'";
    CHECK(std::system((compile + options + path).c_str()) == 0);
    CHECK_FALSE(runs(compile + options + " -D kernel=nonsense" + path));
}
