// SPDX-License-Identifier: Apache-2.0
// Lower bounds of the distance to a field's surface where samples are outside the band. Negative inside. Points are in
// voxels from the directory's first voxel, bounds in metres. Highway includes this file once for each instruction set:
// only between HWY_BEFORE_NAMESPACE's headers and its own, after hwy/highway.h. The functions round down, which most
// instruction sets do in one instruction; the baseline calls a function for it.
// Tested by tests/collider/field.cpp through Field::sample().
#if defined(BILAYER_COLLIDER_DISTANCE_BOUNDS_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BILAYER_COLLIDER_DISTANCE_BOUNDS_H
#undef BILAYER_COLLIDER_DISTANCE_BOUNDS_H
#else
#define BILAYER_COLLIDER_DISTANCE_BOUNDS_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "collider/field/layout/interpolant.h"
#include "collider/field/layout/outer_bound.h"
#include "collider/field/samples/field_data.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace {

/// Max error of the interpolant for values with Lipschitz constant 1. It is the weighted mean distance to the eight
/// voxels, which is at most its root mean square [voxels].
inline float interpolationError(const glm::vec3& fraction) {
    const glm::vec3 spread = fraction * (1.f - fraction);
    return std::sqrt(spread.x + spread.y + spread.z);
}

/// For a point in a block that is entirely outside the band. The nearest voxel of the block is outside the band. It is
/// half a cell's diagonal away, or a whole one if the cell ends in another block.
inline float boundInEmptyBlock(const FieldData& field, bool inside, const glm::dvec3& local) {
    const glm::dvec3 rest = local - double(FieldFrame::side) * glm::floor(local / double(FieldFrame::side));
    const bool ownCell = std::max({rest.x, rest.y, rest.z}) <= double(FieldFrame::side - 1);
    const float width = inside ? field.interiorWidth : field.exteriorWidth;
    const float nextToBand = width - (ownCell ? 0.5f : 1.f) * cellDiagonal * field.voxelSize;
    const float bound = std::max({0.f, nextToBand, field.voxelSize * field.clearanceAt(local)});
    return inside ? -bound : bound;
}

/// For a point in a cell that is partly outside the band, with the interpolated distance there [m].
inline float boundNextToBand(const FieldData& field, float distance, const glm::dvec3& local) {
    const float nextToBand =
        (distance < 0 ? field.interiorWidth : field.exteriorWidth) - cellDiagonal * field.voxelSize;
    const float between =
        std::abs(distance) - field.voxelSize * interpolationError(glm::vec3(local - glm::floor(local)));
    const float bound = std::max({0.f, nextToBand, between, field.voxelSize * field.clearanceAt(local)});
    return std::copysign(bound, distance);
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
