// The surface of a field without its mesh: the zero set of the trilinear interpolant. Lengths in voxels, places from
// the directory's first voxel. Where a cell's eight values have one sign there is no surface in it, and where they have
// both there is some on its edges, which holds for parts of cells as well: so all answers are certain but for the size
// of the smallest parts. All may run on any number of threads at once, and allocate nothing.
#pragma once

#include <glm/vec3.hpp>
#include <optional>

#include "collider/field/field_data.h"
#include "collider/field/path.h"
#include "collider/field/triangle_tests.h"

namespace bilayer::detail {

/// What nearest and first points of the zero set are off by at most, in distance or along the way.
inline constexpr double zeroTolerance = 1e-3;

/// The first place of a path where the interpolant is negative, to 1e-9: chords of any length count.
std::optional<double> firstInside(const FieldData& field, const Path& path) noexcept;

/// The outward normal at a point of the zero set, of unit length; zero where the interpolant is flat.
glm::dvec3 zeroNormal(const FieldData& field, const glm::dvec3& point) noexcept;

/// The point of the zero set that is nearest, if it is within a reach.
std::optional<glm::dvec3> nearestZero(const FieldData& field, const glm::dvec3& point, double reach) noexcept;

/// Whether some point of the zero set is within a reach.
bool isNearZero(const FieldData& field, const glm::dvec3& point, double reach) noexcept;

/// Where a sphere on its way first touches the zero set.
struct ZeroTouch {
    double along;         ///< the path
    glm::dvec3 position;  ///< on the zero set
};
std::optional<ZeroTouch> firstZeroTouch(const FieldData& field, const Path& path, double radius) noexcept;

/// Whether a box holds a point of the zero set.
bool meetsZero(const FieldData& field, const TurnedBox& box) noexcept;

}  // namespace bilayer::detail
