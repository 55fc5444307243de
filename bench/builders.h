// SPDX-License-Identifier: Apache-2.0
// The builders and the meshes that the benchmarks compare: this project's and OpenVDB's builders, asked for the same
// field.
//
// Timings exclude reading the mesh and freeing the field.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <bilayer/sdf/build.h>

namespace bilayer::bench {

/// A mesh by name. `file` is empty for meshes made by formula.
struct Source {
    std::string name, file;
};

/// The folder of the corpus. The environment variable BILAYER_MESHES overrides the path known at compile time.
std::filesystem::path corpusFolder();

/// The files in a folder and its subfolders, relative to it and sorted, without its texts (.md).
std::vector<std::string> meshFiles(const std::filesystem::path& folder);

/// The available meshes of the comparison: those of the corpus that are present, and the carved box.
std::vector<Source> sources();

/// Finds a source by its name above, a mesh file, or "uneven sphere D": the sphere of the paper's Table 5, whose
/// triangle areas have the deviation D. Throws std::invalid_argument for anything else.
Source findSource(const std::string& nameOrFile);

/// Input of a build: a mesh and a voxel size.
struct Scene {
    std::string name;
    float resolution = 0;  ///< voxels along the longest side
    Mesh mesh;
    float voxelSize = 0;  ///< [m]
};

/// Reads or generates the mesh.
Scene scene(const Source& source, float resolution);
Scene scene(const std::string& name, Mesh mesh, float resolution);

enum class Builder {
    reference,  ///< openvdb::tools::meshToVolume with flag 0x4, DISABLE_RENORMALIZATION: its exact distances
    defaults,   ///< openvdb::tools::meshToVolume without flags
    pseudonormal,
    exact,
    doubleLayer,
    exactOpencl,
    doubleLayerOpencl,
    prism,  ///< on OpenCL only
};

/// All builders, in the order of the tables.
const std::vector<Builder>& builders();

/// "meshToVolume-0x4", "meshToVolume", "pseudonormal", "exact", "double-layer", "exact-opencl", "double-layer-opencl",
/// "prism".
const char* nameOf(Builder builder);
/// Throws std::invalid_argument for an unknown name.
Builder builderNamed(const std::string& name);

/// Parameters of a build.
struct Job {
    Builder builder = Builder::exact;
    float halfWidth = 3;  ///< on both sides [voxels]
    int threads = 2;
    const BlockFiller* filler = nullptr;  ///< for the builders on OpenCL; null: the first device
};

/// Cost and result of a build.
struct Outcome {
    double seconds = 0;  ///< from mesh in memory to grid in memory
    std::uint64_t activeVoxels = 0;
    std::uint64_t bytes = 0;  ///< of the grid
};

/// Builds once. Rethrows exceptions of the builder.
Outcome run(const Scene& scene, const Job& job);

/// Builds once and returns the field. Rethrows exceptions of the builder. Throws std::invalid_argument for OpenVDB's
/// builders.
LevelSet fieldOf(const Scene& scene, const Job& job);

}  // namespace bilayer::bench
