// SPDX-License-Identifier: Apache-2.0
// Volume, centre and inertia as sums over tetrahedra, and the principal axes by Jacobi's rotations.
#include <bilayer/collider/mass.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_access.hpp>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

#include "collider/field/layout/moments.h"
#include "sdf/base/jacobi_rotation.h"
#include "sdf/mesh/unite.h"

namespace bilayer {

using namespace detail;

namespace {

constexpr double minThickness = 1e-7;  // of volume / (area * length): single-precision noise of a flat surface
constexpr int maxSweeps = 32;          // of Jacobi's method, which needs about five

struct Integrals : Moments {
    double area = 0;
};

// Integrals over the tetrahedra between `centre`, which becomes the origin, and the triangles. A triangle that has
// copies counts as one part of their count; without counts, triangles have no copies.
Integrals integrate(const Mesh& mesh, const std::vector<int>& copies, const glm::dvec3& centre) {
    Integrals sum;
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        const glm::uvec3& t = mesh.triangles[i];
        const glm::dvec3 a = glm::dvec3(mesh.points[t.x]) - centre, b = glm::dvec3(mesh.points[t.y]) - centre,
                         c = glm::dvec3(mesh.points[t.z]) - centre, s = a + b + c;
        const double part = copies.empty() ? 1 : 1.0 / copies[i], det = part * glm::dot(a, glm::cross(b, c));
        sum.volume += det / 6;
        sum.first += det / 24 * s;
        sum.second +=
            det / 120 *
            (glm::outerProduct(a, a) + glm::outerProduct(b, b) + glm::outerProduct(c, c) + glm::outerProduct(s, s));
        sum.area += part * glm::length(glm::cross(b - a, c - a)) / 2;
    }
    return sum;
}

MassProperties massOf(const Mesh& mesh, const std::vector<int>& copies) {
    const Bounds box = bounds(mesh);
    const glm::dvec3 origin = 0.5 * (glm::dvec3(box.lower) + glm::dvec3(box.upper));
    Integrals sum = integrate(mesh, copies, origin);
    if (!(std::abs(sum.volume) > minThickness * sum.area * double(box.longestSide())))
        throw std::invalid_argument("the mesh encloses no volume");
    if (sum.volume < 0) {
        sum.volume = -sum.volume;
        sum.first = -sum.first;
        sum.second = -sum.second;
    }
    const MassProperties result = massProperties(sum, origin);
    if (!(result.principalInertia.x > 0)) throw std::invalid_argument("the mesh does not bound a solid");
    return result;
}

struct Eigen {
    glm::dvec3 values;   // ascending
    glm::dmat3 vectors;  // right-handed columns
};

// Rotates in the plane of axes p and q so that the entry (p, q) vanishes.
void rotate(glm::dmat3& matrix, glm::dmat3& vectors, int p, int q) {
    if (matrix[p][q] == 0) return;
    const glm::dmat3 rotation = jacobiRotation(matrix, p, q);
    matrix = glm::transpose(rotation) * matrix * rotation;
    matrix[p][q] = matrix[q][p] = 0;
    vectors = vectors * rotation;
}

Eigen eigen(glm::dmat3 matrix) {
    glm::dmat3 vectors(1);
    const double negligible = 1e-30 * glm::dot(matrix[0] + matrix[1] + matrix[2], matrix[0] + matrix[1] + matrix[2]);
    for (int sweep = 0; sweep < maxSweeps; ++sweep) {
        const glm::dvec3 off(matrix[0][1], matrix[0][2], matrix[1][2]);
        if (glm::dot(off, off) <= negligible) break;
        rotate(matrix, vectors, 0, 1);
        rotate(matrix, vectors, 0, 2);
        rotate(matrix, vectors, 1, 2);
    }
    std::array<int, 3> order{0, 1, 2};
    std::stable_sort(order.begin(), order.end(), [&](int i, int j) { return matrix[i][i] < matrix[j][j]; });
    Eigen result;
    for (int i = 0; i < 3; ++i) {
        result.values[i] = matrix[order[i]][order[i]];
        result.vectors[i] = vectors[order[i]];
    }
    if (glm::determinant(result.vectors) < 0) result.vectors[2] = -result.vectors[2];
    return result;
}

}  // namespace

MassProperties detail::massProperties(const Moments& moments, const glm::dvec3& origin) {
    const glm::dvec3 centre = moments.first / moments.volume;
    const glm::dmat3 second = moments.second - moments.volume * glm::outerProduct(centre, centre);
    const glm::dmat3 inertia = glm::dmat3(second[0][0] + second[1][1] + second[2][2]) - second;
    const Eigen principal = eigen(inertia);
    const glm::dquat axes = glm::normalize(glm::quat_cast(principal.vectors));

    MassProperties result;
    result.volume = moments.volume;
    result.centre = glm::vec3(centre + origin);
    result.inertia = glm::mat3(inertia);
    result.principalInertia = glm::vec3(principal.values);
    result.principalAxes = glm::quat(axes);
    const double smallest = principal.values[0], largest = principal.values[2];
    if (smallest > 0 &&
        !(smallest >= std::numeric_limits<float>::min() && largest <= std::numeric_limits<float>::max()))
        throw std::invalid_argument("the moments of inertia are beyond single precision: scale the mesh");
    return result;
}

MassProperties detail::unionMass(const Mesh& closed) {
    const LabelledMesh boundary = unionBoundary(closed);
    if (boundary.mesh.triangles.empty()) throw std::invalid_argument("the mesh encloses no volume");
    return massOf(boundary.mesh, boundary.labels);
}

MassProperties massProperties(const Mesh& mesh) {
    validate(mesh);
    return massOf(mesh, {});
}

}  // namespace bilayer
