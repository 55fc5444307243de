// SPDX-License-Identifier: Apache-2.0
// The cells of a field's interpolant, as the queries of its zero set read them. Lengths in voxels, places from the
// directory's first voxel.
// Tested by tests/collider/zero_set.cpp through Field::closest().
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>

#include "collider/field/samples/field_data.h"

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

/// The corners of a coarse cell's cells that are inside: a bit for each along z.
using InsideRows = std::array<std::array<std::uint8_t, Clearance::cellSide + 1>, Clearance::cellSide + 1>;

inline InsideRows insideRows(const FieldData& field, std::int32_t entry, const glm::ivec3& inBlock) {
    InsideRows rows{};
    for (int x = 0; x <= Clearance::cellSide; ++x)
        for (int y = 0; y <= Clearance::cellSide; ++y)
            for (int z = 0; z <= Clearance::cellSide; ++z) {
                const glm::ivec3 at = inBlock + glm::ivec3(x, y, z);
                const int index = (at.x * FieldFrame::stride + at.y) * FieldFrame::stride + at.z;
                const float value = field.valueAt(std::size_t(entry) * FieldFrame::blockFloats + std::size_t(index));
                rows[x][y] |= std::uint8_t(unsigned(value < 0) << z);
            }
    return rows;
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
