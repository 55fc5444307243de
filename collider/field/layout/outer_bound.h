// SPDX-License-Identifier: Apache-2.0
// Points outside a field's box: lower bounds of their distances to the surface, and nearer points for far ones.
// Tested by tests/collider/field.cpp through Field::sample().
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>

#include "collider/field/layout/field_layout.h"
#include "collider/field/layout/interpolant.h"
#include "collider/field/layout/path.h"

namespace bilayer::detail {

/// Bounds are rounded down, against the single-precision rounding of the voxel size and of the bound itself.
inline constexpr double downward = 1 - 0x1p-22;

/// The bound for a point outside the directory's box: its distance to the box, and from there at least the exterior
/// width less a cell's diagonal. +infinity for a non-finite point.
/// @param local  from the directory's first voxel [voxels]
inline float boundOutside(const FieldFrame& field, const glm::dvec3& local) {
    const double away = glm::distance(local, glm::clamp(local, glm::dvec3(0), field.extent()));
    if (!std::isfinite(away)) return std::numeric_limits<float>::infinity();
    const double bound = (away - double(cellDiagonal)) * double(field.voxelSize) + double(field.exteriorWidth);
    return float(std::clamp(downward * bound, 0., double(std::numeric_limits<float>::max())));
}

/// Replaces a far point: its distance to the zeros equals that from the replacement, to a millionth of the field's
/// size.
/// @param local  from the directory's first voxel [voxels]
inline glm::dvec3 approachedPoint(const FieldFrame& field, const glm::dvec3& local) {
    constexpr double sizes = 1e6;
    return approached(local, glm::dvec3(0), field.extent(), sizes, sizes);
}

}  // namespace bilayer::detail
