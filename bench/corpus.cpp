// SPDX-License-Identifier: Apache-2.0
// Builds every mesh of the public corpus, clean or not, with automatic signs. Prints the result of inspect(), the sign
// method and its reason, and the quality of the field. Exit status 1 if a build fails that should not.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/inspect.h>
#include <bilayer/sdf/mesh_io.h>
#include <bilayer/sdf/surface.h>
#include "bench/builders.h"
#include "bench/program.h"
#include "sdf/base/openvdb.h"
#include "sdf/sign/sign_choice.h"

using namespace bilayer;
using namespace bilayer::bench;
using namespace bilayer::detail;

namespace {

/// If the surface passes between two neighbours of different sides, their distances sum to at most one voxel. The slack
/// covers rounding of distances [voxels].
constexpr float borderSlack = 1.001f;
/// Border of a slice around the mesh [voxels].
constexpr int sliceMargin = 5;

struct Options {
    std::vector<std::string> meshes;
    float resolution = 128;
    std::string markdownFile, scenes;
    char axis = 'z';
    float at = 0.5f;
};

/// Result for a mesh.
struct Row {
    std::string mesh, error;  // error: the reason why there is no field
    MeshReport report;
    std::string sign, reason;
    std::int64_t conflicts = 0;
    double inside = 0;            // fraction of the active voxels
    double bridged = 0;           // fraction of the neighbour pairs of different sides without a surface between them
    double area = 0, volume = 0;  // of the field's surface [m^2], [m^3]
    bool none = false, closed = false;  // whether the field has no surface, or a closed one
    double seconds = 0;                 // build time
};

std::filesystem::path meshPath(const std::string& name) {
    const std::filesystem::path path = corpusFolder() / name;
    if (std::filesystem::exists(name)) return name;
    if (std::filesystem::exists(path)) return path;
    throw std::invalid_argument(fmt::format("no mesh {}", name));
}

template <class Entry>
auto meta(const openvdb::FloatGrid& grid, const char* name) {
    return grid.metaValue<Entry>(name);
}

double areaOf(const Mesh& mesh) {
    double area = 0;
    for (const auto& t : mesh.triangles)
        area +=
            0.5 *
            double(glm::length(glm::cross(mesh.points[t.y] - mesh.points[t.x], mesh.points[t.z] - mesh.points[t.x])));
    return area;
}

double volumeOf(const Mesh& mesh) {
    const glm::dvec3 about(bounds(mesh).centre());
    double volume = 0;
    for (const auto& t : mesh.triangles)
        volume += glm::dot(glm::dvec3(mesh.points[t.x]) - about,
                           glm::cross(glm::dvec3(mesh.points[t.y]) - about, glm::dvec3(mesh.points[t.z]) - about)) /
                  6;
    return volume;
}

// Fraction of the inside/outside border that no surface explains: lids over holes, and wrong signs.
double bridgedShare(const openvdb::FloatGrid& grid) {
    const auto reach = borderSlack * float(grid.voxelSize()[0]);
    std::size_t borders = 0, bridged = 0;
    auto voxels = grid.getConstAccessor();
    for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf)
        for (auto voxel = leaf->cbeginValueAll(); voxel; ++voxel)
            for (int axis = 0; axis < 3; ++axis) {
                openvdb::Coord next = voxel.getCoord();
                next[axis] += 1;
                const float here = *voxel, there = voxels.getValue(next);
                if ((here < 0) == (there < 0)) continue;
                ++borders;
                bridged += std::abs(here) + std::abs(there) > reach;
            }
    return borders ? double(bridged) / double(borders) : 0;
}

double insideShare(const openvdb::FloatGrid& grid) {
    std::size_t inside = 0;
    for (auto voxel = grid.cbeginValueOn(); voxel; ++voxel) inside += *voxel < 0;
    return double(inside) / double(grid.activeVoxelCount());
}

