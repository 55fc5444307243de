// SPDX-License-Identifier: Apache-2.0
// The distances of a field's coarse cells to the surface, for Clearance.
// Tested by tests/collider/field.cpp.
#pragma once

#include <array>
#include <span>

#include "collider/field/field_layout.h"

namespace bilayer::detail {

/// Computes FieldLayout::centres: lower bounds of the distances outside the band. The directory and the minima must be
/// filled.
/// @param meets  by stored block, whether the surface may meet each of its coarse cells
void measureClearances(FieldLayout& field, std::span<const std::array<bool, Clearance::blockParts>> meets);

}  // namespace bilayer::detail
