// SPDX-License-Identifier: Apache-2.0
// The distance between two triangle meshes.
// Tested by tests/collider/distance.cpp through distance().
#pragma once

#include <cstdint>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/vec3.hpp>
#include <limits>

#include "collider/contact/distance/triangle_distance.h"
#include "collider/field/triangles/mesh_tree.h"

namespace bilayer::detail {

/// A transform between the coordinates of two meshes that preserves angles: x maps to scale * rotation * x + shift.
struct Similarity {
    glm::dmat3 rotation{1};
    double scale = 1;
    glm::dvec3 shift{0};

    glm::dvec3 operator()(const glm::dvec3& point) const { return scale * (rotation * point) + shift; }
    glm::dvec3 inverse(const glm::dvec3& point) const { return (point - shift) * rotation / scale; }
    Similarity inverted() const { return {glm::transpose(rotation), 1 / scale, inverse({0, 0, 0})}; }
    /// The inverse of `to` after this.
    Similarity into(const Similarity& to) const {
        return {glm::transpose(to.rotation) * rotation, scale / to.scale, to.inverse(shift)};
    }
};

/// The closest points of two meshes, in coordinates of the second.
struct MeshDistance {
    std::uint32_t triangleA = noTriangle, triangleB = noTriangle;  ///< `noTriangle`: nothing within the bound
    TrianglePoint a, b;
    double distance = std::numeric_limits<double>::infinity();  ///< 0 if triangles intersect [m]

    bool found() const { return triangleA != noTriangle; }
};

/// Triangles to start a search from: those of the last answer, or `noTriangle`.
struct TriangleIndices {
    std::uint32_t a = noTriangle, b = noTriangle;
};

/// Finds the closest triangles by a simultaneous traversal of the two hierarchies. The distance is exact to 1e-6 of the
/// size of the meshes. Allocates nothing.
/// @param aToB         maps coordinates of the first mesh to those of the second
/// @param maxDistance  finds nothing beyond this distance [m of the second mesh]
MeshDistance distanceBetween(const MeshTree& a, const MeshTree& b, const Similarity& aToB, double maxDistance,
                             const TriangleIndices& start = {});

}  // namespace bilayer::detail
