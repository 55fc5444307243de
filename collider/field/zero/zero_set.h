// SPDX-License-Identifier: Apache-2.0
// The surface of a field without a mesh: the zero set of the trilinear interpolant. Lengths in voxels, places from the
// directory's first voxel. A cell whose eight values have one sign contains no surface. A cell with both signs has
// surface on its edges. Both hold for sub-cells too, so results are certain up to the size of the smallest sub-cells.
// All functions may run on any number of threads at once, and allocate nothing. Paths are cast in zero_rays.cpp.
// Tested by tests/collider/zero_set.cpp through closest().
#pragma once

#include <glm/vec3.hpp>
#include <optional>

#include "collider/field/layout/path.h"
#include "collider/field/samples/field_data.h"
#include "collider/field/triangles/triangle_tests.h"

namespace bilayer::detail {

/// Max error of nearest and first points of the zero set, in distance or along the path.
inline constexpr double zeroTolerance = 1e-3;

/// The first place of a path with a negative interpolant, to 1e-9, for chords of any length.
std::optional<double> firstInside(const FieldData& field, const Path& path) noexcept;

/// The outward unit normal at a point of the zero set; zero where the interpolant is flat.
glm::dvec3 zeroNormal(const FieldData& field, const glm::dvec3& point) noexcept;

/// The nearest point of the zero set within a radius.
std::optional<glm::dvec3> nearestZero(const FieldData& field, const glm::dvec3& point, double reach) noexcept;

/// Whether the zero set has a point within a radius.
bool isNearZero(const FieldData& field, const glm::dvec3& point, double reach) noexcept;

/// The first contact of a swept sphere with the zero set.
struct ZeroTouch {
    double along;         ///< distance along the path
    glm::dvec3 position;  ///< on the zero set
};
std::optional<ZeroTouch> firstZeroTouch(const FieldData& field, const Path& path, double radius) noexcept;

/// Whether the zero set has a point in a box.
bool meetsZero(const FieldData& field, const RotatedBox& box) noexcept;

}  // namespace bilayer::detail