nlohmann::json json(const Mesh& mesh) {
    auto points = nlohmann::json::array(), triangles = nlohmann::json::array();
    for (const auto& p : mesh.points) points.insert(points.end(), {p.x, p.y, p.z});
    for (const auto& t : mesh.triangles) triangles.insert(triangles.end(), {t.x, t.y, t.z});
    return {{"points", points}, {"triangles", triangles}};
}

// The voxels of one layer. Values are in voxels; rows are along the axis after the next one.
nlohmann::json slice(const openvdb::FloatGrid& grid, const Mesh& mesh, int axis, float at) {
    const Bounds box = bounds(mesh);
    const float h = float(grid.voxelSize()[0]);
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const auto index = [&](float x) { return int(std::lround(x / h)); };
    openvdb::Coord voxel;
    voxel[axis] = index(glm::mix(box.lower[axis], box.upper[axis], at));
    const openvdb::Coord low(index(box.lower.x) - sliceMargin, index(box.lower.y) - sliceMargin,
                             index(box.lower.z) - sliceMargin);
    const openvdb::Coord high(index(box.upper.x) + sliceMargin, index(box.upper.y) + sliceMargin,
                              index(box.upper.z) + sliceMargin);
    auto values = nlohmann::json::array(), active = nlohmann::json::array();
    auto voxels = grid.getConstAccessor();
    for (voxel[v] = low[v]; voxel[v] <= high[v]; ++voxel[v])
        for (voxel[u] = low[u]; voxel[u] <= high[u]; ++voxel[u]) {
            values.push_back(voxels.getValue(voxel) / h);
            active.push_back(int(voxels.isValueOn(voxel)));
        }
    return {{"axis", axis},
            {"plane", float(voxel[axis]) * h},
            {"low", {low[u], low[v]}},
            {"size", {high[u] - low[u] + 1, high[v] - low[v] + 1}},
            {"values", values},
            {"active", active}};
}

// Writes the input of docs/dirty.sh.
void writeScene(const Options& options, const Row& row, const Mesh& mesh, const Mesh& border,
                const openvdb::FloatGrid& grid) {
    const std::string name = std::filesystem::path(row.mesh).stem().string();
    std::ofstream file(std::filesystem::path(options.scenes) / (name + ".json"));
    file << nlohmann::json{{"name", row.mesh},
                           {"verdict", verdict(row.report)},
                           {"sign", row.sign},
                           {"reason", row.reason},
                           {"voxelSize", grid.voxelSize()[0]},
                           {"mesh", json(mesh)},
                           {"surface", json(border)},
                           {"slice", slice(grid, mesh, options.axis - 'x', options.at)}};
}

void measure(const Options& options, const Mesh& mesh, Row& row) {
    const auto start = std::chrono::steady_clock::now();
    const LevelSet field = build(mesh, {.voxelSize = voxelSizeFor(mesh, options.resolution)});
    row.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    const openvdb::FloatGrid& grid = *field.grids().distance;
    row.sign = meta<std::string>(grid, metadata::sign);
    row.reason = meta<std::string>(grid, metadata::signReason);
    row.conflicts = meta<std::int64_t>(grid, metadata::signConflicts);
    row.inside = insideShare(grid);
    row.bridged = bridgedShare(grid);
    const Mesh border = surface(field);
    row.none = border.triangles.empty();
    row.closed = !row.none && balanced(border);
    row.area = areaOf(border);
    row.volume = volumeOf(border);
    if (!options.scenes.empty()) writeScene(options, row, mesh, border, grid);
}

Row judge(const Options& options, const std::string& name) {
    Row row;
    row.mesh = name;
    try {
        const Mesh mesh = readMesh(meshPath(name));
        row.report = inspect(mesh);
        measure(options, mesh, row);
    } catch (const std::exception& error) {
        // the message names the file by its full path
        row.error = error.what();
        const std::string folder = corpusFolder().string() + "/";
        if (const auto at = row.error.find(folder); at != std::string::npos) row.error.erase(at, folder.size());
    }
    return row;
}

