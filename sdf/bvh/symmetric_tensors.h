// SPDX-License-Identifier: Apache-2.0
// Symmetric tensors of order two and three in 3D: the moments of the triangles of a cluster.
// Tested by tests/sdf/winding.cpp.
#pragma once

#include <array>
#include <cstddef>
#include <glm/vec3.hpp>

namespace bilayer::detail {

/// The components xx, yy, zz, xy, yz, zx.
using Symmetric2 = std::array<double, 6>;
/// The components xxx, yyy, zzz, xxy, xxz, yyx, yyz, zzx, zzy, xyz.
using Symmetric3 = std::array<double, 10>;

/// Returns the symmetric part of a b^T.
inline Symmetric2 product(const glm::dvec3& a, const glm::dvec3& b) {
    return {a.x * b.x,
            a.y * b.y,
            a.z * b.z,
            0.5 * (a.x * b.y + a.y * b.x),
            0.5 * (a.y * b.z + a.z * b.y),
            0.5 * (a.z * b.x + a.x * b.z)};
}

/// Returns the symmetric part of m (x) v.
inline Symmetric3 product(const Symmetric2& m, const glm::dvec3& v) {
    const auto& [xx, yy, zz, xy, yz, zx] = m;
    const double third = 1.0 / 3;
    return {xx * v.x,
            yy * v.y,
            zz * v.z,
            third * (xx * v.y + 2 * xy * v.x),
            third * (xx * v.z + 2 * zx * v.x),
            third * (yy * v.x + 2 * xy * v.y),
            third * (yy * v.z + 2 * yz * v.y),
            third * (zz * v.x + 2 * zx * v.z),
            third * (zz * v.y + 2 * yz * v.z),
            third * (xy * v.z + yz * v.x + zx * v.y)};
}

/// Adds a multiple of a tensor.
template <std::size_t n>
void add(std::array<double, n>& sum, const std::array<double, n>& part, double times = 1) {
    for (std::size_t i = 0; i < n; ++i) sum[i] += times * part[i];
}

/// Returns a tensor applied to one vector in all places.
inline double cubic(const Symmetric3& t, const glm::dvec3& u) {
    return t[0] * u.x * u.x * u.x + t[1] * u.y * u.y * u.y + t[2] * u.z * u.z * u.z +
           3 * (u.x * u.x * (t[3] * u.y + t[4] * u.z) + u.y * u.y * (t[5] * u.x + t[6] * u.z) +
                u.z * u.z * (t[7] * u.x + t[8] * u.y)) +
           6 * t[9] * u.x * u.y * u.z;
}

/// Returns the trace of a tensor, applied to a vector.
inline double trace(const Symmetric3& t, const glm::dvec3& u) {
    return (t[0] + t[5] + t[7]) * u.x + (t[1] + t[3] + t[8]) * u.y + (t[2] + t[4] + t[6]) * u.z;
}

}  // namespace bilayer::detail
