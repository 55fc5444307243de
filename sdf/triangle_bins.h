// Which triangles reach which brick of space: the first, coarse step of the exact method. Bins hold indices only, so
// that memory stays a fraction of the mesh's own.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "sdf/mesh.h"

namespace bilayer {

class Progress;

/// The bricks that some triangle reaches, each with its triangles in ascending order.
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

/// Bins triangles into bricks. `reach` is how far from a triangle a voxel may lie [voxels]. A brick may hold triangles
/// that reach none of its voxels. Throws Cancelled.
/// @param progress  polled, unless null
TriangleBins binTriangles(const Mesh& mesh, double voxelsPerUnit, float reach, Progress* progress = nullptr);

/// The side of the bricks that binTriangles() would make [voxels].
int brickSideFor(const Mesh& mesh, double voxelsPerUnit, float reach);

}  // namespace bilayer
