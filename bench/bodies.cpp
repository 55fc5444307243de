// SPDX-License-Identifier: Apache-2.0
// Which meshes with defects are usable as rigid bodies: drops each on five kinds of ground and prints the energy that
// it gains, as a table in Markdown.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/inspect.h>
#include <bilayer/sdf/mesh_io.h>
#include "bench/builders.h"
#include "bench/program.h"
#include "tests/support/drops.h"
#include "tests/support/random_pose.h"

using namespace bilayer;
using namespace bilayer::bench;

namespace {

namespace fs = std::filesystem;

constexpr float seconds = 2.5f;  // of each drop
// contacts know the depth of a penetration up to this width
constexpr float interiorWidthVoxels = 6;
constexpr double maxOffset = 0.3;  // of a body from the centre of the ground, along x and y [m]

struct Options {
    fs::path meshes = corpusFolder(), markdownFile;
    std::vector<std::string> names;
    float resolution = 96;
    int drops = 36;
};

/// The same for every mesh and ground.
std::vector<test::DropPlace> places(int drops) {
    test::Random random(7);
    std::vector<test::DropPlace> all;
    for (int i = 0; i < drops; ++i) {
        const glm::quat rotation = test::randomRotation(random);
        all.push_back({rotation, glm::vec2(random.point(maxOffset))});
    }
    return all;
}

/// The worst of the drops on a ground.
struct GroundResult {
    double gain = 0;  ///< relative to the energy of the fall
    bool fell = false;

    bool good() const { return gain < test::maxEnergyGain && !fell; }
};

/// A mesh with defects as a body.
struct Row {
    std::string mesh, sign;
    float wall = 0;                     ///< MeshReport::commonWall [voxels]
    std::vector<GroundResult> results;  ///< for each ground; empty for a mesh without volume

