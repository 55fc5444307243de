// What points may not pass through, each in its own coordinates and units; internal. All have
//
//   std::optional<Entry> entry(from, to, radius)      where a ball enters on a straight way; its start if it is inside
//   std::optional<glm::vec3> wayOut(point, radius)    for a ball that is inside; none where that is not known
//
// and a bound() of the distance of their surface, or, of sheets, isNear().
#pragma once

#include <BulletCollision/CollisionShapes/btConcaveShape.h>
#include <BulletCollision/CollisionShapes/btStaticPlaneShape.h>

#include <glm/vec3.hpp>
#include <optional>

#include <bilayer/collider/field.h>
#include "integration/bullet/detail/convex.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

/// Where a way enters an obstacle.
struct Entry {
    glm::vec3 position, normal;  ///< outward, of unit length
};

class FieldSurface {
  public:
    explicit FieldSurface(const Field& field) : field_(field) {}

    /// Not more than the distance of its surface.
    float bound(const glm::vec3& point) const;
    std::optional<Entry> entry(const glm::vec3& from, const glm::vec3& to, float radius) const;
    std::optional<glm::vec3> wayOut(const glm::vec3& point, float radius) const;

  private:
    bool staysOut(const glm::vec3& from, const glm::vec3& to, float radius) const;
    bool overlaps(const glm::vec3& point, float radius) const;

    const Field& field_;
};

/// For points.
class ConvexSurface {
  public:
    /// @param tolerance  how near counts as entered [m]
    ConvexSurface(const Convex& convex, float tolerance) : convex_(convex), tolerance_(tolerance) {}

    float bound(const glm::vec3& point) const;
    std::optional<Entry> entry(const glm::vec3& from, const glm::vec3& to, float) const;
    std::optional<glm::vec3> wayOut(const glm::vec3& point, float) const;

  private:
    const Convex& convex_;
    float tolerance_;
};

/// For points.
class PlaneSurface {
  public:
    explicit PlaneSurface(const btStaticPlaneShape& shape);

    float bound(const glm::vec3& point) const;
    std::optional<Entry> entry(const glm::vec3& from, const glm::vec3& to, float) const;
    std::optional<glm::vec3> wayOut(const glm::vec3& point, float) const;

  private:
    glm::vec3 normal_;
    float offset_;
};

/// The triangles of a mesh or a height field, for points: sheets, which nothing is inside of.
class TriangleSurface {
  public:
    explicit TriangleSurface(const btConcaveShape& mesh) : mesh_(mesh) {}

    std::optional<Entry> entry(const glm::vec3& from, const glm::vec3& to, float) const;
    std::optional<glm::vec3> wayOut(const glm::vec3&, float) const { return std::nullopt; }
    /// Whether a ball comes near any on a straight way.
    bool isNear(const glm::vec3& from, const glm::vec3& to, float radius) const;

  private:
    void visit(const glm::vec3& lower, const glm::vec3& upper, btTriangleCallback& callback) const;

    const btConcaveShape& mesh_;
};

}  // namespace bilayer::bullet::detail
