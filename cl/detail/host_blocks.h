// SPDX-License-Identifier: Apache-2.0
// Blocks that a device leaves to the host.
// Tested by tests/cl/filler.cpp.
#pragma once

#include <glm/vec3.hpp>
#include <vector>

#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// Fills blocks on the host by Method::exact: those whose inside/outside classification is not decided by nearby
/// triangles. The host uses the whole mesh.
/// @param blocks  index coordinates of the first voxel of each block, in any order
void fillOnHost(const FillJob& job, std::vector<glm::ivec3> blocks);

}  // namespace bilayer::detail
