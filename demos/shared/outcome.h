// What a scene hands back: whether it did what it must, how fast, how deep bodies overlapped, and its recording. The
// same for all scenes, so that programs, tests and benchmarks print and compare them alike.
#pragma once

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <bilayer/sdf/level_set.h>
#include "demos/shared/plot.h"
#include "demos/shared/recording.h"

namespace bilayer::demo {

/// A figure that must not be greater than its limit.
struct Criterion {
    std::string name;
    double value, limit;
    std::string unit{};  ///< of both; empty for counts and ratios

    bool met() const { return value <= limit; }  ///< never where the value is NaN
};

/// Energy of all bodies that move, a value a step, the start included [J].
struct Energies {
    std::vector<double> kinetic;    ///< of translation and rotation
    std::vector<double> potential;  ///< against gravity, 0 at the origin

    /// The most that kinetic and potential energy together ever rise, in parts of the peak of the kinetic one: 0 is
    /// right where nothing drives the bodies.
    double rise() const;
};

/// Figures over time, for the .csv file of a scene that is not of rigid bodies.
struct Table {
    std::vector<std::string> columns;       ///< with units, as "volume_m3"
    std::vector<std::vector<double>> rows;  ///< one of each column in each
};

struct Outcome {
    Recording recording;
    std::string title{};
    std::vector<Criterion> criteria{};
    std::vector<std::pair<std::string, std::string>> facts{};  ///< what only this scene tells: label, value

    std::vector<std::pair<std::string, LevelSet>> fields{};  ///< worth a file of their own: name, field

    Table table{};               ///< of a scene without rigid bodies
    std::vector<Panel> plots{};  ///< in one picture

    int bodies = 0;  ///< that move; what tells of contacts, penetrations and energies is of rigid ones only
    float stepsPerSecond = 0;
    std::vector<double> stepMs{};                              ///< how long each step took [ms]
    long contactsFound = 0, contactsKept = 0, beyondBand = 0;  ///< sums over all steps
    Energies energies{};

    double voxelSize = 0;  ///< the smallest of all bodies [m]
    /// How deep each pair of bodies that overlap do so, in each frame measured, by the meshes; ascending [m].
    std::vector<double> penetrations{};

    std::uint64_t fingerprint = 0;  ///< changes with any bit of any pose in any step

    double medianStep() const;                                  ///< [ms]
    double slowStep() const;                                    ///< the 99th percentile [ms]
    double deepest() const;                                     ///< [m]
    double usuallyBelow() const;                                ///< the 99th percentile of penetrations [m]
    bool met() const;                                           ///< all criteria
    const Criterion& criterion(const std::string& name) const;  ///< throws std::out_of_range
};

/// The greater of two values, or the one that is NaN: std::max would lose it.
inline double worse(double a, double b) {
    return a >= b || std::isnan(a) ? a : b;
}

/// The value below which a share of all values lies (nearest rank); 0 if there are none.
double percentile(std::vector<double> values, double share);

/// Prints title, figures and criteria to the standard output.
void print(const Outcome& outcome);

/// Writes NAME.html, the recording, NAME.csv, the table or, where there is none, the energies over time, NAME.svg, the
/// plots if there are any, and the fields as .vdb files into a folder, which is made.
void write(const Outcome& outcome, const std::string& name, const std::filesystem::path& folder);

}  // namespace bilayer::demo
