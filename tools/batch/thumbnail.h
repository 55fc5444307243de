// SPDX-License-Identifier: Apache-2.0
// Small pictures of meshes.
// Tested by tests/tools/batch_report.cpp through the program.
#pragma once

#include <bilayer/sdf/mesh.h>
#include "tools/batch/png.h"

namespace bilayer::tools {

/// Width and height of a thumbnail [pixels].
inline constexpr int thumbnailSize = 96;

/// Draws a mesh from above a corner of its box, in parallel projection, z upwards. Brightness shows how a triangle
/// faces the viewer, and how near it is. The mesh must be valid.
GreyImage thumbnailOf(const Mesh& mesh);

}  // namespace bilayer::tools
