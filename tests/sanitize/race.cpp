// SPDX-License-Identifier: Apache-2.0
// A race, for the test of the thread sanitizer's suppressions: two threads write one number after a loop of TBB.
#include <oneapi/tbb/parallel_for.h>

#include <atomic>
#include <thread>

namespace {

int raced = 0;

[[gnu::noinline]] void raceInOurCode() {
    for (int i = 0; i < 1000; ++i) raced += i;
}

}  // namespace

int main() {
    std::atomic<int> sum{0};
    tbb::parallel_for(0, 1000, [&](int i) { sum += i; });
    std::thread other(raceInOurCode);
    raceInOurCode();
    other.join();
    return raced + sum == 0;
}
