// SPDX-License-Identifier: Apache-2.0
// The distances of a field's coarse cells to the surface, for Clearance.
// Tested by tests/collider/field.cpp through Field::sample().
#pragma once

#include <glm/vec3.hpp>
#include <span>

#include "collider/field/layout/field_layout.h"

namespace bilayer::detail {

/// Computes FieldLayout::centres: lower bounds of the distances outside the band. The directory and the minima must be
/// filled.
/// @param first    the first voxel of the directory
/// @param surface  blocks of the field and of its surroundings
/// @param margin   width of the surroundings that are considered [blocks]
void measureClearances(FieldLayout& field, const glm::ivec3& first, std::span<const SurfaceBlock> surface, int margin);

}  // namespace bilayer::detail
