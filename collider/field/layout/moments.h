// SPDX-License-Identifier: Apache-2.0
// Volume integrals that mass properties are computed from, for meshes and fields.
// Tested by tests/collider/mass.cpp.
#pragma once

#include <glm/mat3x3.hpp>

#include <bilayer/collider/mass.h>

namespace bilayer::detail {

/// The integrals of 1, x and x x^T over a solid, in any one unit of length.
struct Moments {
    double volume = 0;
    glm::dvec3 first{0};
    glm::dmat3 second{0};

    /// Adds a box of volume `part`, negative to subtract it. Sizes of zero along some axes stand for infinitely thin
    /// boxes.
    void add(double part, const glm::dvec3& centre, const glm::dvec3& size) {
        volume += part;
        first += part * centre;
        second += part * glm::outerProduct(centre, centre);
        for (int axis = 0; axis < 3; ++axis) second[axis][axis] += part / 12 * size[axis] * size[axis];
    }

    Moments& operator+=(const Moments& other) {
        volume += other.volume;
        first += other.first;
        second += other.second;
        return *this;
    }
};

/// From moments about `origin` with a positive volume [m].
MassProperties massProperties(const Moments& moments, const glm::dvec3& origin);

/// Mass properties of the union of a closed mesh's solids: of the points whose winding number is above 1/2. Exact up to
/// the rounding of floats, also where solids intersect or lie flush. Takes longer than massProperties(), which counts
/// intersections twice.
/// @param closed  balanced()
/// Throws as massProperties() does.
MassProperties unionMass(const Mesh& closed);

}  // namespace bilayer::detail
