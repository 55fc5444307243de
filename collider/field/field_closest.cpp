// SPDX-License-Identifier: Apache-2.0
// Closest-point queries on a mesh with a field. The point's block holds the hierarchy nodes to search. The distance to
// the closest feature is then computed in double precision.
// Tested by tests/collider/field_closest.cpp through closest().
#include <hwy/cache_control.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <memory>
#include <optional>
#include <utility>

#include <bilayer/collider/field.h>
#include "collider/field/batch.h"
#include "collider/field/field_data.h"
#include "collider/field/mesh_winding.h"
#include "collider/field/path.h"
#include "collider/field/zero_answers.h"
#include "collider/field/zero_set.h"
#include "sdf/sign/sign_choice.h"

namespace bilayer {

using namespace detail;

namespace {

/// Band distances seldom exceed the band by more than this, so that a second search is seldom needed [voxels].
constexpr float usualError = 0.1f;
/// Tolerances for single-precision rounding of the search radius: relative, and absolute [voxels].
constexpr float boundRounding = 1 + 1e-5f, boundRoom = 1e-5f;
/// Batch size; the data of the batch's points fit into the first-level cache.
constexpr std::size_t batch = 64;
/// Distance on either side of a wall at which the field decides which one is inside [voxels].
constexpr float probeOffset = 1;
/// Max error of samples at an edge [voxels].
constexpr float edgeError = 0.3f;
/// Max error of samples where the surface is smooth, that is, where its radius of curvature is at least 2.5 voxels
/// [voxels].
constexpr float smoothError = 0.1f;

// The height of a point over the plane of the normal, which may be shorter than 1.
double heightOver(const NearestFeature& nearest) {
    return -glm::dot(nearest.normal, nearest.offset);
}

// The normal of a feature, flipped if it points to the other side. If there is none: the direction from the surface to
// the point, or its reverse inside. A point on the surface itself has no side.
glm::vec3 outwardNormal(const NearestFeature& nearest, bool inside) {
    const double length = glm::length(nearest.normal), distance = glm::length(nearest.offset);
    if (length > minMeanNormal || nearest.isOnSurface) {
        const bool flipped = !nearest.isOnSurface && (inside ? heightOver(nearest) > 0 : heightOver(nearest) < 0);
        return length > 0 ? glm::vec3(nearest.normal * ((flipped ? -1 : 1) / length)) : glm::vec3(0, 0, 1);
    }
    return glm::vec3(nearest.offset * ((inside ? 1 : -1) / distance));
}

ClosestPoint closestWithoutMesh(const FieldData& field, const glm::vec3& point, float maxDistance) {
    const auto nearest = [&](const glm::dvec3& from, double reach) -> std::optional<ZeroPoint> {
        const auto position = nearestZero(field, from, reach);
        if (!position) return std::nullopt;
        return ZeroPoint{*position, zeroNormal(field, *position)};
    };
    const auto isInside = [&] { return field.sample(field.toLocal(point)).distance < 0; };
    return closestZero(field, point, maxDistance, nearest, isInside);
}

}  // namespace

FieldData::FieldData(const FieldData& samples, std::shared_ptr<const Mesh> outward)
    : FieldLayout(samples.shared()),
      kernels(samples.kernels),
      coarse(clearance()),
      mesh(std::make_unique<MeshTree>(std::move(outward), voxelSize)),
      signedByNormals(samples.signedByNormals),
      signedByWinding(samples.signedByWinding && balanced(mesh->mesh())),
      winding(samples.signedByWinding && !signedByNormals && !signedByWinding
                  ? std::make_unique<const WindingNumber>(mesh->mesh())
                  : nullptr),
      sampleError(samples.sampleError),
      error(sampleError) {
    fillLanes();
    const float reach = std::max(exteriorWidth, interiorWidth) * float(perMetre) + usualError;
    entries = BlockEntries(*this, mesh->tree(), 1 / double(voxelSize), reach);
}

// The index of the voxel nearest to a place; negative if the place is in no stored block.
std::ptrdiff_t FieldData::nearestVoxel(const glm::dvec3& local) const {
    const glm::dvec3 size = extent();
    const bool within =
        local.x >= 0 && local.y >= 0 && local.z >= 0 && local.x < size.x && local.y < size.y && local.z < size.z;
    if (!within) return emptyOutside;
    const glm::ivec3 block = glm::ivec3(local) >> 3;
    const std::int32_t number = directory[entryOf(block)];
    if (number < 0) return number;
    const glm::ivec3 inBlock = glm::ivec3(local + 0.5) - 8 * block;
    return std::ptrdiff_t(number) * blockFloats + (inBlock.x * stride + inBlock.y) * stride + inBlock.z;
}

// Prefetches the data that sideAt() reads.
void FieldData::fetchSide(const glm::dvec3& local) const {
    const std::ptrdiff_t index = nearestVoxel(local);
    if (index < 0) return;
    if (storage == Storage::fixed16)
        hwy::Prefetch(values16.data() + index);
    else
        hwy::Prefetch(values.data() + index);
}

// A sphere around a voxel that does not reach the surface is on the voxel's side.
FieldData::Side FieldData::sideAt(const glm::dvec3& local) const {
    const std::ptrdiff_t index = nearestVoxel(local);
    if (index >= 0) {
        const float value = valueAt(std::size_t(index));
        const double away = glm::distance(local, glm::floor(local + 0.5)) * voxel;
        if (away < double(std::abs(value) - error)) return {value < 0, true, value};
    }
    const float distance = sample(local).distance;
    return {distance < 0, index < 0 && std::abs(distance) > error, distance};
}

// The samples on both sides of a place of the mesh.
FieldData::Probes FieldData::probesAt(const glm::dvec3& place, const glm::dvec3& normal) const {
    const glm::dvec3 step = double(probeOffset * voxelSize) * glm::normalize(normal);
    const auto distanceAt = [&](const glm::dvec3& at) { return sample((at - origin) * perMetre).distance; };
    return {distanceAt(place + step), distanceAt(place - step)};
}

// Whether the field changes sign at a place of the mesh. It does not at walls within the solid, nor at free-standing
// walls. Next to an edge, one of the two samples may be close to another wall.
bool FieldData::divides(const glm::dvec3& place, const glm::dvec3& normal) const {
    const auto [outer, inner] = probesAt(place, normal);
    return outer > -edgeError * voxelSize && inner < edgeError * voxelSize &&
           outer - inner > probeOffset * voxelSize / 2;
}

// Whether a point is over a face of a wall that stands alone: on either side, the field is almost as far from it as it
// can be.
bool FieldData::isNextToWall(const NearestFeature& nearest, const glm::vec3& point) const {
    if (nearest.feature != Feature::face) return false;
    const auto [outer, inner] = probesAt(glm::dvec3(point) + nearest.offset, nearest.normal);
    const float clear = (probeOffset - edgeError) * voxelSize;
    return outer > clear && inner < -clear;
}

// Whether a normal defines the side of a point, and the sample does not contradict it: it has the same sign, or both
// put the point so close to the surface that the interpolation error explains the difference.
bool FieldData::confirms(const NearestFeature& nearest, const Side& side) const {
    const double height = heightOver(nearest), distance = glm::length(nearest.offset);
    const bool hasSide = std::abs(height) > minMeanNormal * distance;
    const double close = double(smoothError) * voxel;
    return hasSide && ((height < 0) == side.inside || (distance < close && double(std::abs(side.distance)) < close));
}

// By the rules at Field::closest().
bool FieldData::isInside(const NearestFeature& nearest, const glm::vec3& point) const {
    const Side side = sideAt(toLocal(point));
    if (side.certain) return side.inside;
    if (winding && !nearest.isOnSurface)
        return isNextToWall(nearest, point) ? heightOver(nearest) < 0 : winding->isInside(glm::dvec3(point));
    if (!mesh->mayEnclose(glm::dvec3(point))) return false;
    if (signedByNormals && confirms(nearest, side)) return heightOver(nearest) < 0;
    if (signedByWinding && !nearest.isOnSurface) {
        const auto number = windingNumber(*mesh, point);
        if (number && *number >= 0) return *number > 0;
    }
    return isBehind(nearest, side, point);
}

// The side of a point without winding numbers. The normal decides if it defines a side: for meshes signed by normals,
// and for walls that the field confirms. Otherwise the sample decides, which blends the surfaces on both sides of an
// edge.
bool FieldData::isBehind(const NearestFeature& nearest, const Side& side, const glm::vec3& point) const {
    const double height = heightOver(nearest);
    const bool hasSide = std::abs(height) > minMeanNormal * glm::length(nearest.offset);
    if (!hasSide) return side.inside;
    const bool byNormal = signedByNormals || divides(glm::dvec3(point) + nearest.offset, nearest.normal);
    return byNormal ? height < 0 : side.inside;
}

// The result for a point, from the closest piece of the mesh.
ClosestPoint FieldData::closestOn(std::uint32_t piece, const glm::vec3& point, float maxDistance) const {
    if (piece == MeshTree::noPiece) return {};
    const glm::dvec3 from = mesh->approached(glm::dvec3(point));
    const NearestFeature nearest = mesh->featureOfPiece(piece, from);
    const double distance = glm::length(nearest.offset + (from - glm::dvec3(point)));
    if (!(distance <= double(maxDistance))) return {};
    const bool inside = isInside(nearest, point);
    return {.distance = inside ? -toFloat(distance) : toFloat(distance),
            .position = glm::vec3(from + nearest.offset),
            .normal = outwardNormal(nearest, inside),
            .triangle = nearest.triangle,
            .feature = nearest.feature,
            .index = nearest.index,
            .found = true};
}

// The search radius [voxels].
float FieldData::boundOf(float maxDistance) const {
    return (maxDistance * float(perMetre) + boundRoom) * boundRounding;
}

// Searches the whole mesh if the search from an entry has found nothing and its reach is too short.
std::uint32_t FieldData::orBeyond(std::uint32_t piece, const EntryPlace& place, const glm::vec3& point,
                                  float maxDistance) const {
    const float bound = boundOf(maxDistance);
    if (piece != MeshTree::noPiece || (place.entries && bound <= entries.reach())) return piece;
    return mesh->nearestPiece(glm::dvec3(point), bound);
}

ClosestPoint FieldData::closest(const glm::vec3& point, float maxDistance) const {
    if (!mesh) return closestWithoutMesh(*this, point, maxDistance);
    if (!(maxDistance >= 0)) return {};
    const glm::dvec3 local = toLocal(point);
    fetchSide(local);
    const EntryPlace place = entries.at(local);
    std::uint32_t piece = MeshTree::noPiece;
    if (place.entries)
        piece = mesh->nearestPiece(glm::dvec3(point), std::min(boundOf(maxDistance), entries.reach()), place);
    return closestOn(orBeyond(piece, place, point, maxDistance), point, maxDistance);
}

ClosestPoint Field::closest(const glm::vec3& point, float maxDistance) const noexcept {
    return data_->closest(point, maxDistance);
}

// Interleaves the searches of several points, so that prefetches are well ahead of their use.
void Field::closest(std::span<const glm::vec3> points, std::span<ClosestPoint> answers, float maxDistance) const {
    requireSameLength(points.size(), "points", answers.size(), "answers");
    if (!data_->mesh || !(maxDistance >= 0)) {
        for (std::size_t i = 0; i < points.size(); ++i) answers[i] = data_->closest(points[i], maxDistance);
        return;
    }
    std::array<EntryPlace, batch> places;
    std::array<std::uint32_t, batch> pieces;
    const float bound = std::min(data_->boundOf(maxDistance), data_->entries.reach());
    for (std::size_t begin = 0; begin < points.size(); begin += batch) {
        const std::span<const glm::vec3> some = points.subspan(begin, std::min(batch, points.size() - begin));
        for (std::size_t i = 0; i < some.size(); ++i) {
            const glm::dvec3 local = data_->toLocal(some[i]);
            places[i] = data_->entries.at(local);
            places[i].fetch();
            data_->fetchSide(local);
        }
        data_->mesh->nearestPieces(some, bound, {places.data(), some.size()}, {pieces.data(), some.size()});
        for (std::size_t i = 0; i < some.size(); ++i)
            answers[begin + i] =
                data_->closestOn(data_->orBeyond(pieces[i], places[i], some[i], maxDistance), some[i], maxDistance);
    }
}

}  // namespace bilayer
