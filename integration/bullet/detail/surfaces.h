// SPDX-License-Identifier: Apache-2.0
// The surfaces for continuous collision, each in its own coordinates and units. All have
//
// - std::optional<SurfaceEntry> entry(from, to, radius): where a sphere enters on a straight path; its start if inside;
// - std::optional<glm::vec3> depenetration(point, radius): the displacement to the surface of a sphere that is inside;
//   none if unknown;
// - a bound() of the distance to their surface. Open surfaces have isNear() instead.
// Tested by tests/bullet/continuous_collision.cpp.
#pragma once

#include <BulletCollision/CollisionShapes/btConcaveShape.h>
#include <BulletCollision/CollisionShapes/btStaticPlaneShape.h>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <optional>

#include <bilayer/collider/field.h>
#include "integration/bullet/detail/convex.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

/// Where a path enters a surface.
struct SurfaceEntry {
    glm::vec3 position, normal;  ///< the normal points outward and has unit length
};

/// Whether a path stays clear of a surface, by strides of the clearance. A path that takes too many strides counts as
/// not clear.
/// @param minClearance  at each stride, positive
/// @param clearanceAt   float (const glm::vec3&): a lower bound of the distance from the surface
template <class ClearanceAt>
bool staysClear(const glm::vec3& from, const glm::vec3& to, float minClearance, ClearanceAt&& clearanceAt) {
    constexpr int maxStrides = 64;
    const float length = glm::distance(from, to);
    float travelled = 0;
    for (int i = 0; i < maxStrides && travelled <= length; ++i) {
        const float clearance = clearanceAt(length > 0 ? from + travelled / length * (to - from) : from);
        if (clearance < minClearance) return false;
        travelled += clearance;
    }
    return travelled > length;
}

class FieldSurface {
  public:
    explicit FieldSurface(const Field& field) : field_(field) {}

    /// A lower bound of the distance to the surface.
    float bound(const glm::vec3& point) const;
    std::optional<SurfaceEntry> entry(const glm::vec3& from, const glm::vec3& to, float radius) const;
    std::optional<glm::vec3> depenetration(const glm::vec3& point, float radius) const;

  private:
    bool staysOut(const glm::vec3& from, const glm::vec3& to, float radius) const;
    bool overlaps(const glm::vec3& point, float radius) const;

    const Field& field_;
};

/// For points.
class ConvexSurface {
  public:
    /// @param tolerance  distance that counts as entered [m]
    ConvexSurface(const Convex& convex, float tolerance) : convex_(convex), tolerance_(tolerance) {}

    float bound(const glm::vec3& point) const;
    std::optional<SurfaceEntry> entry(const glm::vec3& from, const glm::vec3& to, float) const;
    std::optional<glm::vec3> depenetration(const glm::vec3& point, float) const;

  private:
    const Convex& convex_;
    float tolerance_;
};

/// For points.
class PlaneSurface {
  public:
    explicit PlaneSurface(const btStaticPlaneShape& shape);

    float bound(const glm::vec3& point) const;
    std::optional<SurfaceEntry> entry(const glm::vec3& from, const glm::vec3& to, float) const;
    std::optional<glm::vec3> depenetration(const glm::vec3& point, float) const;

  private:
    glm::vec3 normal_;
    float offset_;
};

/// The triangles of a mesh or a height field, for points: an open surface, which has no inside.
class TriangleSurface {
  public:
    explicit TriangleSurface(const btConcaveShape& mesh) : mesh_(mesh) {}

    std::optional<SurfaceEntry> entry(const glm::vec3& from, const glm::vec3& to, float) const;
    std::optional<glm::vec3> depenetration(const glm::vec3&, float) const { return std::nullopt; }
    /// Whether a sphere comes near any triangle on a straight path.
    bool isNear(const glm::vec3& from, const glm::vec3& to, float radius) const;

  private:
    void visit(const glm::vec3& lower, const glm::vec3& upper, btTriangleCallback& callback) const;

    const btConcaveShape& mesh_;
};

}  // namespace bilayer::bullet::detail
