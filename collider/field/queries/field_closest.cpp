// SPDX-License-Identifier: Apache-2.0
// Closest-point queries on a mesh with a field. The point's block holds the hierarchy nodes to search. The distance to
// the closest feature is then computed in double precision.
// Tested by tests/collider/field_closest.cpp through closest().
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <memory>
#include <optional>
#include <utility>

#include <bilayer/collider/field.h>
#include "collider/field/layout/batch.h"
#include "collider/field/layout/path.h"
#include "collider/field/queries/side_query.h"
#include "collider/field/samples/field_data.h"
#include "collider/field/zero/zero_answers.h"
#include "collider/field/zero/zero_set.h"
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
      worldOrigin(samples.worldOrigin),
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

// The result for a point, from the closest piece of the mesh.
ClosestPoint FieldData::closestOn(std::uint32_t piece, const glm::vec3& point, float maxDistance) const {
    if (piece == MeshTree::noPiece) return {};
    const glm::dvec3 from = mesh->approached(glm::dvec3(point));
    const NearestFeature nearest = mesh->featureOfPiece(piece, from);
    const double distance = glm::length(nearest.offset + (from - glm::dvec3(point)));
    if (!(distance <= double(maxDistance))) return {};
    const bool inside = SideQuery(*this).isInside(nearest, point);
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
    SideQuery(*this).fetch(local);
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
    const SideQuery sides(*data_);
    for (std::size_t begin = 0; begin < points.size(); begin += batch) {
        const std::span<const glm::vec3> some = points.subspan(begin, std::min(batch, points.size() - begin));
        for (std::size_t i = 0; i < some.size(); ++i) {
            const glm::dvec3 local = data_->toLocal(some[i]);
            places[i] = data_->entries.at(local);
            places[i].fetch();
            sides.fetch(local);
        }
        data_->mesh->nearestPieces(some, bound, {places.data(), some.size()}, {pieces.data(), some.size()});
        for (std::size_t i = 0; i < some.size(); ++i)
            answers[begin + i] =
                data_->closestOn(data_->orBeyond(pieces[i], places[i], some[i], maxDistance), some[i], maxDistance);
    }
}

}  // namespace bilayer
