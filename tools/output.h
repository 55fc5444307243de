// SPDX-License-Identifier: Apache-2.0
// Output of the commands: tables for people, JSON for programs, a progress bar on a terminal.
// Tested by tests/tools/build.cpp through the program.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <bilayer/collider/mass.h>
#include <bilayer/sdf/inspect.h>
#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh_io.h>
#include <bilayer/sdf/vdb_io.h>
#include "collider/contact/body/body.h"
#include "sdf/base/stopwatch.h"

namespace bilayer::tools {

using Json = nlohmann::ordered_json;

/// Replaces characters that steer a terminal by question marks: files may contain any. UTF-8 stays.
std::string printable(std::string text);

/// Rows of a label and a value, printed in two columns.
class Table {
  public:
    explicit Table(std::string title) : title_(std::move(title)) {}
    void row(std::string label, std::string value) { rows_.emplace_back(std::move(label), std::move(value)); }
    void print() const;

  private:
    std::string title_;
    std::vector<std::pair<std::string, std::string>> rows_;
};

/// Prints one JSON object, which must be the only output on stdout.
void print(const Json& json);

std::string grouped(std::uint64_t count);  ///< 1234567 as "1,234,567"
std::string metres(double length);         ///< six digits and the unit
std::string bytes(std::uint64_t count);    ///< in KiB, MiB or GiB
std::string hex(std::uint64_t hash);       ///< 16 digits
Json number(float value);                  ///< with the shortest digits of the float, not those of its double
Json vector(const glm::vec3& v);           ///< [x, y, z]
Json vector(const glm::dvec3& v);          ///< [x, y, z]
/// {"lower": [x, y, z], "upper": [x, y, z]} in world coordinates, for bounds relative to an origin.
Json box(const Bounds& bounds, const glm::dvec3& origin);
std::string boxText(const Bounds& bounds, const glm::dvec3& origin);  ///< "x y z .. x y z m", in world coordinates

/// The report of a mesh. `wall` is the thickness below which walls count as thin [m]; 0: no such test was made.
Json toJson(const MeshReport& report, float wall);
void addRows(Table& table, const MeshReport& report, float wall);

/// The properties of a mesh that are known without inspection.
/// @param balanced  whether every edge is used equally often in both directions: balanced() in sign_choice.h
Json toJson(const Mesh& mesh, bool balanced);
void addRows(Table& table, const Mesh& mesh, bool balanced);

/// What a mesh file contains, and what was omitted from it.
Json toJson(const ReadReport& read);
void addRows(Table& table, const ReadReport& read);

/// Size, band widths, method and signs of a field that was read from a file, or is written with these options.
void addRows(Table& table, const LevelSet& levelSet, const VdbOptions& stored = {});

/// How the field got its distances and signs: method, sign, signReason, signConflicts, errorBound [m].
Json provenance(const LevelSet& levelSet, const VdbOptions& stored = {});

/// Mass properties at density 1 [m]; null if there are none.
/// @param origin  origin of the centre's coordinates; the output is in world coordinates
Json toJson(const std::optional<MassProperties>& mass, const glm::dvec3& origin);
/// Adds all mass properties except the volume.
void addRows(Table& table, const std::optional<MassProperties>& mass, const glm::dvec3& origin);

/// The data that is stored for a body in addition to its field.
Json toJson(const detail::Body& body, const glm::dvec3& origin);
/// Adds all of it except the mass.
void addRows(Table& table, const detail::Body& body);

using detail::Stopwatch;

/// A progress bar on stderr during its lifetime, if stderr is a terminal.
class ProgressBar {
  public:
    explicit ProgressBar(std::string label);
    ~ProgressBar();
    ProgressBar(const ProgressBar&) = delete;
    ProgressBar& operator=(const ProgressBar&) = delete;

    /// For BuildOptions::progress. Null if the bar is not visible.
    std::function<bool(float)> callback();

  private:
    void draw(float part);

    std::string label_;
    bool visible_;
    int drawn_ = -1;
};

/// Throws std::runtime_error that names the path if a file cannot be written there. Call this before work that takes
/// time.
void requireWritable(const std::filesystem::path& path);

/// Writes a file whole or not at all. Throws std::runtime_error that names the file.
void writeText(const std::filesystem::path& path, const std::string& text);

/// Returns the peak resident memory of this process or of the importers that it ran, whichever is larger [bytes].
std::uint64_t peakMemory();

}  // namespace bilayer::tools
