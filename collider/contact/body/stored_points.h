// SPDX-License-Identifier: Apache-2.0
// Storage of a body's surface points as a grid of OpenVDB points.
// Tested by tests/collider/body.cpp through withBody().
#pragma once

#include <bilayer/sdf/level_set.h>
#include <openvdb/Grid.h>

#include "collider/contact/body/surface_points.h"

namespace bilayer::detail {

/// The grid of the points.
/// @param voxelSize  of the field [m]
openvdb::GridBase::ConstPtr storePoints(const SurfacePoints& points, float voxelSize);

/// The points stored with a level set; the same bits. Throws std::invalid_argument if there are none, or if the grid is
/// damaged.
SurfacePoints loadPoints(const LevelSet& levelSet);

}  // namespace bilayer::detail
