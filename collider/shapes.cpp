// SPDX-License-Identifier: Apache-2.0
#include <bilayer/collider/shapes.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <utility>

#include "collider/contact/shapes/hull.h"
#include "collider/contact/shapes/shape_data.h"
#include "sdf/base/finite.h"
#include "sdf/base/required_numbers.h"

namespace bilayer {

using namespace detail;

namespace {

/// The coordinate of the axis of solids of revolution.
constexpr int upAxis = 1;

}  // namespace

ContactShape::ContactShape(Collider collider) : ContactShape(ContactShapeData{std::move(collider)}) {}

ContactShape::ContactShape(ContactShapeData data) : data_(std::make_shared<const ContactShapeData>(std::move(data))) {}

const Collider* ContactShape::collider() const {
    return std::get_if<Collider>(&data_->shape);
}

ContactShape ContactShape::sphere(float radius) {
    requirePositive(radius, "the radius");
    return ContactShape(ContactShapeData{Convex::segment(upAxis, 0, radius)});
}

ContactShape ContactShape::box(const glm::vec3& halfExtents) {
    for (int axis = 0; axis < 3; ++axis) requirePositive(halfExtents[axis], "the half extent");
    return ContactShape(ContactShapeData{Convex::box(halfExtents)});
}

ContactShape ContactShape::capsule(float radius, float halfHeight) {
    requirePositive(radius, "the radius");
    requireNotNegative(halfHeight, "the half height");
    return ContactShape(ContactShapeData{Convex::segment(upAxis, halfHeight, radius)});
}

ContactShape ContactShape::cylinder(float radius, float halfHeight) {
    requirePositive(radius, "the radius");
    requirePositive(halfHeight, "the half height");
    return ContactShape(ContactShapeData{Convex::revolution(upAxis, halfHeight, radius, radius, 0)});
}

ContactShape ContactShape::cone(float radius, float halfHeight) {
    requirePositive(radius, "the radius");
    requirePositive(halfHeight, "the half height");
    return ContactShape(ContactShapeData{Convex::revolution(upAxis, halfHeight, radius, 0, 0)});
}

ContactShape ContactShape::hull(std::span<const glm::vec3> points, float radius) {
    requireNotNegative(radius, "the radius");
    return ContactShape(ContactShapeData{Convex::hull(convexHullOf(points), radius)});
}

ContactShape ContactShape::spheres(std::span<const SphereOfHull> spheres) {
    float largest = 0;
    for (const SphereOfHull& sphere : spheres) {
        requireNotNegative(sphere.radius, "the radius of a sphere");
        if (!isFinite(sphere.centre)) throw std::invalid_argument("the centre of a sphere is not finite");
        largest = std::max(largest, sphere.radius);
    }
    if (!(largest > 0)) throw std::invalid_argument("the radii are all 0, and one must be above 0");
    return ContactShape(ContactShapeData{Convex::spheres({spheres.begin(), spheres.end()})});
}

ContactShape ContactShape::plane(const glm::vec3& normal, float offset) {
    const float length = glm::length(normal);
    requirePositive(length, "the length of the normal");
    if (!std::isfinite(offset)) throw std::invalid_argument("the offset of the plane is not finite");
    return ContactShape(ContactShapeData{HalfSpace{normal / length, offset}});
}

ContactShape ContactShape::triangles(OpenSurface openSurface) {
    if (!openSurface.visit)
        throw std::invalid_argument("OpenSurface::visit is empty; it must pass the triangles in a box");
    return ContactShape(ContactShapeData{std::move(openSurface)});
}

}  // namespace bilayer
