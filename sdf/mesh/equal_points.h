// Which vertices of a mesh stand at the same place.
#pragma once

#include <glm/vec3.hpp>
#include <span>

#include "sdf/base/large_array.h"

namespace bilayer::detail {

class Progress;

/// For each point, the first one with equal coordinates, often itself; empty where no two are equal. 0 and -0 are
/// equal, and so are NaNs of the same bits. O(n), on all threads; the same for any number of them. At most 2^32 - 1
/// points.
/// @param progress  polled, unless null. Throws Cancelled.
LargeArray<unsigned> firstOfEqual(std::span<const glm::vec3> points, Progress* progress = nullptr);

}  // namespace bilayer::detail
