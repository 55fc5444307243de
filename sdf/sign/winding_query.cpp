// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/winding_query.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "sdf/base/progress.h"

namespace bilayer::detail {
namespace {

/// Error of an estimate whose sign is propagated to other voxels, as a fraction of its distance to one half.
constexpr double propagatedError = 0.5;
/// Offset of the query point for a voxel away from the surface, in a closed mesh [voxels]. Without it, query points
/// often lie on cancelling walls inside a union. It is shorter than the free half voxel, and not along a simple plane.
const glm::dvec3 offWalls(0.113, 0.071, 0.167);
const double unitHalfDiagonal = std::sqrt(3.0) / 2;  // of a cube with side 1

}  // namespace

WindingSide WindingQuery::at(const glm::dvec3& point) const {
    poll(progress);
    if (!slope) return {winding.isInside(point), std::numeric_limits<double>::infinity()};
    const WindingNumber::Estimate e = winding.estimate(point, propagatedError);
    return {e.value > 0.5, std::max(std::abs(e.value - 0.5) - e.error, 0.0)};
}

WindingSide WindingQuery::around(const glm::dvec3& point) const {
    return at(slope ? point : point + voxelSize * offWalls);
}

double WindingQuery::slopeIn(const glm::dvec3& centre, std::int32_t side) const {
    return slope ? (*slope)(centre, unitHalfDiagonal * side * voxelSize) * voxelSize : 0;
}

double WindingQuery::changeInCube(std::int32_t side, double slope) {
    return unitHalfDiagonal * side * slope;
}

}  // namespace bilayer::detail
