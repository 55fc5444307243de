// SPDX-License-Identifier: Apache-2.0
// Runs other programs and times them.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace bilayer::bench {

/// What a command took and printed.
struct CommandResult {
    double seconds = 0;
    std::string output, errors;  ///< what it wrote to standard output and standard error
    bool succeeded = false;      ///< exited with status 0
};

/// Runs a command until it exits. Throws std::system_error if it cannot be started.
/// @param words    the program, which is searched for in PATH, and its arguments
/// @param scratch  an existing folder for the files that hold what is printed
CommandResult runCommand(const std::vector<std::string>& words, const std::filesystem::path& scratch);

}  // namespace bilayer::bench
