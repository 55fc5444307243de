// SPDX-License-Identifier: Apache-2.0
// Queries of the zero set by branch and bound.
#include "collider/field/zero/zero_set.h"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "collider/field/zero/zero_cells.h"
#include "collider/field/zero/zero_queries.h"
#include "collider/field/zero/zero_search.h"

namespace bilayer::detail {

glm::dvec3 zeroNormal(const FieldData& field, const glm::dvec3& point) noexcept {
    const glm::ivec3 voxel = glm::clamp(glm::ivec3(glm::floor(point)), glm::ivec3(0), extentOf(field) - 1);
    const std::int32_t entry = entryAt(field, voxel);
    if (entry < 0) return glm::dvec3(0);
    const CornerValues v = cellValues(field, entry, voxel & 7);
    const glm::dvec3 f = point - glm::dvec3(voxel), g = 1.0 - f;
    glm::dvec3 gradient(0);
    for (std::size_t i = 0; i < 8; ++i) {
        const glm::dvec3 at = cubeCorner(i), weight = glm::mix(g, f, at), sign = 2.0 * at - 1.0;
        gradient += v[i] * sign * glm::dvec3(weight.y * weight.z, weight.x * weight.z, weight.x * weight.y);
    }
    const double steepness = glm::length(gradient);
    return steepness > 0 ? gradient / steepness : glm::dvec3(0);
}

std::optional<glm::dvec3> nearestZero(const FieldData& field, const glm::dvec3& point, double reach) noexcept {
    NearestQuery nearest(point, reach);
    ZeroSearch(field, nearest).run();
    if (!nearest.isWithinReach()) return std::nullopt;
    return nearest.point;
}

bool isNearZero(const FieldData& field, const glm::dvec3& point, double reach) noexcept {
    AnyNearQuery near(point, reach);
    ZeroSearch(field, near).run();
    return near.point.has_value();
}

std::optional<ZeroTouch> firstZeroTouch(const FieldData& field, const Path& path, double radius) noexcept {
    SphereCastQuery touch(path, radius);
    ZeroSearch(field, touch).run();
    if (!touch.isWithinReach()) return std::nullopt;
    return ZeroTouch{touch.best, *touch.point};
}

bool meetsZero(const FieldData& field, const RotatedBox& box) noexcept {
    BoxQuery inBox{box};
    ZeroSearch(field, inBox).run();
    return inBox.found;
}

}  // namespace bilayer::detail
