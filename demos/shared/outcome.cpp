// SPDX-License-Identifier: Apache-2.0
#include "demos/shared/outcome.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <numeric>
#include <stdexcept>

#include <bilayer/sdf/vdb_io.h>

namespace bilayer::demo {
namespace {

void row(const std::string& label, const std::string& value) {
    fmt::print("  {:<36}{}\n", label, value);
}

std::string withUnit(double value, const std::string& unit) {
    return fmt::format("{:.4g}{}{}", value, unit.empty() ? "" : " ", unit);
}

void writeEnergies(const Outcome& outcome, const std::filesystem::path& path) {
    std::ofstream file(path);
    file << "time_s,kinetic_J,potential_J\n";
    for (std::size_t i = 0; i < outcome.energies.kinetic.size(); ++i)
        file << fmt::format("{:.6g},{:.9g},{:.9g}\n", double(i) / outcome.stepsPerSecond, outcome.energies.kinetic[i],
                            outcome.energies.potential[i]);
    if (!file.flush()) throw std::runtime_error(path.string() + ": cannot be written");
}

void writeTable(const Table& table, const std::filesystem::path& path) {
    std::ofstream file(path);
    file << fmt::format("{}\n", fmt::join(table.columns, ","));
    for (const auto& values : table.rows) file << fmt::format("{:.9g}\n", fmt::join(values, ","));
    if (!file.flush()) throw std::runtime_error(path.string() + ": cannot be written");
}

// Prints what only rigid bodies have.
void printBodies(const Outcome& outcome) {
    const auto steps = double(outcome.stepMs.size());
    const auto depth = [&](double d) {
        return fmt::format("{:.3f} mm = {:.2f} voxels", 1e3 * d, d / outcome.voxelSize);
    };
    row("contacts a step", fmt::format("{:.0f} found, {:.0f} kept", double(outcome.contactsFound) / steps,
                                       double(outcome.contactsKept) / steps));
    row("points too deep for the band", std::to_string(outcome.beyondBand));
    row("deepest penetration", depth(outcome.deepest()) + ", by the meshes");
    row("99 in 100 below", depth(outcome.usuallyBelow()));
    row("peak of kinetic energy",
        withUnit(*std::max_element(outcome.energies.kinetic.begin(), outcome.energies.kinetic.end()), "J"));
    row("energy rises by", fmt::format("{:.2f} % of that", 100 * outcome.energies.rise()));
}

}  // namespace

double Energies::rise() const {
    double least = std::numeric_limits<double>::infinity(), most = 0, peak = 0;
    for (std::size_t i = 0; i < kinetic.size(); ++i) {
        const double energy = kinetic[i] + potential[i];
        if (std::isnan(energy)) return energy;
        least = std::min(least, energy);
        most = std::max(most, energy - least);
        peak = std::max(peak, kinetic[i]);
    }
    return peak > 0 ? most / peak : 0;
}

double percentile(std::vector<double> values, double share) {
    if (values.empty()) return 0;
    const auto rank = std::size_t(std::ceil(share * double(values.size())));
    const auto nth = values.begin() + std::ptrdiff_t(rank > 0 ? rank - 1 : 0);
    std::nth_element(values.begin(), nth, values.end());
    return *nth;
}

double Outcome::medianStep() const {
    return percentile(stepMs, 0.5);
}

double Outcome::slowStep() const {
    return percentile(stepMs, 0.99);
}

double Outcome::deepest() const {
    return penetrations.empty() ? 0 : penetrations.back();
}

double Outcome::usuallyBelow() const {
    return percentile(penetrations, 0.99);
}

bool Outcome::met() const {
    return std::all_of(criteria.begin(), criteria.end(), [](const Criterion& c) { return c.met(); });
}

const Criterion& Outcome::criterion(const std::string& name) const {
    for (const Criterion& criterion : criteria)
        if (criterion.name == name) return criterion;
    throw std::out_of_range("no criterion '" + name + "'");
}

void print(const Outcome& outcome) {
    const auto steps = double(outcome.stepMs.size());
    fmt::print("{}\n", outcome.title);
    for (const auto& [label, value] : outcome.facts) row(label, value);
    if (outcome.bodies > 0) row("bodies that move", std::to_string(outcome.bodies));
    if (steps > 0) {
        row("simulated", fmt::format("{:.2f} s in {:.0f} steps, in {:.1f} s", steps / outcome.stepsPerSecond, steps,
                                     1e-3 * std::accumulate(outcome.stepMs.begin(), outcome.stepMs.end(), 0.0)));
        row("a step", fmt::format("{:.2f} ms, 99 in 100 below {:.2f} ms", outcome.medianStep(), outcome.slowStep()));
    }
    if (outcome.bodies > 0) printBodies(outcome);
    row("fingerprint", fmt::format("{:016x}", outcome.fingerprint));
    fmt::print("criteria\n");
    for (const Criterion& criterion : outcome.criteria)
        row(criterion.name, fmt::format("{:<20} at most {:<12} {}", withUnit(criterion.value, criterion.unit),
                                        withUnit(criterion.limit, criterion.unit), criterion.met() ? "met" : "MISSED"));
}

void write(const Outcome& outcome, const std::string& name, const std::filesystem::path& folder) {
    std::filesystem::create_directories(folder);
    outcome.recording.write(folder / (name + ".html"));
    if (outcome.table.columns.empty())
        writeEnergies(outcome, folder / (name + ".csv"));
    else
        writeTable(outcome.table, folder / (name + ".csv"));
    if (!outcome.plots.empty()) writeSvg(folder / (name + ".svg"), outcome.plots);
    for (const auto& [field, levelSet] : outcome.fields) writeVdb(folder / (field + ".vdb"), levelSet);
}

}  // namespace bilayer::demo
