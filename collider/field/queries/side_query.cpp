// SPDX-License-Identifier: Apache-2.0
#include "collider/field/queries/side_query.h"

#include <hwy/cache_control.h>

#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "collider/field/triangles/mesh_winding.h"

namespace bilayer::detail {

namespace {

/// Distance on either side of a wall at which the field decides which one is inside [voxels].
constexpr float probeOffset = 1;
/// Max error of samples at an edge [voxels].
constexpr float edgeError = 0.3f;
/// Max error of samples where the surface is smooth, that is, where its radius of curvature is at least 2.5 voxels
/// [voxels].
constexpr float smoothError = 0.1f;

}  // namespace

// The index of the voxel nearest to a place; negative if the place is in no stored block.
std::ptrdiff_t SideQuery::nearestVoxel(const glm::dvec3& local) const {
    const glm::dvec3 size = field_.extent();
    const bool within =
        local.x >= 0 && local.y >= 0 && local.z >= 0 && local.x < size.x && local.y < size.y && local.z < size.z;
    if (!within) return FieldFrame::emptyOutside;
    const glm::ivec3 block = glm::ivec3(local) >> 3;
    const std::int32_t number = field_.directory[field_.entryOf(block)];
    if (number < 0) return number;
    const glm::ivec3 inBlock = glm::ivec3(local + 0.5) - 8 * block;
    return std::ptrdiff_t(number) * FieldFrame::blockFloats +
           (inBlock.x * FieldFrame::stride + inBlock.y) * FieldFrame::stride + inBlock.z;
}

// Prefetches the data that at() reads.
void SideQuery::fetch(const glm::dvec3& local) const {
    const std::ptrdiff_t index = nearestVoxel(local);
    if (index < 0) return;
    if (field_.storage == Storage::fixed16)
        hwy::Prefetch(field_.values16.data() + index);
    else
        hwy::Prefetch(field_.values.data() + index);
}

// A sphere around a voxel that does not reach the surface is on the voxel's side.
FieldSide SideQuery::at(const glm::dvec3& local) const {
    const std::ptrdiff_t index = nearestVoxel(local);
    if (index >= 0) {
        const float value = field_.valueAt(std::size_t(index));
        const double away = glm::distance(local, glm::floor(local + 0.5)) * field_.voxel;
        if (away < double(std::abs(value) - field_.error)) return {value < 0, true, value};
    }
    const float distance = field_.sample(local).distance;
    return {distance < 0, index < 0 && std::abs(distance) > field_.error, distance};
}

// The samples on both sides of a place of the mesh.
SideQuery::Probes SideQuery::probesAt(const glm::dvec3& place, const glm::dvec3& normal) const {
    const glm::dvec3 step = double(probeOffset * field_.voxelSize) * glm::normalize(normal);
    const auto distanceAt = [&](const glm::dvec3& at) {
        return field_.sample((at - field_.origin) * field_.perMetre).distance;
    };
    return {distanceAt(place + step), distanceAt(place - step)};
}

// Whether the field changes sign at a place of the mesh. It does not at walls within the solid, nor at free-standing
// walls. Next to an edge, one of the two samples may be close to another wall.
bool SideQuery::divides(const glm::dvec3& place, const glm::dvec3& normal) const {
    const auto [outer, inner] = probesAt(place, normal);
    return outer > -edgeError * field_.voxelSize && inner < edgeError * field_.voxelSize &&
           outer - inner > probeOffset * field_.voxelSize / 2;
}

// Whether a point is over a face of a wall that stands alone: on either side, the field is almost as far from it as it
// can be.
bool SideQuery::isNextToWall(const NearestFeature& nearest, const glm::vec3& point) const {
    if (nearest.feature != Feature::face) return false;
    const auto [outer, inner] = probesAt(glm::dvec3(point) + nearest.offset, nearest.normal);
    const float clear = (probeOffset - edgeError) * field_.voxelSize;
    return outer > clear && inner < -clear;
}

// Whether a normal defines the side of a point, and the sample does not contradict it: it has the same sign, or both
// put the point so close to the surface that the interpolation error explains the difference.
bool SideQuery::confirms(const NearestFeature& nearest, const FieldSide& side) const {
    const double height = heightOver(nearest), distance = glm::length(nearest.offset);
    const bool hasSide = std::abs(height) > minMeanNormal * distance;
    const double close = double(smoothError) * field_.voxel;
    return hasSide && ((height < 0) == side.inside || (distance < close && double(std::abs(side.distance)) < close));
}

// By the rules at Field::closest().
bool SideQuery::isInside(const NearestFeature& nearest, const glm::vec3& point) const {
    const FieldSide side = at(field_.toLocal(point));
    if (side.certain) return side.inside;
    if (field_.winding && !nearest.isOnSurface)
        return isNextToWall(nearest, point) ? heightOver(nearest) < 0 : field_.winding->isInside(glm::dvec3(point));
    if (!field_.mesh->mayEnclose(glm::dvec3(point))) return false;
    if (field_.signedByNormals && confirms(nearest, side)) return heightOver(nearest) < 0;
    if (field_.signedByWinding && !nearest.isOnSurface) {
        const auto number = windingNumber(*field_.mesh, point);
        if (number && *number >= 0) return *number > 0;
    }
    return isBehind(nearest, side, point);
}

// The side of a point without winding numbers. The normal decides if it defines a side: for meshes signed by normals,
// and for walls that the field confirms. Otherwise the sample decides, which blends the surfaces on both sides of an
// edge.
bool SideQuery::isBehind(const NearestFeature& nearest, const FieldSide& side, const glm::vec3& point) const {
    const double height = heightOver(nearest);
    const bool hasSide = std::abs(height) > minMeanNormal * glm::length(nearest.offset);
    if (!hasSide) return side.inside;
    const bool byNormal = field_.signedByNormals || divides(glm::dvec3(point) + nearest.offset, nearest.normal);
    return byNormal ? height < 0 : side.inside;
}

}  // namespace bilayer::detail
