// SPDX-License-Identifier: Apache-2.0
// Bins triangles into bricks of space, the coarse first step of the exact and the double layer method. Bins hold only
// indices, so their memory is a fraction of the mesh's.
// Tested by tests/sdf/exact.cpp through build().
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/base/triangle_corners.h"

namespace bilayer::detail {

class Progress;

/// The bricks that triangles reach, each with its triangles in ascending order.
struct TriangleBins {
    int side = 0;                          ///< of a brick [voxels], a power of two, at least 32
    std::vector<glm::ivec3> origins;       ///< index coordinates of each brick's first voxel, multiples of `side`
    std::vector<std::uint64_t> offsets;    ///< triangles of brick b: triangles[offsets[b]] .. triangles[offsets[b + 1]]
    std::vector<std::uint32_t> triangles;  ///< indices into Mesh::triangles

    std::size_t count() const { return origins.size(); }
    std::span<const std::uint32_t> trianglesOf(std::size_t brick) const {
        return {triangles.data() + offsets[brick], triangles.data() + offsets[brick + 1]};
    }
};

/// Runs of triangles are binned with counters of their own, one per brick. Max counters over all runs: 16 MiB.
inline constexpr std::size_t maxBinCounters = 1 << 22;
/// Triangles of a run, the work of one task.
inline constexpr std::size_t trianglesPerRun = 8192;

/// Bins triangles into bricks. A brick may contain triangles that reach none of its voxels. Throws Cancelled.
/// @param box       bounds of the mesh
/// @param reach     maximum distance of a voxel from a triangle that affects it [voxels]
/// @param progress  polled for cancellation, unless null
TriangleBins binTriangles(const Mesh& mesh, const Bounds& box, double voxelsPerUnit, float reach,
                          Progress* progress = nullptr);

/// Calls visit(triangle, corners) for the triangles of a brick, with their corners in voxels. Prefetches the next
/// triangles, since they are scattered in memory.
template <class Visit>
void forEachTriangle(const Mesh& mesh, std::span<const std::uint32_t> triangles, double voxelsPerUnit, Visit visit) {
    // Prefetch distances match the memory latency: first the indices, then the corners.
    constexpr std::size_t indicesAhead = 16, cornersAhead = 8;
    for (std::size_t i = 0; i < triangles.size(); ++i) {
        if (i + indicesAhead < triangles.size()) __builtin_prefetch(&mesh.triangles[triangles[i + indicesAhead]]);
        if (i + cornersAhead < triangles.size()) {
            const glm::uvec3& ahead = mesh.triangles[triangles[i + cornersAhead]];
            for (int k = 0; k < 3; ++k) __builtin_prefetch(&mesh.points[ahead[k]]);
        }
        const glm::uvec3& t = mesh.triangles[triangles[i]];
        const auto corner = [&](unsigned k) { return glm::dvec3(mesh.points[k]) * voxelsPerUnit; };
        visit(triangles[i], TriangleCorners{corner(t.x), corner(t.y), corner(t.z)});
    }
}

/// Returns the brick side that binTriangles() would choose [voxels].
int brickSideFor(const Bounds& box, double voxelsPerUnit, float reach);

}  // namespace bilayer::detail
