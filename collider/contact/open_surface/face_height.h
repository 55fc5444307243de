// SPDX-License-Identifier: Apache-2.0
// Whether the height of a field's surface point over a triangle is the exact distance of the two.
// Tested by tests/bullet/sliding.cpp through bullet::Dispatcher.
#pragma once

#include <glm/vec3.hpp>

#include "collider/contact/body/surface_points.h"
#include "collider/contact/open_surface/nearby_triangles.h"
#include "collider/contact/search/probed_field.h"

namespace bilayer::detail {

/// A point is over a face if it is no farther beyond its edges than this [probe spacings]: rounding.
inline constexpr float onFace = 1e-4f;
/// A body closer than this to a point of the face touches the face [voxels]: next to an edge or a vertex, normals are
/// mixed.
inline constexpr float touchingDistanceVoxels = 0.05f;
/// Below this cosine to the face, a normal does not indicate the side of the face that its body is on.
inline constexpr float minFacing = 0.1f;

class FaceHeight {
  public:
    FaceHeight(const ProbedField& field, const NearbyTriangles& triangles) : field_(field), triangles_(triangles) {}

    /// Whether the height of a surface point over a face is its exact distance. It is for a point whose surface is
    /// parallel to the face, for a vertex that points to the face, and for an edge along it.
    ///
    /// It may be wrong in these cases:
    /// - An oblique point may have passed an edge of the open surface.
    /// - A point on the far side of a thin body may point away from triangles that have not reached it: the near side
    ///   is then nearer to its foot.
    /// - The sides of a penetrating convex vertex are nearer in the same way.
    /// @param normal  of the face, on the side that the point faces
    /// @param height  over the point
    /// @param foot    the field at the foot, which is the projection of the point onto the face
    bool isExact(std::uint32_t index, const glm::vec3& normal, float height, const LocalField::FieldSample& foot) const;

    /// Whether the field's surface at a place has an edge within the spacing of its points: beyond it, the normal is
    /// another one, at present or during the rotation in the step. Without an edge the surface continues deeper, and
    /// touches elsewhere: at a farther edge, or at the border of the face.
    bool hasEdgeNear(const glm::vec3& place, const glm::vec3& surfaceNormal, const glm::vec3& normal) const;

    bool isConvexVertex(std::uint32_t index, const glm::vec3& normal) const;

    /// The distance from a convex vertex back along its axis to the plane of a face that it is below.
    static float distanceAlongAxis(const SurfacePoint& vertex, const glm::vec3& normal, float height);

    /// Whether a convex vertex under a face has penetrated it: its body continues behind the face. If the vertex is
    /// deeper than a voxel, three more conditions hold: the opposite wall of the body is farther away, the vertex's
    /// axis meets the triangles, and no other triangle is nearer to the vertex.
    /// @param distance  along its axis to the triangles
    bool hasPenetrated(const SurfacePoint& vertex, const glm::vec3& normal, float height, float distance) const;

  private:
    bool hasEdgeNearNow(const glm::vec3& place, const glm::vec3& surfaceNormal, const glm::vec3& normal) const;

    const ProbedField& field_;
    const NearbyTriangles& triangles_;
};

}  // namespace bilayer::detail
