// SPDX-License-Identifier: Apache-2.0
// The surface of an OpenVDB level set as a mesh.
#pragma once

#include <openvdb/openvdb.h>

#include <bilayer/sdf/mesh.h>

namespace bilayer::demo {

/// Extracts the surface as surface() in sdf/surface.h does. Returns an empty mesh for an empty level set.
Mesh surfaceOf(const openvdb::FloatGrid& grid, float adaptivity = 0);

}  // namespace bilayer::demo
