// What main() of every benchmark comes to.
#pragma once

#include <fmt/format.h>

#include <exception>

namespace bilayer::bench {

/// Runs a benchmark and returns its status; 1, after a line on stderr, where something is thrown.
/// @param name  as it is called after `./run bench`
inline int program(const char* name, int (*run)(int, char**), int argc, char** argv) {
    try {
        return run(argc, argv);
    } catch (const std::exception& error) {
        fmt::print(stderr, "bench {}: {}\n", name, error.what());
        return 1;
    }
}

}  // namespace bilayer::bench
