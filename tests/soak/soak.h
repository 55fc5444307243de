// SPDX-License-Identifier: Apache-2.0
// Work that is repeated for as long as BILAYER_SOAK_SECONDS says, while memory must not grow.
#pragma once

#include <malloc.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <chrono>
#include <cstddef>
#include <cstdlib>
#include <vector>

namespace bilayer::test {

/// Repeats `round(number)` for the time of the soak, at least `least` times. Memory in use after the rounds of the last
/// third is compared with that of the second third.
template <class Round>
void soak(unsigned least, Round round) {
    constexpr double usualSeconds = 4, growth = 1.02;
    constexpr std::size_t slack = std::size_t(1) << 20;  // [bytes]: caches and pools that fill at random
    const char* const given = std::getenv("BILAYER_SOAK_SECONDS");
    const std::chrono::duration<double> time(given ? std::strtod(given, nullptr) : usualSeconds);
    const auto end = std::chrono::steady_clock::now() + time;
    std::vector<std::size_t> used;
    for (unsigned number = 0; number < least || std::chrono::steady_clock::now() < end; ++number) {
        CAPTURE(number);
        round(number);
        const struct mallinfo2 memory = ::mallinfo2();
        used.push_back(memory.uordblks + memory.hblkhd);
    }
    const auto third = std::ptrdiff_t(used.size() / 3);
    const std::size_t middle = *std::max_element(used.begin() + third, used.end() - third),
                      last = *std::max_element(used.end() - third, used.end());
    WARN(used.size() << " rounds; memory in use " << (middle >> 10) << " KiB in the middle, " << (last >> 10)
                     << " KiB at the end");
    CHECK(double(last) <= growth * double(middle) + double(slack));
}

}  // namespace bilayer::test
