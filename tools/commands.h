// The commands of the command line `bilayer`. Each function adds one command, whose callback does its work: it throws
// CLI::ParseError for wrong usage and any other exception where the input or the machine is at fault.
#pragma once

#include <CLI/CLI.hpp>
#include <limits>
#include <string>

namespace bilayer::tools {

/// Accepts finite numbers above zero; CLI::PositiveNumber lets NaN through.
inline CLI::Validator positive() {
    const auto complaint = [](const std::string& word) -> std::string {
        float value = 0;
        const bool good =
            CLI::detail::lexical_cast(word, value) && value > 0 && value <= std::numeric_limits<float>::max();
        return good ? "" : "must be a finite number above zero";
    };
    return CLI::Validator(complaint, "POSITIVE");
}

void addBuild(CLI::App& app);
void addInspect(CLI::App& app);
void addInfo(CLI::App& app);
void addQuery(CLI::App& app);
void addSurface(CLI::App& app);
void addSeed(CLI::App& app);
void addDevices(CLI::App& app);

}  // namespace bilayer::tools
