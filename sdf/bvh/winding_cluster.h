// SPDX-License-Identifier: Apache-2.0
// The winding number of some triangles as seen from afar, by their moments.
// Tested by tests/sdf/winding.cpp through WindingNumber.
#pragma once

#include <array>
#include <glm/vec3.hpp>
#include <span>

#include <bilayer/sdf/mesh.h>
#include "sdf/bvh/symmetric_tensors.h"

namespace bilayer::detail {

/// The true winding number differs from `value` by at most `error`, plus rounding (about 1e-12).
struct WindingEstimate {
    double value, error;
};

/// The moments of triangles about a centre: integrals over the triangles. There, s is the vector from the centre to a
/// point, and n the unit normal.
struct WindingCluster {
    using Corners = std::array<glm::vec3, 3>;

    /// An expansion with a larger error bound is of no use. This also keeps sums of errors accurate.
    static constexpr double uselessError = 10;

    WindingCluster() = default;
    explicit WindingCluster(std::span<const Corners> triangles);
    /// The cluster of two others.
    /// @param box  contains their triangles
    WindingCluster(const WindingCluster& left, const WindingCluster& right, const Bounds& box);

    /// The winding number of the triangles at a point, by an expansion to second order. The value is 0 if the error
    /// exceeds `uselessError`.
    WindingEstimate expansion(const glm::dvec3& point) const;

    glm::dvec3 centre;  ///< area-weighted
    double radius;      ///< of a ball around `centre` that contains all triangles
    double area;
    glm::dvec3 vectorArea;  ///< of n
    Symmetric2 moment;      ///< of s n^T, symmetric part
    Symmetric3 moment2;     ///< of s s^T (x) n, symmetric part
    double spread;          ///< of |s|^2
};

}  // namespace bilayer::detail
