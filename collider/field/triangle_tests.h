// Single triangles in double precision against rays, spheres on their way, and boxes; internal.
#pragma once

#include <array>
#include <cstdint>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "collider/field/mesh_tree.h"
#include "collider/field/path.h"

namespace bilayer::detail {

using Corners = std::array<glm::dvec3, 3>;

inline Corners cornersOf(const Mesh& mesh, std::uint32_t triangle) {
    const glm::uvec3& t = mesh.triangles[triangle];
    return {mesh.points[t.x], mesh.points[t.y], mesh.points[t.z]};
}

/// A ray seen along itself: S. Woop, C. Benthin, I. Wald, "Watertight ray/triangle intersection", JCGT 2 (2013) 65-82.
class TriangleRay {
  public:
    /// @param direction  of unit length
    /// @param tolerance  triangles are met by what passes no farther beside them
    TriangleRay(const glm::dvec3& start, const glm::dvec3& direction, double tolerance);

    /// Where the ray meets a triangle, if that is before `along`, which it then becomes. One that starts on the
    /// triangle meets it on the way in only.
    bool meets(const Corners& corners, double& along, glm::dvec3& position) const;

  private:
    glm::dvec3 sheared(const glm::dvec3& corner) const;
    bool besideEdge(const Corners& seen, glm::dvec3& weights) const;

    glm::dvec3 start_;
    double tolerance_;
    int x_, y_, z_;
    double perZ_, shearX_, shearY_;
};

/// When a sphere on its way first touches a triangle, if that is before `along`, which it then becomes. The radius must
/// be positive.
bool touches(const MeshTree& mesh, std::uint32_t triangle, const Path& path, double radius, double& along,
             glm::dvec3& position);

/// A box with axes of its own.
struct TurnedBox {
    glm::dvec3 centre;
    glm::dmat3 axes;  ///< columns of unit length
    glm::dvec3 halfSize;
};

/// Whether a box and a triangle have a point in common: T. Akenine-Moeller, "Fast 3D triangle-box overlap testing",
/// Journal of Graphics Tools 6 (2001) 29-33.
bool overlaps(const TurnedBox& box, const Corners& corners);

}  // namespace bilayer::detail
