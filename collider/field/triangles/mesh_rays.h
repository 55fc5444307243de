// SPDX-License-Identifier: Apache-2.0
// Ray casts against the triangles of a mesh. SIMD tests in single precision reject triangles conservatively; double
// precision and the mesh's own vertices decide (triangle_tests.h). Lengths in metres. May run on any number of threads
// at once, and allocates nothing.
#pragma once

#include <optional>

#include "collider/field/layout/path.h"
#include "collider/field/triangles/mesh_tree.h"

namespace bilayer::detail {

/// The hit of a path on a mesh.
struct MeshHit {
    double along;         ///< distance along the path
    glm::dvec3 position;  ///< on the triangle
    std::uint32_t triangle;
};

/// The first triangle hit by a path, from either side. The test is watertight: triangles are hit by paths that pass
/// them within 1e-5 voxels. Triangles seen edge-on are left to their neighbours.
std::optional<MeshHit> firstHit(const MeshTree& mesh, const Path& path) noexcept;

}  // namespace bilayer::detail
