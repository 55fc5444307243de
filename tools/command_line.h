// SPDX-License-Identifier: Apache-2.0
// Runs the commands of a program: signals, standard streams, exit status.
// Tested by tests/tools/usage.cpp through the program.
#pragma once

#include <CLI/CLI.hpp>

namespace bilayer::tools {

/// The exit status of the programs. 1: input or machine at fault, one line on stderr; 2: wrong usage.
enum Status { done = 0, fault = 1, usage = 2 };

/// Opens closed standard streams, and makes signals remove partial files. Call this first.
void prepareProcess();

/// Parses the words of a command line and runs its command. Returns the exit status.
int runCommandLine(CLI::App& app, int count, char** arguments);

}  // namespace bilayer::tools
