// SPDX-License-Identifier: Apache-2.0
// The main() of every benchmark.
#pragma once

#include <fmt/format.h>

#include <exception>

namespace bilayer::bench {

/// Runs a benchmark and returns its exit status. For an exception it prints one line on stderr and returns 1.
/// @param name  the name that follows `./run bench`
inline int program(const char* name, int (*run)(int, char**), int argc, char** argv) {
    try {
        return run(argc, argv);
    } catch (const std::exception& error) {
        fmt::print(stderr, "bench {}: {}\n", name, error.what());
        return 1;
    }
}

}  // namespace bilayer::bench
