// Rays, spheres on their way, and boxes against the triangles of a mesh. SIMD and single precision rule triangles out,
// with room for all rounding; double precision and the mesh's own corners decide (triangle_tests.h). Lengths in metres.
// All may run on any number of threads at once, and allocate nothing.
#pragma once

#include <optional>

#include "collider/field/mesh_tree.h"
#include "collider/field/path.h"
#include "collider/field/triangle_tests.h"

namespace bilayer::detail {

/// Where a path meets a mesh.
struct MeshHit {
    double along;         ///< the path
    glm::dvec3 position;  ///< on the triangle
    std::uint32_t triangle;
};

/// The first triangle that a path meets, from either side. Nothing slips through: triangles take what passes no farther
/// than 1e-5 voxels beside them. Triangles that are seen edge-on are left to their neighbours.
std::optional<MeshHit> firstHit(const MeshTree& mesh, const Path& path) noexcept;

/// The first place of a path from which a triangle is no farther than the radius, to 1e-7 voxels. Made for paths of a
/// few voxels: it looks at all triangles that come near, the more the longer the path.
std::optional<MeshHit> firstTouch(const MeshTree& mesh, const Path& path, double radius) noexcept;

/// Whether a box and a triangle have a point in common.
bool meetsTriangle(const MeshTree& mesh, const TurnedBox& box) noexcept;

}  // namespace bilayer::detail
