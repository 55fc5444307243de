// SPDX-License-Identifier: Apache-2.0
// `bilayer query`, `surface` and `export`: field values as numbers, as a mesh, and as grids for a GPU.
// Tested by tests/tools/field.cpp through the program.
#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <bilayer/collider/field.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include <bilayer/sdf/nanovdb.h>
#include <bilayer/sdf/surface.h>
#include "collider/contact/body/body.h"
#include "sdf/base/openvdb.h"
#include "sdf/base/usable_memory.h"
#include "sdf/tiles/tile_manifest.h"
#include "tools/commands.h"
#include "tools/output.h"

namespace bilayer::tools {
namespace {

constexpr const char* blanks = " \t\r";

struct FieldArguments {
    std::filesystem::path field, output;
    SurfaceOptions options;
    bool json = false;
};

// Parses exactly three finite numbers. Locales and hexadecimal digits are not supported.
bool parsePoint(const std::string& line, glm::dvec3& point) {
    std::size_t at = 0;
    for (int axis = 0; axis < 3; ++axis) {
        at = line.find_first_not_of(blanks, at);
        if (at == std::string::npos) return false;
        at += line[at] == '+';
        const char* end = line.data() + std::min(line.find_first_of(blanks, at), line.size());
        const auto [stop, error] = std::from_chars(line.data() + at, end, point[axis]);
        if (error != std::errc() || stop != end || !std::isfinite(float(point[axis]))) return false;
        at = std::size_t(end - line.data());
    }
    return line.find_first_not_of(blanks, at) == std::string::npos;
}

void answerQueries(const auto& field, const glm::dvec3& origin) {
    std::ios::sync_with_stdio(false);
    std::string line;
    for (std::size_t count = 1;; ++count) {
        // flush for an interactive program that waits for each answer, without slowing down a long list
        if (std::cin.rdbuf()->in_avail() <= 0) std::fflush(stdout);
        if (!std::getline(std::cin, line)) break;
        glm::dvec3 point;
        if (!parsePoint(line, point))
            throw std::runtime_error(fmt::format("standard input, line {}: expected three numbers x y z", count));
        const Sample s = field.sample(glm::vec3(point - origin));
        fmt::print("{:.9g} {:.9g} {:.9g} {:.9g} {}\n", s.distance, s.gradient.x, s.gradient.y, s.gradient.z,
                   int(s.inBand));
    }
    if (std::cin.bad()) throw std::runtime_error("cannot read standard input: is it closed, or a folder?");
}

void runQuery(const FieldArguments& a) {
    if (std::filesystem::is_directory(a.field)) {
        const TiledField field(a.field, std::size_t(detail::usableMemory() / 2));
        return answerQueries(field, detail::readTileManifest(a.field).origin);
    }
    const LevelSet levelSet = detail::readStored(a.field).levelSet;
    answerQueries(Field(levelSet), levelSet.origin());
}

// @param command  which needs the field in one piece
LevelSet readWhole(const std::filesystem::path& path, const char* command) {
    if (std::filesystem::is_directory(path))
        throw std::runtime_error(fmt::format("{}: {} takes one file: join the tiles of a folder with bilayer merge",
                                             path.string(), command));
    return detail::readStored(path).levelSet;
}

void runSurface(const FieldArguments& a) {
    requireOther(a.output, a.field);
    const LevelSet field = readWhole(a.field, "surface");
    requireWritable(a.output);
    const Mesh mesh = surface(field, a.options);
    if (mesh.triangles.empty())
        throw std::runtime_error(fmt::format("{}: no surface at {}", a.field.string(), metres(a.options.isovalue)));
    writeMesh(a.output, mesh);
    Table table(a.output.string());
    table.row("points", grouped(mesh.points.size()));
    table.row("triangles", grouped(mesh.triangles.size()));
    table.print();
}

void runExport(const FieldArguments& a) {
    requireOther(a.output, a.field);
    const LevelSet field = readWhole(a.field, "export");
    requireWritable(a.output);
    writeNanoVdb(a.output, field);
    const std::uint64_t size = std::filesystem::file_size(a.output);
    std::vector<std::string> grids{field.grids().distance->getName()};
    if (field.grids().triangle) grids.push_back(field.grids().triangle->getName());
    if (a.json)
        return print({{"output", a.output.string()},
                      {"grids", grids},
                      {"voxelSize", number(field.voxelSize())},
                      {"activeVoxels", field.activeVoxels()},
                      {"leaves", field.leaves()},
                      {"fileBytes", size}});
    Table table(a.output.string());
    table.row("grids", fmt::format("{}", fmt::join(grids, ", ")));
    table.row("active voxels", grouped(field.activeVoxels()));
    table.row("file", bytes(size));
    table.print();
}

std::string requireNanoExtension(const std::string& path) {
    return std::filesystem::path(path).extension() == ".nvdb" ? "" : "must end in .nvdb";
}

std::string requireMeshExtension(const std::string& path) {
    const std::string extension = std::filesystem::path(path).extension().string();
    return extension == ".ply" || extension == ".obj" || extension == ".stl" ? "" : "must end in .ply, .obj or .stl";
}

}  // namespace

void addQuery(CLI::App& app) {
    auto* command = app.add_subcommand(
        "query",
        "Read points x y z from standard input, a line each; print distance, gradient and whether in the band");
    const auto a = std::make_shared<FieldArguments>();
    command->add_option("field", a->field, "a .vdb file, or a folder of tiles")->required();
    command->callback([a] { runQuery(*a); });
}

void addSurface(CLI::App& app) {
    auto* command = app.add_subcommand("surface", "Extract an isosurface as a mesh");
    const auto a = std::make_shared<FieldArguments>();
    command->add_option("field", a->field, "a .vdb file")->required();
    command->add_option("-o,--output", a->output, "a .ply, .obj or .stl file")
        ->required()
        ->check(CLI::Validator(requireMeshExtension, "PATH"));
    command->add_option("--isovalue", a->options.isovalue, "distance of the surface, default 0")->check(finite());
    command->add_option("--adaptivity", a->options.adaptivity, "0 (default): uniform .. 1: fewest triangles")
        ->check(within(0, 1));
    command->callback([a] { runSurface(*a); });
}

void addExport(CLI::App& app) {
    auto* command = app.add_subcommand("export", "Write a field as NanoVDB grids, for code on a GPU");
    const auto a = std::make_shared<FieldArguments>();
    command->add_option("field", a->field, "a .vdb file")->required();
    command->add_option("-o,--output", a->output, "a .nvdb file")
        ->required()
        ->check(CLI::Validator(requireNanoExtension, "PATH"));
    command->add_flag("--json", a->json, "print one JSON object");
    command->callback([a] { runExport(*a); });
}

}  // namespace bilayer::tools
