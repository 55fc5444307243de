// The size of a build, estimated before any allocation.
// Tested by tests/sdf/build.cpp.
#pragma once

#include <bilayer/sdf/mesh.h>
#include <bilayer/sdf/options.h>

namespace bilayer::detail {

/// Limit of index coordinates: well within 32 bits, with room for the band [voxels].
inline constexpr double farthestIndex = 1e9;

/// Bounds and area of a mesh.
struct MeshExtent {
    Bounds box;
    double area = 0;  ///< [m^2]
};

MeshExtent extentOf(const Mesh& mesh);

/// Throws std::invalid_argument for a build that cannot succeed: its coordinates would leave 32 bits, or its memory
/// would exceed the machine's.
/// @param extent  of the mesh
/// @param reach   distance up to which distances are computed [voxels]
void checkSize(const Mesh& mesh, const MeshExtent& extent, const BuildOptions& options, float reach);

}  // namespace bilayer::detail
