// SPDX-License-Identifier: Apache-2.0
// Mass properties of simple solids of density 1, by formula.
#pragma once

#include <algorithm>
#include <glm/gtc/constants.hpp>
#include <glm/vec3.hpp>

#include <bilayer/collider/mass.h>

namespace bilayer::test {

// By formula; the moments are those about x, y and z.
inline MassProperties massOf(double volume, const glm::vec3& moments, const glm::vec3& centre = glm::vec3(0)) {
    MassProperties mass;
    mass.volume = volume;
    mass.centre = centre;
    for (int axis = 0; axis < 3; ++axis) mass.inertia[axis][axis] = moments[axis];
    mass.principalInertia = moments;
    std::sort(&mass.principalInertia.x, &mass.principalInertia.x + 3);
    return mass;
}

inline MassProperties ballMass(double radius, const glm::vec3& centre = glm::vec3(0)) {
    const double volume = 4. / 3 * glm::pi<double>() * radius * radius * radius;
    return massOf(volume, glm::vec3(0.4 * volume * radius * radius), centre);
}

inline MassProperties boxMass(const glm::dvec3& half) {
    const double volume = 8 * half.x * half.y * half.z;
    const glm::dvec3 squared = half * half;
    return massOf(volume, volume / 3 * (glm::dvec3(squared.x + squared.y + squared.z) - squared));
}

inline MassProperties torusMass(double major, double minor) {
    const double volume = 2 * glm::pi<double>() * glm::pi<double>() * major * minor * minor;
    const double across = volume * (0.5 * major * major + 0.625 * minor * minor);
    return massOf(volume, glm::dvec3(across, across, volume * (major * major + 0.75 * minor * minor)));
}

}  // namespace bilayer::test
