// SPDX-License-Identifier: Apache-2.0
// The surfaces that points and spheres of moving bodies may enter, each in its own coordinates and units. Each has
//
// - bool isOpen: whether the surface has no inside;
// - std::optional<SurfaceEntry> entry(from, to, radius): where a sphere on a straight path first touches the surface;
//   the start of the path if the sphere is inside there. `from` and `to` may be equal unless the surface is open;
// - std::optional<glm::vec3> depenetration(point, radius): the displacement that moves a sphere out; nothing if it is
//   unknown. An open surface has no such function;
// - bool isNear(from, to, radius): whether a sphere on a straight path may touch the surface.
//
// The radius of entry() and depenetration() is zero for all but FieldSurface.
// Tested by tests/collider/time_of_impact.cpp through timeOfImpact().
#pragma once

#include <glm/vec3.hpp>
#include <optional>

#include <bilayer/collider/field.h>
#include "collider/contact/shapes/convex.h"
#include "collider/contact/shapes/shape_data.h"

namespace bilayer::detail {

/// Where a path enters a surface.
struct SurfaceEntry {
    glm::vec3 position, normal;  ///< the normal points outward and has unit length
};

class FieldSurface {
  public:
    static constexpr bool isOpen = false;

    FieldSurface(const Collider& collider, float voxel) : field_(collider.field()), voxel_(voxel) {}

    std::optional<SurfaceEntry> entry(const glm::vec3& from, const glm::vec3& to, float radius) const;
    std::optional<glm::vec3> depenetration(const glm::vec3& point, float radius) const;
    bool isNear(const glm::vec3& from, const glm::vec3& to, float radius) const;

  private:
    bool staysOut(const glm::vec3& from, const glm::vec3& to, float radius) const;
    bool overlaps(const glm::vec3& point, float radius) const;

    const Field& field_;
    float voxel_;
};

class ConvexSurface {
  public:
    static constexpr bool isOpen = false;

    ConvexSurface(const Convex& convex, float voxel) : convex_(convex), voxel_(voxel) {}

    std::optional<SurfaceEntry> entry(const glm::vec3& from, const glm::vec3& to, float) const;
    std::optional<glm::vec3> depenetration(const glm::vec3& point, float) const;
    bool isNear(const glm::vec3& from, const glm::vec3& to, float radius) const;

  private:
    const Convex& convex_;
    float voxel_;
};

class PlaneSurface {
  public:
    static constexpr bool isOpen = false;

    PlaneSurface(const HalfSpace& solid, float voxel) : solid_(solid), voxel_(voxel) {}

    std::optional<SurfaceEntry> entry(const glm::vec3& from, const glm::vec3& to, float) const;
    std::optional<glm::vec3> depenetration(const glm::vec3& point, float) const;
    bool isNear(const glm::vec3& from, const glm::vec3& to, float radius) const;

  private:
    float heightOf(const glm::vec3& point) const;

    const HalfSpace& solid_;
    float voxel_;
};

class TriangleSurface {
  public:
    static constexpr bool isOpen = true;

    TriangleSurface(const OpenSurface& openSurface, float) : openSurface_(openSurface) {}

    std::optional<SurfaceEntry> entry(const glm::vec3& from, const glm::vec3& to, float) const;
    bool isNear(const glm::vec3& from, const glm::vec3& to, float radius) const;

  private:
    const OpenSurface& openSurface_;
};

/// The surface of each kind of shape.
/// @param voxel  the unit of tolerances, in the surface's own units
inline FieldSurface surfaceOf(const Collider& shape, float voxel) {
    return {shape, voxel};
}
inline ConvexSurface surfaceOf(const Convex& shape, float voxel) {
    return {shape, voxel};
}
inline PlaneSurface surfaceOf(const HalfSpace& shape, float voxel) {
    return {shape, voxel};
}
inline TriangleSurface surfaceOf(const OpenSurface& shape, float voxel) {
    return {shape, voxel};
}

}  // namespace bilayer::detail
