// SPDX-License-Identifier: Apache-2.0
// The options of a build on the command line, and the steps of a build, for the commands that build fields.
// Tested by tests/tools/build.cpp through the program.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/sdf/inspect.h>
#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>
#include <bilayer/sdf/mesh_io.h>
#include <bilayer/sdf/options.h>
#include <bilayer/sdf/vdb_io.h>
#include "sdf/base/method_names.h"
#include "tools/output.h"

namespace bilayer::tools {

/// The options of a build, as its command line gives them.
struct BuildArguments {
    std::filesystem::path mesh, output;
    BuildOptions options;
    float resolution = 0;
    float halfWidth = 3, exteriorWidth = 3, interiorWidth = 3;  // [bandUnit]
    std::string bandUnit = "voxels", method = detail::nameOf(BuildOptions().method), backend = "tbb",
                sign = detail::nameOf(BuildOptions().sign), device, mapping = "auto",
                contacts = nameOf(ColliderOptions().accuracy);
    std::uint64_t deviceMemory = 0;
    VdbOptions stored;
    ColliderOptions collider;
    bool extend = false, body = false, noMesh = false, report = false, json = false;
    CLI::Option *resolutionGiven = nullptr, *halfGiven = nullptr, *exteriorGiven = nullptr, *interiorGiven = nullptr;
    CLI::Option* gapGiven = nullptr;
    std::vector<CLI::Option*> bodyOptions;
    CLI::Option *deviceGiven = nullptr, *memoryGiven = nullptr, *mappingGiven = nullptr;
    std::vector<CLI::Option*> layerOptions;  // options that only the double layer method supports

    bool isBandInWorldUnits() const { return bandUnit == "world"; }
};

/// What a build did, and how long its parts took [s].
struct BuildOutcome {
    ReadReport file;
    bool balanced = false;
    std::optional<MeshReport> report;
    std::string device;
    BuildTimes times;
    bool hasInside = true;  // whether any voxel is inside
    double read = 0, inspect = 0, build = 0, extend = 0, body = 0, write = 0;
};

/// Adds all options that determine a field. Returns the group of --voxel-size and --resolution, at most one of which
/// may be given; the caller states whether one must be.
CLI::Option_group* addBuildOptions(CLI::App& command, BuildArguments& arguments);

/// Checks the options against each other, and stores the methods that they name. Call this after parsing.
/// Throws CLI::ValidationError.
void checkBuildOptions(BuildArguments& arguments);

/// Sets what depends on the mesh: the voxel size of a resolution, and the widths in voxels. Throws CLI::ValidationError
/// for a width out of range, and as voxelSizeFor() does.
void setSizes(BuildArguments& arguments, const Mesh& mesh);
/// The same with the voxel size that a resolution gives.
void setSizes(BuildArguments& arguments, float voxelSize);

/// Builds a field with all that the options request. The arguments then refer to the outcome's report.
/// Throws as build(), fluid::extend() and withBody() do.
LevelSet buildField(BuildArguments& arguments, const Mesh& mesh, BuildOutcome& outcome);

/// What `bilayer build --json` prints.
Json toJson(const BuildArguments& arguments, const BuildOutcome& outcome, const Mesh& mesh, const LevelSet& field);

}  // namespace bilayer::tools
