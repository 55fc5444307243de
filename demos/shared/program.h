// SPDX-License-Identifier: Apache-2.0
// The program around a scene: command line, printed results, and output files.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <functional>
#include <string>
#include <type_traits>
#include <vector>

#include "demos/shared/outcome.h"

namespace bilayer::demo {

/// Accepts any number except NaN, which CLI11's ranges accept.
CLI::Validator aNumber();

/// Options that all scenes share, such as --out and --threads, and those that the scene adds:
///
///     int main(int argc, char** argv) {
///         InclineOptions options;
///         Program program("incline", "A block on an incline");
///         program.option("--seconds", options.seconds, "how long [s]");
///         return program.run(argc, argv, [&] { return incline(options); });
///     }
class Program {
  public:
    Program(std::string name, const std::string& description);

    /// Adds a scene-specific option. The current value is the default that --help shows.
    template <class Value>
    CLI::Option* option(const std::string& flag, Value& value, const std::string& help) {
        CLI::Option* added = app_.add_option(flag, value, help)->capture_default_str();
        if constexpr (std::is_same_v<Value, float> || std::is_same_v<Value, std::vector<float>>)
            added->check(aNumber());
        return added;
    }
    CLI::Option* flag(const std::string& flag, bool& value, const std::string& help) {
        return app_.add_flag(flag, value, help);
    }

    /// Options that have one meaning in all scenes: --seconds, --steps, --iterations and --voxel.
    void seconds(float& duration, double min, double max, const std::string& help = "simulated time [s]");
    void steps(float& perSecond, double min = 30, double max = 10000);
    void iterations(int& count);
    void voxel(float& edge, double min, double max);
    /// --factory: a folder with parts of the Factory data set. If they are missing, run() says so and clears the path.
    /// @param parts  their names
    /// @param use    what the scene does with them
    void factory(std::filesystem::path& folder, const std::string& parts, const std::string& use,
                 bool (*hasParts)(const std::filesystem::path&));

    /// Parses the command line, runs the scene, prints its outcome and writes its files.
    /// @return the exit status: 0; 1 if the scene throws, 2 for wrong usage, 3 if a criterion is not met
    int run(int argc, char** argv, const std::function<Outcome()>& scene);

  private:
    Outcome play(const std::function<Outcome()>& scene) const;

    std::string name_, out_ = "out";
    std::function<void()> checkFactory_ = [] {};
    int threads_ = 0;
    bool compare_ = false;
    CLI::App app_;
};

}  // namespace bilayer::demo
