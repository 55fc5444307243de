// SPDX-License-Identifier: Apache-2.0
// A step of C. G. J. Jacobi's method for the eigenvectors of a symmetric matrix.
// Tested by tests/collider/mass.cpp through massProperties().
#pragma once

#include <cmath>
#include <glm/mat3x3.hpp>

namespace bilayer::detail {

/// The rotation R in the plane of axes p and q for which the entry (p, q) of R^T M R vanishes. The entry must not be
/// zero. Of the two possible angles, it takes the smaller one.
template <class Real>
glm::mat<3, 3, Real> jacobiRotation(const glm::mat<3, 3, Real>& m, int p, int q) {
    const Real twice = (m[q][q] - m[p][p]) / (2 * m[p][q]);
    const Real tangent = std::copysign(1 / (std::abs(twice) + std::sqrt(twice * twice + 1)), twice);
    glm::mat<3, 3, Real> rotation(1);
    rotation[p][p] = rotation[q][q] = 1 / std::sqrt(tangent * tangent + 1);
    rotation[q][p] = tangent * rotation[p][p], rotation[p][q] = -rotation[q][p];
    return rotation;
}

}  // namespace bilayer::detail
