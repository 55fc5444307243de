// SPDX-License-Identifier: Apache-2.0
// The ratios to rivals that a benchmark measured, kept in a file that `./run bench compare` reads.
// Tested by tests/bench/ratios.cpp.
#pragma once

#include <CLI/CLI.hpp>
#include <map>
#include <string>
#include <vector>

namespace bilayer::bench {

/// How many times as fast as its rivals the project was, in each round of a run. Seconds depend on the machine and on
/// what else it does; a ratio of two times of the same round depends on them much less.
class Ratios {
  public:
    /// @param benchmark  the name that follows `./run bench`
    explicit Ratios(std::string benchmark) : benchmark_(std::move(benchmark)) {}

    /// Adds the option --ratios, the file that write() writes.
    void addOption(CLI::App& app);

    /// Adds rival[i] / ours[i] of each round i that both have.
    /// @param name  what was measured, and the rival
    void add(const std::string& name, const std::vector<double>& rival, const std::vector<double>& ours);

    /// Writes the file, if one was asked for. Throws std::runtime_error that names it if it cannot be written.
    void write() const;

  private:
    std::string benchmark_, file_;
    std::map<std::string, std::vector<double>> ratios_;
};

}  // namespace bilayer::bench
