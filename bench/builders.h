// The builders and the meshes that the benchmarks compare: ours and OpenVDB's, each asked for the same field.
//
// Reading a mesh is never timed. Neither is freeing a field.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <bilayer/sdf/build.h>

namespace bilayer::bench {

/// A mesh by name. `file` is empty where it is made by formula.
struct Source {
    std::string name, file;
};

/// Where the corpus lies; the environment variable BILAYER_MESHES names it where that is not where it was at compile
/// time.
std::filesystem::path corpusFolder();

/// The meshes of the comparison that are here: of the corpus those present, and the carved box.
std::vector<Source> sources();

/// A source by its name above, a mesh file, or "uneven sphere D": the sphere of the paper's Table 5, whose triangles'
/// areas deviate by D. Throws std::invalid_argument for none of them.
Source findSource(const std::string& nameOrFile);

/// What is built: a mesh at a voxel size.
struct Scene {
    std::string name;
    float resolution = 0;  ///< voxels along the longest side
    Mesh mesh;
    float voxelSize = 0;  ///< [m]
};

/// Reads or makes the mesh.
Scene scene(const Source& source, float resolution);
Scene scene(const std::string& name, Mesh mesh, float resolution);

enum class Builder {
    reference,  ///< openvdb::tools::meshToVolume with flag 0x4, DISABLE_RENORMALIZATION: its exact distances
    defaults,   ///< openvdb::tools::meshToVolume as it is called without flags
    pseudonormal,
    exact,
    doubleLayer,
    exactOpencl,
    doubleLayerOpencl,
    prism,  ///< on OpenCL only
};

/// Every builder, in the order of the tables.
const std::vector<Builder>& builders();

/// "meshToVolume-0x4", "meshToVolume", "pseudonormal", "exact", "double-layer", "exact-opencl", "double-layer-opencl",
/// "prism".
const char* nameOf(Builder builder);
/// Throws std::invalid_argument for an unknown name.
Builder builderNamed(const std::string& name);

/// How a scene is built.
struct Job {
    Builder builder = Builder::exact;
    float halfWidth = 3;  ///< on both sides [voxels]
    int threads = 2;
    const BlockFiller* filler = nullptr;  ///< of the builders on OpenCL; null: the first device
};

/// What a build took and gave.
struct Outcome {
    double seconds = 0;  ///< mesh in memory to grid in memory
    std::uint64_t activeVoxels = 0;
    std::uint64_t bytes = 0;  ///< of the grid
};

/// Builds once. Throws what the builder throws.
Outcome run(const Scene& scene, const Job& job);

/// Builds once and gives the field. Throws what the builder throws, and std::invalid_argument for OpenVDB's builders.
LevelSet fieldOf(const Scene& scene, const Job& job);

}  // namespace bilayer::bench
