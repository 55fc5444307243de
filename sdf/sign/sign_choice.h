// SPDX-License-Identifier: Apache-2.0
// Selects the sign method for a mesh, and states the reason.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>
#include <bilayer/sdf/options.h>

namespace bilayer::detail {

class Progress;
struct UnionSurface;

/// Returns whether every edge is used equally often in both directions; vertices with equal coordinates count as one.
/// Always true for such a mesh. Wrongly true for another mesh with a probability of about 2^-63. O(n), on all threads,
/// 8 bytes per vertex. The mesh must be valid.
/// @param progress  polled for cancellation, unless null, here and below
bool balanced(const Mesh& mesh, Progress* progress = nullptr);

/// Returns whether the mesh contains some triangle twice with opposite orientations. O(n log n). The mesh must be
/// valid.
bool hasFacesBackToBack(const Mesh& mesh, Progress* progress = nullptr);

/// Returns whether two triangles with opposite normals coincide along a shared edge. This occurs at the rim of a
/// double-sided open surface, but not at the walls of a solid. O(n log n). The mesh must be valid.
bool foldsBack(const Mesh& mesh, Progress* progress = nullptr);

/// The sign method for a mesh.
struct SignChoice {
    Sign sign = Sign::normals;     ///< never `automatic`
    std::string reason;            ///< human-readable, without a full stop: "closed and oriented"
    std::optional<Mesh> repaired;  ///< the mesh to build from instead: the same triangles, some flipped
};

/// The reason if balanced() alone decided.
inline constexpr const char* closedAndOriented = "closed and oriented";
/// The reason if the user selected the method.
inline constexpr const char* asRequested = "as asked for";

/// Returns the reason for signs of a union. outwardMesh() recognizes from it that walls were removed.
std::string unionReason(const UnionSurface& united);

/// Returns the reason for signs by normals of which repairSigns() has corrected some.
std::string repairedReason(const std::string& reasonOfNormals, std::size_t voxels);

/// Selects the method for Sign::automatic. Checks balanced() first, which takes milliseconds; a balanced mesh gets
/// `normals` unchanged. Otherwise orients the mesh and selects:
/// - `normals` if the oriented mesh is closed;
/// - `winding` if winding numbers separate inside from outside on most of the surface;
/// - `flood` otherwise.
/// Throws as validate() does.
SignChoice chooseSign(const Mesh& mesh, Progress* progress = nullptr);

/// The same for a mesh that must be a solid. Also selects `flood` for a balanced mesh if much of it bounds no volume by
/// winding numbers, such as double-sided open surfaces. Never depends on voxel positions. Throws as validate() does.
SignChoice chooseSignOfSolid(const Mesh& mesh, Progress* progress = nullptr);

/// Selects the method for a balanced mesh whose normals contradict each other. Such a mesh is inside out, has every
/// face twice with opposite orientations, or self-intersects. The first two cases are repaired. Returns `normals` only
/// together with a repaired mesh. Throws as validate() does.
SignChoice chooseSignAfterConflict(const Mesh& mesh, Progress* progress = nullptr);

/// Returns the mesh of a level set as build() interpreted it: oriented outward. A mesh that needed no repair, or whose
/// normals were used unchanged, keeps its bytes. Throws std::invalid_argument as validate() does, and if the level set
/// belongs to another mesh.
Mesh orientedMesh(const LevelSet& levelSet, Mesh mesh);

/// Returns the surface to which a level set's distances refer, from orientedMesh(): without the walls that
/// BuildOptions::unite removed inside a union.
Mesh outerSurface(const LevelSet& levelSet, Mesh oriented);

/// Returns the outer surface of the oriented mesh. Throws as orientedMesh() does.
Mesh outwardMesh(const LevelSet& levelSet, Mesh mesh);

}  // namespace bilayer::detail
