// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/search/local_field.h"
#include <bilayer/collider/contact.h>
#include "collider/contact/body/collider_data.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "collider/contact/search/surface_query.h"
#include "collider/field/layout/interpolant.h"
#include "sdf/base/access.h"

namespace bilayer::detail {

LocalField::LocalField(const Placed& field, const Pose& other, const Motion& motion, float reach, bool exact)
    : collider_(field.collider),
      field_(exact ? field.collider.exactField() : field.collider.field()),
      exact_(exact),
      scale_(field.scale),
      voxel_(field.scale * field.collider.field().voxelSize()),
      pose_(field.pose),
      relativeMotion_(other, motion, field.pose, field.motion) {
    const Bounds& bounds = field.collider.bounds();
    if (reach > surelyInBand(scale_ * field_.exteriorWidth(), voxel_)) farReach_ = reach / scale_;
    exactReach_ = reach + maxInterpolationError * voxel_;
    maxDisplacement_ =
        relativeMotion_.maxDisplacement(scale_ * bounds.centre(), 0.5f * scale_ * glm::length(bounds.size()));
}

LocalField::FieldSample LocalField::at(const glm::vec3& point, float radius) const {
    const Sample sample = field_.sample(point / scale_);
    if (!sample.inBand && sample.distance > 0 && farReach_ > 0) return sampleBeyondBand(point, radius, sample.distance);
    if (!sample.inBand)
        return {sample.distance > 0 ? FieldSample::outside : FieldSample::inside, scale_ * sample.distance};
    if (scale_ * sample.distance - radius <= exactReach_ && dataOf(collider_).isExactAt(point / scale_, exact_))
        return exactSample(point, sample);
    const glm::vec3 normal = directionOf(sample, field_.voxelSize());
    const auto where = normal == glm::vec3(0) ? FieldSample::noNormal : FieldSample::nearSurface;
    return {where, scale_ * sample.distance, normal, sample.gradient};
}

// The exact sample from the triangles, in the band.
LocalField::FieldSample LocalField::exactSample(const glm::vec3& point, const Sample& sample) const {
    const SurfaceSample surface = surfaceSampleAt(field_, point / scale_, sample, true);
    if (surface.normal == glm::vec3(0)) return {FieldSample::noNormal, scale_ * surface.distance, {}, sample.gradient};
    return {FieldSample::nearSurface, scale_ * surface.distance, surface.normal, surface.normal};
}

// Beyond the band, for contact tests that ask for more than the band covers.
LocalField::FieldSample LocalField::sampleBeyondBand(const glm::vec3& point, float radius, float bound) const {
    const ClosestPoint closest = field_.closest(point / scale_, farReach_ + radius / scale_);
    if (!closest.found) return {FieldSample::outside, std::max(scale_ * bound, scale_ * farReach_ + radius)};
    const glm::vec3 normal = (point / scale_ - closest.position) / closest.distance;
    return {FieldSample::nearSurface, scale_ * closest.distance, normal, normal};
}

std::optional<Contact> LocalField::probe(const glm::vec3& point, const FieldSample& sample, float radius,
                                         std::uint32_t feature, float margin, ContactReport& report) const {
    ++report.pointsTested;
    if (sample.where == FieldSample::inside) ++report.beyondBand;
    if (sample.distance - radius > margin) return speculativeContact(point, sample, radius, feature, margin);
    if (sample.where != FieldSample::nearSurface) return std::nullopt;
    return contact(point - sample.distance * sample.normal, sample.normal, sample.distance - radius, feature,
                   approach(point, sample.normal, margin), radius);
}

// For a point that is farther away: the contact where its path meets the surface.
std::optional<Contact> LocalField::speculativeContact(const glm::vec3& point, const FieldSample& sample, float radius,
                                                      std::uint32_t feature, float margin) const {
    if (maxDisplacement_ <= margin) return std::nullopt;
    const glm::vec3 displacement = relativeMotion_.of(point);
    const float length = glm::length(displacement);
    if (sample.distance - radius > length) return std::nullopt;
    const Ray ray{point / scale_, displacement, length / scale_};
    const auto hit = radius > 0 ? field_.sphereCast(ray, radius / scale_) : field_.raycast(ray);
    if (!hit) return std::nullopt;
    // within the tolerance of rays, a path that grazes an edge hits the face beyond it from behind: it passes
    const bool isNextToSurface =
        sample.where == FieldSample::nearSurface && sample.distance <= maxInterpolationError * voxel_;
    if (isNextToSurface && glm::dot(displacement, sample.normal) < 0 && glm::dot(hit->normal, sample.normal) < 0)
        return std::nullopt;
    const float separation = glm::dot(point - scale_ * hit->position, hit->normal);
    return contact(point - separation * hit->normal, hit->normal, std::max(separation - radius, 0.f), feature,
                   -glm::dot(displacement, hit->normal), radius);
}

float LocalField::approach(const glm::vec3& point, const glm::vec3& normal, float margin) const {
    return maxDisplacement_ > margin ? std::max(-glm::dot(relativeMotion_.of(point), normal), 0.f) : 0;
}

Contact LocalField::contact(const glm::vec3& position, const glm::vec3& normal, float distance, std::uint32_t feature,
                            float approach, float roundingRadius) const {
    return {pose_.toWorld(position), pose_.rotation * normal, distance, feature, approach, roundingRadius};
}

}  // namespace bilayer::detail
