// SPDX-License-Identifier: Apache-2.0
// The result of a scene: whether it met its criteria, its speed, the penetration depths, and its recording. All scenes
// share this type, so that programs, tests and benchmarks print and compare them in the same way.
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

/// A value that must not exceed its limit.
struct Criterion {
    std::string name;
    double value, limit;
    std::string unit{};  ///< of value and limit; empty for counts and ratios

    bool met() const { return value <= limit; }  ///< false if the value is NaN
};

/// Energy of all dynamic bodies, one value per step, including the start [J].
struct Energies {
    std::vector<double> kinetic;    ///< of translation and rotation
    std::vector<double> potential;  ///< in gravity, 0 at the origin

    /// Returns the max rise of the sum of kinetic and potential energy, as a fraction of the peak kinetic energy. It
    /// should be 0 if nothing drives the bodies.
    double rise() const;
};

/// Values over time, for the .csv file of a scene without rigid bodies.
struct Table {
    std::vector<std::string> columns;       ///< with units, such as "volume_m3"
    std::vector<std::vector<double>> rows;  ///< one value per column
};

struct Outcome {
    Recording recording;
    std::string title{};
    std::vector<Criterion> criteria{};
    std::vector<std::pair<std::string, std::string>> facts{};  ///< specific to this scene: label, value

    std::vector<std::pair<std::string, LevelSet>> fields{};  ///< to be written to separate files: name, field

    Table table{};               ///< of a scene without rigid bodies
    std::vector<Panel> plots{};  ///< in one picture

    int bodies = 0;  ///< count of dynamic bodies; contacts, penetrations and energies refer to rigid bodies only
    float stepsPerSecond = 0;
    std::vector<double> stepMs{};                              ///< duration of each step [ms]
    long contactsFound = 0, contactsKept = 0, beyondBand = 0;  ///< sums over all steps
    Energies energies{};

    double voxelSize = 0;  ///< min voxel size of all bodies [m]
    /// Penetration depth of each overlapping pair in each measured frame, computed from the meshes; ascending [m].
    std::vector<double> penetrations{};

    std::uint64_t fingerprint = 0;  ///< changes if any bit of any pose in any step changes

    double medianStep() const;                                  ///< [ms]
    double slowStep() const;                                    ///< the 99th percentile [ms]
    double deepest() const;                                     ///< [m]
    double usuallyBelow() const;                                ///< the 99th percentile of penetrations [m]
    bool met() const;                                           ///< whether all criteria are met
    const Criterion& criterion(const std::string& name) const;  ///< throws std::out_of_range
};

/// Returns the greater of two values, or the one that is NaN, which std::max would drop.
inline double worse(double a, double b) {
    return a >= b || std::isnan(a) ? a : b;
}

/// Returns the percentile of `values` at `share` (nearest rank); 0 if there are no values.
double percentile(std::vector<double> values, double share);

/// Prints title, facts and criteria to the standard output.
void print(const Outcome& outcome);

/// Writes the files of a scene into a folder, which is created if necessary:
/// - NAME.html: the recording,
/// - NAME.csv: the table, or the energies over time if there is no table,
/// - NAME.svg: the plots, if any,
/// - the fields as .vdb files.
void write(const Outcome& outcome, const std::string& name, const std::filesystem::path& folder);

}  // namespace bilayer::demo
