// What fills blocks on the processor or on a device, and what it gives back. The processor's are in exact.h,
// pseudonormal.h and double_layer.h, OpenCL's is in cl/filler.h.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <span>
#include <string>

#include <bilayer/sdf/build.h>

namespace bilayer::detail {

class Progress;

inline constexpr int blockSide = 8;                                    ///< voxels: an OpenVDB leaf
inline constexpr int blockVoxels = blockSide * blockSide * blockSide;  ///< voxel (x, y, z) at (x * 8 + y) * 8 + z

/// The constants of a fill, in voxels, the same for every device.
struct FillParameters {
    float delta;     ///< distance of each layer from the surface
    float reach;     ///< a sample counts for voxels nearer to it than this
    float certain;   ///< a voxel is known if the nearer of its two layers is nearer than this
    int cube;        ///< 0, or K where the paper's cube of (2K + 1)^3 voxels replaces the ball of radius `reach`
    bool triangles;  ///< whether the nearest triangle is asked for
};

/// Blocks that a filler hands over. Distances are signed, in voxels, by Eq. 3 of the paper; +infinity where unknown.
struct FilledBlocks {
    std::span<const glm::ivec3> origins;      ///< index coordinates of each block's first voxel
    std::span<const float> distances;         ///< blockVoxels a block
    std::span<const std::int32_t> triangles;  ///< blockVoxels a block; empty unless asked for
};

/// Where the squared distances to both layers differ by less than this they are equal, whatever a device's rounding,
/// and the voxel is inside [voxels^2].
inline constexpr float layerTie = 1e-5f;

/// Stands for every distance beyond the reach of a job; its sign is right where signs are asked for [voxels].
inline constexpr float farAway = 1e30f;

/// What all methods work from.
struct MeshJob {
    const Mesh& mesh;
    float voxelSize;  ///< [m]
    float reach;      ///< distances up to this must be found; beyond it they may be +-farAway [voxels], at least 1
    bool triangles;   ///< whether the nearest triangle is asked for
    bool sign;        ///< false: all distances are positive
    /// Takes filled blocks; may be called from several threads at once. Blocks without a voxel within the reach need
    /// not come.
    std::function<void(const FilledBlocks&)> sink;
    Progress& progress;
    /// Whether any block is wanted of a cube of voxels with this first voxel and side; null: all are.
    std::function<bool(const glm::ivec3& first, int side)> wanted{};
    /// Counts the voxels whose side the triangles within reach leave open, so that all of the mesh was asked; or null.
    std::atomic<std::size_t>* undecided = nullptr;
    /// Counts the voxels that normals say are on both sides of the surface; or null.
    std::atomic<std::size_t>* conflicts = nullptr;
};

/// Everything that a device works from.
struct FillJob {
    const MeshJob& mesh;
    const BuildOptions& options;
    const Bounds& box;      ///< of the mesh
    FillParameters layers;  ///< of the double layer method
};

/// Has a filler fill the blocks of a mesh's field as build() has, but makes no level set of them: the filler keeps what
/// it fills. It is called again, for another way to signs, where it counts conflicts. Throws as build() does.
void fillOnly(const Mesh& mesh, const BuildOptions& options, const BlockFiller& filler);

}  // namespace bilayer::detail
