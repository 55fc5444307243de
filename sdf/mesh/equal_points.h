// SPDX-License-Identifier: Apache-2.0
// Finds vertices of a mesh with equal coordinates.
// Tested by tests/sdf/mesh.cpp.
#pragma once

#include <glm/vec3.hpp>
#include <span>

#include "sdf/base/large_array.h"

namespace bilayer::detail {

class Progress;

/// For each point, returns the index of the first point with equal coordinates, often its own. Returns an empty array
/// if no two points are equal. 0 and -0 are equal, and so are NaNs with the same bits. Takes O(n) on all threads; the
/// result does not depend on their count. Accepts at most 2^32 - 1 points.
/// @param progress  polled, unless null. Throws Cancelled.
LargeArray<unsigned> firstOfEqual(std::span<const glm::vec3> points, Progress* progress = nullptr);

}  // namespace bilayer::detail