std::string borderText(const Row& row) {
    return row.none ? "none" : row.closed ? "closed" : "OPEN";
}

std::string percent(double part) {
    return part == 0 ? "0" : part < 1e-3 ? "< 0.1" : fmt::format("{:.1f}", 100 * part);
}

std::string volumeText(const Row& row) {
    return row.report.closed() ? fmt::format("{:.4g} / {:.4g}", row.volume, row.report.volume)
                               : fmt::format("{:.4g}", row.volume);
}

void print(const Row& row) {
    if (!row.error.empty())
        fmt::print("{:<36} {}\n", row.mesh, row.error);
    else
        fmt::print("{:<36} {:>7} {:<8} {:>4} {:>6} {:>6} {:<6} {:>6} {:<22} {:>6.2f}  {}; {}\n", row.mesh,
                   row.report.triangles, row.sign, row.conflicts, percent(row.inside), percent(row.bridged),
                   borderText(row), fmt::format("{:.2f}", row.area / row.report.area), volumeText(row), row.seconds,
                   verdict(row.report), row.reason);
    std::fflush(stdout);
}

std::string markdown(const std::vector<Row>& rows) {
    std::string text =
        "| mesh | triangles | `inspect` | signs by | because | inside [%] | bridged [%] | surface | area ratio | "
        "volume "
        "| build [s] |\n|---|---|---|---|---|---|---|---|---|---|---|\n";
    for (const Row& row : rows)
        text += row.error.empty() ? fmt::format("| {} | {} | {} | {} | {} | {} | {} | {} | {:.2f} | {} | {:.2f} |\n",
                                                row.mesh, row.report.triangles, verdict(row.report), row.sign,
                                                row.reason, percent(row.inside), percent(row.bridged), borderText(row),
                                                row.area / row.report.area, volumeText(row), row.seconds)
                                  : fmt::format("| {} | | no field: {} | | | | | | | | |\n", row.mesh, row.error);
    return text;
}

int run(int argc, char** argv) {
    CLI::App app("Builds a field of each public mesh, with signs found automatically, and reports the result.");
    Options options;
    app.add_option("--mesh", options.meshes, "mesh files or names in the corpus; by default all of it");
    app.add_option("--resolution", options.resolution, "voxels along the longest side")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    app.add_option("--markdown", options.markdownFile, "also write the table to this file");
    app.add_option("--scenes", options.scenes, "also write the input of docs/dirty.sh into this folder")
        ->check(CLI::ExistingDirectory);
    app.add_option("--axis", options.axis, "axis of the slice in a scene")
        ->check(CLI::IsMember({'x', 'y', 'z'}))
        ->capture_default_str();
    app.add_option("--at", options.at, "position of the slice, from 0 to 1 through the mesh's bounds")
        ->check(CLI::Range(0.f, 1.f))
        ->capture_default_str();
    CLI11_PARSE(app, argc, argv);

    fmt::print("{:<36} {:>7} {:<8} {:>4} {:>6} {:>6} {:<6} {:>6} {:<22} {:>6}\n", "mesh", "tri.", "sign", "con.",
               "in [%]", "br [%]", "border", "area", "volume", "s");
    std::vector<Row> rows;
    for (const std::string& name : options.meshes.empty() ? meshFiles(corpusFolder()) : options.meshes) {
        rows.push_back(judge(options, name));
        print(rows.back());
    }
    const auto fields = std::count_if(rows.begin(), rows.end(), [](const Row& row) { return row.error.empty(); });
    fmt::print("{} meshes, {} fields\n", rows.size(), fields);
    if (!options.markdownFile.empty()) std::ofstream(options.markdownFile) << markdown(rows);
    // a mesh whose triangles were read must have a field
    return std::any_of(rows.begin(), rows.end(),
                       [](const Row& row) { return !row.error.empty() && row.report.triangles > 0; });
}

}  // namespace

int main(int argc, char** argv) {
    return program("corpus", run, argc, argv);
}
