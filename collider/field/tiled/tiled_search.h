// SPDX-License-Identifier: Apache-2.0
// Searches of the zero set over the tiles of a field. Lengths in voxels, places from the field's first voxel.
// Tested by tests/tools/tiled_field.cpp through TiledField.
#pragma once

#include <glm/vec3.hpp>
#include <optional>

#include "collider/field/layout/path.h"
#include "collider/field/tiled/tiled_field_data.h"
#include "collider/field/zero/zero_answers.h"

namespace bilayer::detail {

/// The nearest point of the zero set within a radius, as nearestZero().
std::optional<ZeroPoint> nearestZero(const TiledFieldData& field, const glm::dvec3& point, double reach);

/// The first place of a path in the field's box with a negative interpolant, as firstInside().
std::optional<ZeroPoint> firstInside(const TiledFieldData& field, const Path& path);

}  // namespace bilayer::detail
