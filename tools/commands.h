// The commands of the command line `bilayer`. Each function adds one command, whose callback does its work: it throws
// CLI::ParseError for wrong usage and any other exception where the input or the machine is at fault.
#pragma once

#include <CLI/CLI.hpp>

namespace bilayer::tools {

void addBuild(CLI::App& app);
void addInspect(CLI::App& app);
void addInfo(CLI::App& app);
void addQuery(CLI::App& app);
void addSurface(CLI::App& app);
void addSeed(CLI::App& app);
void addDevices(CLI::App& app);

}  // namespace bilayer::tools
