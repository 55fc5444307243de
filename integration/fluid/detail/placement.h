// SPDX-License-Identifier: Apache-2.0
// The check of a body's placement.
// Tested by tests/fluid/seed.cpp.
#pragma once

#include <bilayer/integration/fluid/seed.h>

namespace bilayer::fluid::detail {

/// Throws std::invalid_argument if a number is not finite, the rotation is not of unit length, or a scale is not
/// positive.
void checkPlacement(const Placement& placement);

}  // namespace bilayer::fluid::detail
