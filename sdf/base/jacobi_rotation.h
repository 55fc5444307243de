// SPDX-License-Identifier: Apache-2.0
// C. G. J. Jacobi's method for the eigenvectors of a symmetric matrix.
// Tested by tests/collider/mass.cpp through massProperties().
#pragma once

#include <cmath>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <limits>

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

/// The eigenvectors of a symmetric matrix as columns, in no order, to about the precision of its numbers.
template <class Real>
glm::mat<3, 3, Real> eigenvectors(glm::mat<3, 3, Real> m) {
    constexpr int passes = 6;  // each nearly squares the remainder off the diagonal
    glm::mat<3, 3, Real> vectors(1);
    for (int pass = 0; pass < passes; ++pass)
        for (int p = 0; p < 3; ++p) {
            const int q = (p + 1) % 3;
            if (std::abs(m[p][q]) <= std::numeric_limits<Real>::min()) continue;
            const glm::mat<3, 3, Real> rotation = jacobiRotation(m, p, q);
            m = glm::transpose(rotation) * m * rotation;
            vectors = vectors * rotation;
        }
    return vectors;
}

}  // namespace bilayer::detail
