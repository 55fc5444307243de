// SPDX-License-Identifier: Apache-2.0
// What follows from the options of a build alone: whether they are valid, the reach of distances, the error bound.
// Tested by tests/sdf/build.cpp through build().
#pragma once

#include <string>

#include <bilayer/sdf/options.h>
#include "sdf/leaf/band.h"
#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// Maximum width of the band on either side [voxels].
inline constexpr float maxWidthVoxels = 1000;

/// Throws std::invalid_argument for voxels that fields may not have; the text names the option and the scale that
/// helps.
void checkVoxelSize(double voxelSize, const char* option = "voxelSize");

/// Throws std::invalid_argument that names an option out of range.
void checkOptions(const BuildOptions& options);

/// Returns whether a method finds signs itself, without a sign method.
bool hasOwnSigns(Method method);

BandWidths bandOf(const BuildOptions& options);

/// Returns the error text for a field without a voxel in its band.
std::string noVoxelInBand(const BuildOptions& options);

/// Returns whether two neighbouring voxels on opposite sides of the surface are both in the band. This holds for a band
/// wider than one voxel.
bool enclosesSurface(const BuildOptions& options);

/// Returns the distance up to which a sign method needs distances [voxels].
float reachOf(const BuildOptions& options, Sign sign);

/// Returns the parameters of the double layer method.
FillParameters fillParameters(const BuildOptions& options);

/// Returns the distance up to which a triangle affects voxels in the double layer method [voxels].
float layerReach(const FillParameters& parameters);

/// Returns the maximum error of distances [voxels].
float errorBound(const BuildOptions& options);

}  // namespace bilayer::detail