    bool isBody() const { return !results.empty(); }
    bool usable() const {
        return isBody() && std::all_of(results.begin(), results.end(), std::mem_fn(&GroundResult::good));
    }
};

bool hasDefects(const MeshReport& report) {
    return !report.closed() || !report.oriented() || report.flippedTriangles || report.selfIntersections ||
           report.nonManifoldVertices || report.duplicateTriangles || report.degenerateTriangles;
}

/// Whether mass properties exist, as every dynamic body needs them.
bool hasVolume(const Collider& collider) {
    try {
        return collider.mass().volume > 0;
    } catch (const std::invalid_argument&) {
        return false;
    }
}

Row measure(const std::string& name, const Mesh& mesh, const Options& options, const std::vector<test::Ground>& all) {
    const float voxelSize = voxelSizeFor(mesh, options.resolution);
    const LevelSet field = build(mesh, {.voxelSize = voxelSize, .interiorWidthVoxels = interiorWidthVoxels});
    const auto collider = std::make_shared<Collider>(mesh, field);
    Row row{name, field.sign(), inspect(mesh).commonWall / voxelSize, {}};
    if (!hasVolume(*collider)) return row;
    const std::vector<test::DropPlace> dropPlaces = places(options.drops);
    for (const test::Ground& ground : all) {
        GroundResult worst;
        for (const test::DropPlace& place : dropPlaces) {
            const test::Drop drop = test::drop(collider, *ground.shape, place, seconds);
            worst = {std::max(worst.gain, drop.gain), worst.fell || drop.fell};
        }
        row.results.push_back(worst);
    }
    return row;
}

/// Returns nothing for a mesh without defects, and for a file without a field; the reason is printed on stderr.
std::optional<Row> judge(const std::string& name, const Options& options, const std::vector<test::Ground>& all) {
    try {
        const Mesh mesh = readMesh(options.meshes / name);
        if (!hasDefects(inspect(mesh))) return {};
        return measure(name, test::droppable(mesh), options, all);
    } catch (const std::exception& error) {
        fmt::print(stderr, "bench bodies: {} is left out: {}\n", name, error.what());
        return {};
    }
}

std::string header(const std::vector<test::Ground>& all) {
    std::string names = "| mesh | signs | wall | usable |", rule = "|---|---|---|---|";
    for (const test::Ground& ground : all) {
        names += fmt::format(" {} |", ground.name);
        rule += "---|";
    }
    return names + "\n" + rule + "\n";
}

std::string cell(const GroundResult& result) {
    if (result.fell) return "falls through";
    return result.gain < 1e-3 ? "< 0.1" : fmt::format("{:.1f}", 100 * result.gain);
}

std::string line(const Row& row) {
    std::string cells =
        fmt::format("| {} | {} | {:.1f} | {} |", row.mesh, row.sign, row.wall, row.usable() ? "yes" : "**no**");
    for (const GroundResult& result : row.results) cells += fmt::format(" {} |", cell(result));
    return cells + "\n";
}

std::string footer(const std::vector<Row>& rows) {
    std::string without;
    std::size_t bodies = 0, usable = 0;
    for (const Row& row : rows) {
        bodies += row.isBody();
        usable += row.usable();
        if (!row.isBody()) without += fmt::format("{}`{}`", without.empty() ? "" : ", ", row.mesh);
    }
    std::string text = fmt::format(
        "\nUsable: {} of {}. They gain less than {:g} % of the fall's energy on each ground, and stay on it.\n", usable,
        bodies, 100 * test::maxEnergyGain);
    if (!without.empty()) text += fmt::format("\nNo volume, hence no dynamic body: {}.\n", without);
    return text;
}

void write(const fs::path& path, const std::string& text) {
    std::ofstream file(path);
    file << text << std::flush;
    if (!file) throw std::runtime_error(fmt::format("--markdown: cannot write {}", path.string()));
}

void checkOutput(const fs::path& path) {
    const fs::path folder = fs::absolute(path).parent_path();
    if (fs::is_directory(path)) throw std::invalid_argument(fmt::format("--markdown: {} is a folder", path.string()));
    if (!fs::is_directory(folder))
        throw std::invalid_argument(fmt::format("--markdown: there is no folder {}", folder.string()));
}

int run(int argc, char** argv) {
    CLI::App app(
        "Drops meshes with defects on five kinds of ground: the largest rise of the energy over its earlier minimum "
        "[percent of the energy of the fall].");
    Options options;
    app.add_option("--meshes", options.meshes, "folder of meshes, with its subfolders")
        ->check(CLI::ExistingDirectory)
        ->capture_default_str();
    app.add_option("--mesh", options.names, "names in that folder; by default all");
    app.add_option("--resolution", options.resolution, "voxels along the longest side")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    app.add_option("--drops", options.drops, "drops of each mesh on each ground")
        ->check(CLI::Range(1, 1000))
        ->capture_default_str();
    app.add_option("--markdown", options.markdownFile, "also write the table to this file");
    CLI11_PARSE(app, argc, argv);
    if (!options.markdownFile.empty()) checkOutput(options.markdownFile);
    for (const std::string& name : options.names)
        if (!fs::is_regular_file(options.meshes / name))
            throw std::invalid_argument(
                fmt::format("--mesh: there is no file {} in {}", name, options.meshes.string()));

    const std::vector<test::Ground> all = test::grounds();
    std::string text = header(all);
    fmt::print("{}", text);
    std::vector<Row> rows;
    for (const std::string& name : options.names.empty() ? meshFiles(options.meshes) : options.names)
        if (const std::optional<Row> row = judge(name, options, all)) {
            rows.push_back(*row);
            if (!row->isBody()) continue;
            text += line(*row);
            fmt::print("{}", line(*row));
            std::fflush(stdout);
        }
    if (rows.empty()) throw std::invalid_argument(fmt::format("no mesh with defects in {}", options.meshes.string()));
    fmt::print("{}", footer(rows));
    if (!options.markdownFile.empty()) write(options.markdownFile, text + footer(rows));
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    return program("bodies", run, argc, argv);
}
