// SPDX-License-Identifier: Apache-2.0
// The cells of a field's interpolant, as the queries of its zero set read them. Lengths in voxels, places from the
// directory's first voxel.
// Tested by tests/collider/zero_set.cpp.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>

#include "collider/field/field_data.h"

namespace bilayer::detail {

/// Tolerance for the single precision of clearances.
inline constexpr double clearanceSlack = 1e-2;

/// Values of the interpolant at the corners of a cube, the last axis fastest.
using CornerValues = std::array<double, 8>;

/// A corner of the unit cube, in the same order.
inline glm::dvec3 cubeCorner(std::size_t i) {
    return {double(i >> 2), double(i >> 1 & 1), double(i & 1)};
}

/// The values of a cell in a stored block.
inline CornerValues cellValues(const FieldData& field, std::int32_t entry, const glm::ivec3& inBlock) {
    constexpr int x = FieldFrame::stride * FieldFrame::stride, y = FieldFrame::stride;
    const std::size_t at =
        std::size_t(entry) * FieldFrame::blockFloats + std::size_t(inBlock.x * x + inBlock.y * y + inBlock.z);
    const auto v = [&](int step) { return double(field.valueAt(at + std::size_t(step))); };
    return {v(0), v(1), v(y), v(y + 1), v(x), v(x + 1), v(x + y), v(x + y + 1)};
}

/// The directory entry of the block that holds a voxel.
inline std::int32_t entryAt(const FieldData& field, const glm::ivec3& voxel) {
    return field.directory[field.entryOf(voxel >> 3)];
}

/// The size of the directory [voxels].
inline glm::ivec3 extentOf(const FieldData& field) {
    return FieldFrame::side * field.blocks;
}

/// A lower bound of the distance to the surface; not positive where it is unknown.
inline double clearanceAt(const FieldData& field, const glm::dvec3& point) {
    return double(field.clearanceAt(point)) - clearanceSlack;
}

}  // namespace bilayer::detail
