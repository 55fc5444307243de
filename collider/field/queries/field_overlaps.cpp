// SPDX-License-Identifier: Apache-2.0
// Inside tests, overlaps of spheres and boxes, and batches of these, of rays and of sphere casts.
// Tested by tests/collider/field_overlaps.cpp through overlapsSphere().
#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <optional>

#include <bilayer/collider/field.h>
#include "collider/field/layout/batch.h"
#include "collider/field/layout/interpolant.h"
#include "collider/field/queries/side_query.h"
#include "collider/field/samples/field_data.h"
#include "collider/field/triangles/box_overlaps.h"
#include "collider/field/zero/zero_set.h"

namespace bilayer {

using namespace detail;

namespace {

// The box in double precision, with a normalised rotation.
RotatedBox rotatedBox(const OrientedBox& box) {
    return {glm::dvec3(box.centre), glm::mat3_cast(glm::normalize(glm::dquat(box.rotation))), glm::dvec3(box.halfSize)};
}

bool isBox(const OrientedBox& box) {
    const glm::quat& q = box.rotation;
    const float length2 = glm::dot(q, q);
    return isFinite(box.centre) && isFinite(box.halfSize) &&
           glm::all(glm::greaterThanEqual(box.halfSize, glm::vec3(0))) && std::isfinite(length2) && length2 > 0;
}

// Decides an overlap with a sphere from the sample at its centre, if possible.
std::optional<bool> overlapsRoughly(const FieldData& field, const glm::vec3& centre, float radius) {
    const Sample here = field.sample(field.toLocal(centre));
    const float away = std::abs(here.distance);
    const float margin = field.error + (here.inBand ? cellDiagonal * field.voxelSize : 0.f);
    if (away > radius + margin) return here.distance < 0;
    if (here.inBand && away + margin < radius) return true;
    return std::nullopt;
}

// Whether the surface meets a box.
bool meetsSurface(const FieldData& field, const OrientedBox& box) {
    RotatedBox exact = rotatedBox(box);
    if (field.mesh) return meetsTriangle(*field.mesh, exact);
    exact.centre = field.toLocal(box.centre);
    exact.halfSize *= field.perMetre;
    return meetsZero(field, exact);
}

}  // namespace

bool FieldData::inside(const glm::vec3& point) const {
    const glm::dvec3 local = toLocal(point);
    if (!mesh) return sample(local).distance < 0;
    const FieldSide side = SideQuery(*this).at(local);
    return side.certain ? side.inside : closest(point, std::numeric_limits<float>::infinity()).distance < 0;
}

bool Field::inside(const glm::vec3& point) const noexcept {
    return data_->inside(point);
}

bool Field::overlapsSphere(const glm::vec3& centre, float radius) const noexcept {
    if (!isFinite(centre) || !(radius >= 0) || !std::isfinite(radius)) return false;
    if (!data_->mesh)
        return data_->inside(centre) || isNearZero(*data_, data_->toLocal(centre), double(radius) * data_->perMetre);
    if (const auto known = overlapsRoughly(*data_, centre, radius)) return *known;
    return data_->closest(centre, radius).found || data_->inside(centre);
}

// A box that the surface does not meet is entirely on one side.
bool Field::overlapsBox(const OrientedBox& box) const noexcept {
    if (!isBox(box)) return false;
    if (data_->mesh) {
        if (overlapsRoughly(*data_, box.centre, glm::length(box.halfSize)) == false) return false;
        const float within = std::min({box.halfSize.x, box.halfSize.y, box.halfSize.z});
        if (overlapsRoughly(*data_, box.centre, within) == true) return true;
    }
    return data_->inside(box.centre) || meetsSurface(*data_, box);
}

void Field::inside(std::span<const glm::vec3> points, std::span<bool> answers) const {
    requireSameLength(points.size(), "points", answers.size(), "answers");
    for (std::size_t i = 0; i < points.size(); ++i) answers[i] = inside(points[i]);
}

void Field::raycast(std::span<const Ray> rays, std::span<std::optional<RayHit>> hits) const {
    requireSameLength(rays.size(), "rays", hits.size(), "hits");
    for (std::size_t i = 0; i < rays.size(); ++i) hits[i] = raycast(rays[i]);
}

void Field::segment(std::span<const glm::vec3> from, std::span<const glm::vec3> to,
                    std::span<std::optional<RayHit>> hits) const {
    requireSameLength(from.size(), "starts", to.size(), "ends");
    requireSameLength(from.size(), "starts", hits.size(), "hits");
    for (std::size_t i = 0; i < from.size(); ++i) hits[i] = segment(from[i], to[i]);
}

void Field::sphereCast(std::span<const Ray> rays, std::span<const float> radii,
                       std::span<std::optional<RayHit>> hits) const {
    requireSameLength(rays.size(), "rays", radii.size(), "radii");
    requireSameLength(rays.size(), "rays", hits.size(), "hits");
    for (std::size_t i = 0; i < rays.size(); ++i) hits[i] = sphereCast(rays[i], radii[i]);
}

void Field::overlapsSphere(std::span<const glm::vec3> centres, std::span<const float> radii,
                           std::span<bool> answers) const {
    requireSameLength(centres.size(), "centres", radii.size(), "radii");
    requireSameLength(centres.size(), "centres", answers.size(), "answers");
    for (std::size_t i = 0; i < centres.size(); ++i) answers[i] = overlapsSphere(centres[i], radii[i]);
}

void Field::overlapsBox(std::span<const OrientedBox> boxes, std::span<bool> answers) const {
    requireSameLength(boxes.size(), "boxes", answers.size(), "answers");
    for (std::size_t i = 0; i < boxes.size(); ++i) answers[i] = overlapsBox(boxes[i]);
}

}  // namespace bilayer
