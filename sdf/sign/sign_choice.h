// Which way of finding signs suits a mesh, and why.
#pragma once

#include <optional>
#include <string>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

class Progress;
struct UnionSurface;

/// Whether every edge is run equally often both ways, where vertices count as one if their coordinates are equal. Never
/// false for a mesh that is; true for one that is not with a probability of about 2^-63. O(n), on all threads, and
/// 8 bytes a vertex. The mesh must be valid.
/// @param progress  polled, unless null, here and below
bool balanced(const Mesh& mesh, Progress* progress = nullptr);

/// Whether some triangle is there twice, the two facing opposite ways. O(n log n). The mesh must be valid.
bool hasFacesBackToBack(const Mesh& mesh, Progress* progress = nullptr);

/// Whether two triangles lie on each other along an edge of theirs, facing opposite ways: as a sheet and its back do at
/// the sheet's rim, and the walls of a solid do not. O(n log n). The mesh must be valid.
bool foldsBack(const Mesh& mesh, Progress* progress = nullptr);

/// How signs are to be found.
struct SignChoice {
    Sign sign = Sign::normals;     ///< never `automatic`
    std::string reason;            ///< for people, without a full stop: "closed and oriented"
    std::optional<Mesh> repaired;  ///< the mesh to build from instead: the same triangles, some turned around
};

/// The reason of a choice that took no more than balanced().
inline constexpr const char* closedAndOriented = "closed and oriented";
/// The reason of a way that the user chose.
inline constexpr const char* asAskedFor = "as asked for";

/// The reason of signs of a union, by which outwardMesh() knows that walls were taken away.
std::string unionReason(const UnionSurface& united);

/// What Sign::automatic picks. `normals` as they stand for a balanced mesh, which is all that it asks first and takes
/// milliseconds; else the mesh is oriented: `normals` if that closes it, `winding` if winding numbers tell the two
/// sides of most of the surface apart, `flood` where they do not. Throws as validate() does.
SignChoice chooseSign(const Mesh& mesh, Progress* progress = nullptr);

/// The same where a solid is needed: `flood` also for a balanced mesh of which much bounds nothing by winding numbers,
/// such as double sheets. Never depends on where voxels lie. Throws as validate() does.
SignChoice chooseSignOfSolid(const Mesh& mesh, Progress* progress = nullptr);

/// What to do where the normals of a balanced mesh contradict each other: it is inside out or has every face twice,
/// back to back (then it is repaired), or intersects itself. Returns `normals` only together with a repaired mesh.
/// Throws as validate() does.
SignChoice chooseSignAfterConflict(const Mesh& mesh, Progress* progress = nullptr);

/// The mesh of a level set as build() understood it: all of it facing outward, without the walls inside of a union that
/// BuildOptions::unite has taken away. One that needed no repairing keeps its bytes, and one whose normals were taken
/// as they stand keeps them. Throws std::invalid_argument as validate() does, and if the level set is of another mesh.
Mesh outwardMesh(const LevelSet& levelSet, Mesh mesh);

}  // namespace bilayer::detail
