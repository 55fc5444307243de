// SPDX-License-Identifier: Apache-2.0
// The interface between a build and the code that fills its blocks. The CPU implementations are in exact.h,
// pseudonormal.h and double_layer.h, the OpenCL implementation is in cl/filler.h.
// Tested by tests/sdf/build.cpp.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <glm/common.hpp>
#include <glm/vec3.hpp>
#include <glm/vector_relational.hpp>
#include <span>
#include <string>

#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>
#include <bilayer/sdf/options.h>

namespace bilayer::detail {

class Progress;

/// A box of voxels, from `first` up to `end` without it [index coordinates]. Its sides are multiples of blockSide.
struct BlockBox {
    glm::ivec3 first, end;

    bool contains(const glm::ivec3& voxel) const {
        return !glm::any(glm::lessThan(voxel, first)) && glm::all(glm::lessThan(voxel, end));
    }
    /// Returns whether the box holds any voxel of a cube.
    bool overlaps(const glm::ivec3& lower, int side) const {
        return glm::all(glm::lessThan(lower, end)) && glm::all(glm::greaterThan(lower + side, first));
    }
    BlockBox within(const BlockBox& other) const { return {glm::max(first, other.first), glm::min(end, other.end)}; }
};

/// Beyond all index coordinates: a box that ends here has no neighbour there.
inline constexpr int unbounded = 1 << 30;

inline constexpr int blockSide = 8;                                    ///< [voxels], as an OpenVDB leaf
inline constexpr int blockVoxels = blockSide * blockSide * blockSide;  ///< voxel (x, y, z) at (x * 8 + y) * 8 + z

/// Parameters of a fill, in voxels, the same on every device.
struct FillParameters {
    float delta;     ///< distance of each layer from the surface
    float reach;     ///< a sample affects voxels closer than this
    float certain;   ///< a distance is known if the nearer of the two layers is closer than this
    int cube;        ///< 0, or K where the paper's cube of (2K + 1)^3 voxels replaces the ball of radius `reach`
    bool triangles;  ///< whether the nearest triangle is requested
};

/// A batch of filled blocks. Distances are in voxels. The double layer method signs them by Eq. 3 of the paper, and
/// stores +infinity where they are unknown. The exact methods sign them by the mesh, and store +-farAway beyond the
/// reach. Without MeshJob::sign, as for winding numbers and a flood, all are positive.
struct FilledBlocks {
    std::span<const glm::ivec3> origins;      ///< index coordinates of each block's first voxel
    std::span<const float> distances;         ///< blockVoxels per block
    std::span<const std::int32_t> triangles;  ///< blockVoxels per block; empty unless requested
};

/// Tolerance for equal squared distances to the two layers [voxels^2]. It exceeds the rounding of every device. A voxel
/// with equal distances is inside.
inline constexpr float layerTie = 1e-5f;

/// Represents any distance beyond the reach of a job [voxels]. Its sign is valid if signs are requested.
inline constexpr float farAway = 1e30f;

/// The input of every method.
struct MeshJob {
    const Mesh& mesh;
    float voxelSize;  ///< [m]
    float reach;      ///< distances up to this must be found, larger ones may be +-farAway [voxels]; at least 1
    bool triangles;   ///< whether the nearest triangle is requested
    bool sign;        ///< false: all distances are positive
    /// Receives filled blocks, possibly from several threads at once. Blocks without a voxel within reach may be
    /// omitted.
    std::function<void(const FilledBlocks&)> sink;
    Progress& progress;
    /// Returns whether any block in a cube of voxels with this first voxel and side is needed; null: all are.
    std::function<bool(const glm::ivec3& first, int side)> wanted{};
    /// Counts voxels that nearby triangles leave undecided, so that the whole mesh was queried, or that are equally
    /// near to both layers; or null.
    std::atomic<std::size_t>* undecided = nullptr;
    /// Counts voxels that the normals place on both sides of the surface; or null.
    std::atomic<std::size_t>* conflicts = nullptr;
    /// The triangles are some of a larger mesh's. What all of its triangles must decide is refused.
    bool isPart = false;
};

/// The input of a device.
struct FillJob {
    const MeshJob& input;
    const BuildOptions& options;
    const Bounds& box;      ///< of the mesh
    FillParameters layers;  ///< of the double layer method
};

/// What a BlockFiller holds.
struct DeviceFiller {
    std::string backend;  ///< "opencl"
    std::string device;   ///< the device's name
    /// Fills the blocks of one job, and returns what that took. A build passes on any exception that it throws.
    std::function<DeviceTimes(const FillJob&)> fill;
};

}  // namespace bilayer::detail
