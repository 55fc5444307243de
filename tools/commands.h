// SPDX-License-Identifier: Apache-2.0
// The commands of the command line program `bilayer`. Each function adds one command, whose callback does the work. The
// callback throws CLI::ParseError for wrong usage, and any other exception if the input or the machine is at fault.
// Tested by tests/tools/usage.cpp through the program.
#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>
#include <limits>
#include <string>
#include <system_error>

namespace bilayer::tools {

/// Accepts numbers for which `good` holds. `good` must reject NaN, which CLI::Range and CLI::PositiveNumber accept.
template <class Good>
CLI::Validator numbers(Good good, const std::string& complaint, const std::string& name) {
    const auto check = [=](const std::string& word) -> std::string {
        double value = 0;
        return CLI::detail::lexical_cast(word, value) && good(value) ? "" : "must be " + complaint;
    };
    return CLI::Validator(check, name);
}

/// Accepts numbers that a float can represent.
inline CLI::Validator finite() {
    const auto good = [](double value) { return std::abs(value) <= double(std::numeric_limits<float>::max()); };
    return numbers(good, "a finite number", "FINITE");
}

/// Accepts finite numbers above zero.
inline CLI::Validator positive() {
    const auto good = [](double value) {
        return float(value) > 0 && value <= double(std::numeric_limits<float>::max());
    };
    return numbers(good, "a finite number above zero", "POSITIVE");
}

/// Accepts numbers in low..high.
inline CLI::Validator within(double low, double high) {
    const auto good = [=](double value) { return value >= low && value <= high; };
    return numbers(good, fmt::format("in {:g}..{:g}", low, high), fmt::format("{:g}..{:g}", low, high));
}

/// Accepts finite numbers of zero or more.
inline CLI::Validator nonNegative() {
    const auto good = [](double value) { return value >= 0 && value <= double(std::numeric_limits<float>::max()); };
    return numbers(good, "a finite number, zero or more", "NONNEGATIVE");
}

/// Throws CLI::ValidationError if writing the output would overwrite an input.
inline void requireOther(const std::filesystem::path& output, const std::filesystem::path& input) {
    std::error_code absent;
    if (std::filesystem::equivalent(input, output, absent))
        throw CLI::ValidationError("--output", "would overwrite " + input.string());
}

struct Ranks;

/// @param ranks  the processes that share the tiles of a build in tiles
void addBuild(CLI::App& app, const Ranks& ranks);
void addMerge(CLI::App& app);
void addBatch(CLI::App& app);
void addInspect(CLI::App& app);
void addInfo(CLI::App& app);
void addQuery(CLI::App& app);
void addSurface(CLI::App& app);
void addExport(CLI::App& app);
void addSeed(CLI::App& app);
void addDevices(CLI::App& app);

/// The version of the program, and those of the compiler and the libraries that it was built with, a line each.
std::string versions();

}  // namespace bilayer::tools
