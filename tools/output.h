// What the commands print: tables for people, JSON for programs, a progress bar on a terminal.
#pragma once

#include <chrono>
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
#include "collider/contact/body.h"

namespace bilayer::tools {

using namespace bilayer::detail;

using Json = nlohmann::ordered_json;

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

/// Prints one JSON object as the only thing on stdout.
void print(const Json& json);

std::string grouped(std::uint64_t count);  ///< 1234567 as "1,234,567"
std::string metres(double length);         ///< six digits and the unit
std::string bytes(std::uint64_t count);    ///< in KiB, MiB or GiB
std::string hex(std::uint64_t hash);       ///< 16 digits
Json number(float value);                  ///< with the digits that the float has, not those of its double
Json vector(const glm::vec3& v);           ///< [x, y, z]
Json vector(const glm::dvec3& v);          ///< likewise
/// {"lower": [x, y, z], "upper": [x, y, z]} in the world, of bounds relative to an origin.
Json box(const Bounds& bounds, const glm::dvec3& origin);
std::string boxText(const Bounds& bounds, const glm::dvec3& origin);  ///< "x y z .. x y z m", likewise

/// A mesh's report. `wall` is the thickness that counted as thin [m]; 0: none did.
Json toJson(const MeshReport& report, float wall);
void addRows(Table& table, const MeshReport& report, float wall);

/// What is known of a mesh without inspecting it.
/// @param balanced  whether every edge is run both ways equally often: balanced() in sign.h
Json toJson(const Mesh& mesh, bool balanced);
void addRows(Table& table, const Mesh& mesh, bool balanced);

/// What a mesh file held, and what of it was left out.
Json toJson(const ReadReport& read);
void addRows(Table& table, const ReadReport& read);

/// Size, widths, method and signs of a field that comes from a file, or goes into one with these options.
void addRows(Table& table, const LevelSet& levelSet, const VdbOptions& stored = {});

/// How it got its distances and signs: method, sign, signReason, signConflicts, errorBound [m].
Json provenance(const LevelSet& levelSet, const VdbOptions& stored = {});

/// Mass properties at density 1 [m]; null for nothing.
/// @param origin  that the centre is relative to; it is told in the world
Json toJson(const std::optional<MassProperties>& mass, const glm::dvec3& origin);
/// All of them but the volume.
void addRows(Table& table, const std::optional<MassProperties>& mass, const glm::dvec3& origin);

/// What is kept of a body beside its field.
Json toJson(const Body& body, const glm::dvec3& origin);
/// All of it but the mass.
void addRows(Table& table, const Body& body);

/// Seconds since its construction.
class Stopwatch {
  public:
    double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

  private:
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// A bar on stderr while it lives, where stderr is a terminal.
class ProgressBar {
  public:
    explicit ProgressBar(std::string label);
    ~ProgressBar();
    ProgressBar(const ProgressBar&) = delete;
    ProgressBar& operator=(const ProgressBar&) = delete;

    /// For BuildOptions::progress: null where nobody looks.
    std::function<bool(float)> callback();

  private:
    void draw(float part);

    std::string label_;
    bool visible_;
    int drawn_ = -1;
};

/// Throws std::runtime_error that names the path if a file could not be put there: asked before work that takes time.
void requireWritable(const std::filesystem::path& path);

/// The most memory that the process has had [bytes].
std::uint64_t peakMemory();

}  // namespace bilayer::tools
