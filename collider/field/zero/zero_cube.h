// SPDX-License-Identifier: Apache-2.0
// Cells of the interpolant and their sub-cells, with the expansion of the interpolant about their centres. Lengths in
// voxels, places from the directory's first voxel.
// Tested by tests/collider/zero_set.cpp through Field::closest().
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "collider/field/zero/zero_cells.h"

namespace bilayer::detail {

/// A cell or a sub-cell.
struct ZeroCube {
    glm::dvec3 lower;
    double side;
    CornerValues values;

    glm::dvec3 upper() const { return lower + side; }
    glm::dvec3 centre() const { return lower + 0.5 * side; }
    bool holdsZero() const {
        const auto [low, high] = std::minmax_element(values.begin(), values.end());
        return *low < 0 && *high >= 0;
    }
};

/// The interpolant in a cube, about its centre. At the offset t, in half sides, it is
///   value + slope . t + twist.x ty tz + twist.y tx tz + twist.z tx ty + skew tx ty tz
struct CubeExpansion {
    glm::dvec3 centre;
    double halfSide;
    double value;
    glm::dvec3 slope, twist;
    double skew;

    explicit CubeExpansion(const ZeroCube& cube) : centre(cube.centre()), halfSide(0.5 * cube.side) {
        std::array<double, 8> sum = cube.values;  // Haar transform
        for (const std::size_t axis : {1, 2, 4})
            for (std::size_t i = 0; i < 8; ++i)
                if (!(i & axis)) {
                    const double low = sum[i], high = sum[i | axis];
                    sum[i] = 0.5 * (low + high);
                    sum[i | axis] = 0.5 * (high - low);
                }
        value = sum[0];
        slope = {sum[4], sum[2], sum[1]};
        twist = {sum[3], sum[5], sum[6]};
        skew = sum[7];
    }

    /// The linear part, at any place.
    double linearAt(const glm::dvec3& point) const { return value + glm::dot(gradient(), point - centre); }
    glm::dvec3 gradient() const { return slope / halfSide; }
    /// Max difference of the interpolant and its linear part in the cube.
    double linearError() const { return std::abs(twist.x) + std::abs(twist.y) + std::abs(twist.z) + std::abs(skew); }
};

}  // namespace bilayer::detail
