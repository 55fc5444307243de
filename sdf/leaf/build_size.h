// SPDX-License-Identifier: Apache-2.0
// The size of a build, estimated before any allocation.
// Tested by tests/sdf/build.cpp through build().
#pragma once

#include <bilayer/sdf/mesh.h>
#include <bilayer/sdf/options.h>

namespace bilayer::detail {

/// Limit of index coordinates: well within 32 bits, with room for the band [voxels].
inline constexpr double maxIndexCoordinate = 1e9;

/// Bounds and area of a mesh.
struct MeshExtent {
    Bounds box;
    double area = 0;  ///< [m^2]
};

MeshExtent extentOf(const Mesh& mesh);

/// Returns about how many blocks the band of a surface meets.
/// @param area   [voxels^2]
/// @param reach  distance up to which distances are computed [voxels]
double blocksAround(double area, double reach);

/// Returns about how much memory a build needs in addition to the mesh [bytes].
/// @param extent  of the mesh
/// @param reach   distance up to which distances are computed [voxels]
double estimatedBytes(const Mesh& mesh, const MeshExtent& extent, const BuildOptions& options, float reach);

/// Throws std::invalid_argument for a build that cannot succeed: its coordinates would leave 32 bits, or its memory
/// would exceed what may be used. The parameters are those of estimatedBytes().
void checkSize(const Mesh& mesh, const MeshExtent& extent, const BuildOptions& options, float reach);

}  // namespace bilayer::detail
