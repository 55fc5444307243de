// Sums over a solid that its mass properties follow from; what mesh and field have in common.
#pragma once

#include <glm/mat3x3.hpp>

#include <bilayer/collider/mass.h>

namespace bilayer::detail {

/// The integrals of 1, x and x x^T over a solid, in any one unit of length.
struct Moments {
    double volume = 0;
    glm::dvec3 first{0};
    glm::dmat3 second{0};

    /// Adds a box, or what a box of no width in some direction stands for: `part` is its volume, negative to take away.
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

/// From moments about `origin`, whose volume is above zero [m].
MassProperties massProperties(const Moments& moments, const glm::dvec3& origin);

}  // namespace bilayer::detail
