// SPDX-License-Identifier: Apache-2.0
// A leak, for the test of the leak sanitizer's suppressions.
#include <cstddef>

namespace {

constexpr std::size_t count = 100;

// Only the last of many is kept: copies of its address on the stack or in registers do not hide the others.
[[gnu::noinline]] const int* leakInOurCode() {
    const int* last = nullptr;
    for (std::size_t i = 0; i < count; ++i) last = new int(int(i));
    return last;
}

}  // namespace

int main() {
    const int* const last = leakInOurCode();
    const bool isWrong = *last != int(count) - 1;
    delete last;
    return isWrong;
}
