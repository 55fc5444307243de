// SPDX-License-Identifier: Apache-2.0
// Runs the built `bilayer` as a child process.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace bilayer::test {

struct Result {
    int status = -1;  ///< exit status, or 128 plus the signal
    std::string out, err;
    std::size_t peakMemory = 0;  ///< peak resident memory [bytes]

    nlohmann::json json() const { return nlohmann::json::parse(out); }
    std::size_t errorLines() const;
};

struct Surroundings {
    std::string input{};                   ///< written to its standard input
    long fileSizeLimit = -1;               ///< RLIMIT_FSIZE [bytes]
    std::string output{};                  ///< a path to redirect standard output to, instead of Result::out
    std::vector<std::string> variables{};  ///< "NAME=value"; "NAME" removes one
    long memoryLimit = -1;                 ///< RLIMIT_AS [bytes]
    std::vector<int> closed{};             ///< standard streams that are closed
    std::string inputPath{};               ///< opened as its standard input, instead of `input`
    std::string folder{};                  ///< its working directory
    long maxSeconds = -1;                  ///< RLIMIT_CPU: longer runs end by a signal
};

using Words = std::vector<std::string>;

/// Runs it until it exits.
Result run(const Words& arguments, const Surroundings& surroundings = {});

/// Starts it and returns its process id; its output goes to /dev/null.
pid_t start(const Words& arguments);

/// Waits for a process; returns the exit status, or 128 plus the signal.
int wait(pid_t process);

Words joined(Words words, const Words& more);

/// Runs a command without a message on stderr. Returns its JSON.
nlohmann::json built(const Words& words);

/// A sphere of radius 0.5 as a mesh file.
std::filesystem::path sphereFile(const std::string& name = "sphere.ply", int levels = 3);

/// A field of that sphere at voxel size 0.05, built once.
std::string fieldFile();

/// Builds the sphere's field without a message on stderr. Returns the JSON report.
nlohmann::json buildSphere(const std::string& output, const Words& options);

/// The path of an output that no run creates.
std::string rejectedOutput();

/// The words of a build that is rejected.
Words rejectedBuild(const std::filesystem::path& mesh, Words options = {"--voxel-size", "0.1"});

/// The contents of a file.
std::string contents(const std::filesystem::path& path);

/// A text file in the scratch folder.
std::filesystem::path textFile(const std::string& name, const std::string& text);

}  // namespace bilayer::test
