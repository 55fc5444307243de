// SPDX-License-Identifier: Apache-2.0
// Tests of single triangles against rays, swept spheres and boxes in double precision; internal.
// Tested by tests/collider/mesh_rays.cpp.
#pragma once

#include <cstdint>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "collider/field/layout/path.h"
#include "collider/field/triangles/mesh_tree.h"
#include "sdf/base/triangle_corners.h"

namespace bilayer::detail {

/// A ray in its sheared ray space: S. Woop, C. Benthin, I. Wald, "Watertight ray/triangle intersection", JCGT 2 (2013)
/// 65-82.
class TriangleRay {
  public:
    /// @param direction  of unit length
    /// @param tolerance  rays hit a triangle if they pass it within this distance
    TriangleRay(const glm::dvec3& start, const glm::dvec3& direction, double tolerance);

    /// Whether the ray hits a triangle before `along`, which then becomes the distance of the hit. A ray that starts on
    /// the triangle hits it only if it enters there.
    bool meets(const TriangleCorners& corners, double& along, glm::dvec3& position) const;

  private:
    glm::dvec3 sheared(const glm::dvec3& corner) const;
    bool passesEdge(const TriangleCorners& projected, glm::dvec3& weights) const;

    glm::dvec3 start_;
    double tolerance_;
    int x_, y_, z_;
    double perZ_, shearX_, shearY_;
};

/// Whether a swept sphere touches a triangle before `along`, which then becomes the distance of the contact. The radius
/// must be positive.
bool touches(const MeshTree& mesh, std::uint32_t triangle, const Path& path, double radius, double& along,
             glm::dvec3& position);

/// An oriented box.
struct RotatedBox {
    glm::dvec3 centre;
    glm::dmat3 axes;  ///< columns of unit length
    glm::dvec3 halfSize;
};

/// Whether a box and a triangle overlap: T. Akenine-Moeller, "Fast 3D triangle-box overlap testing", Journal of
/// Graphics Tools 6 (2001) 29-33.
bool overlaps(const RotatedBox& box, const TriangleCorners& corners);

}  // namespace bilayer::detail
