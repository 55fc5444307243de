// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/shapes/convex.h"

#include <algorithm>
#include <glm/geometric.hpp>

#include "collider/contact/shapes/axial_cores.h"

namespace bilayer::detail {

namespace {

// Limit of steps in the search for the entry of a path; longer searches only graze.
constexpr int maxSteps = 64;

}  // namespace

Convex Convex::segment(int axis, float halfHeight, float radius) {
    return {std::make_shared<SegmentCore>(axis, halfHeight), radius};
}

Convex Convex::box(const glm::vec3& halfExtents) {
    return {std::make_shared<BoxCore>(halfExtents), 0};
}

Convex Convex::revolution(int axis, float halfHeight, float lowerRadius, float upperRadius, float radius) {
    return {std::make_shared<RevolutionCore>(axis, halfHeight, lowerRadius, upperRadius, radius), radius};
}

Convex Convex::hull(const HullSurface& surface, float radius) {
    return {std::make_shared<HullCore>(surface, radius), radius};
}

Convex Convex::spheres(std::vector<SphereOfHull> spheres) {
    return {std::make_shared<MultisphereHull>(std::move(spheres)), 0};
}

NearestPoint Convex::nearest(const glm::vec3& point, float reach) const {
    NearestPoint nearest = core_->nearest(point, reach + growth_);
    nearest.distance -= growth_;
    nearest.radius += growth_;
    return nearest;
}

double Convex::boundingRadius() const {
    double largest = 0;
    for (std::uint32_t i = 0; i < vertices().size(); ++i)
        largest = std::max(largest, double(glm::length(vertices()[i]) + radius(i)));
    return largest;
}

/// By Newton's method, which does not overshoot: distance is convex along a path, and so is the bound of a hull's
/// distance. Once the distance grows, it grows forever.
std::optional<Convex::PathHit> Convex::castPoint(const glm::vec3& start, const glm::vec3& displacement,
                                                 float tolerance) const {
    const float length = glm::length(displacement);
    float fraction = 0;
    for (int i = 0; i < maxSteps; ++i) {
        const NearestPoint here = nearest(start + fraction * displacement, length);
        if (here.distance <= tolerance) return PathHit{fraction, here};
        const float approach = -glm::dot(here.normal, displacement);
        if (!(approach > 0) || fraction >= 1) break;
        fraction = std::min(fraction + here.distance / approach, 1.f);
    }
    return std::nullopt;
}

}  // namespace bilayer::detail
