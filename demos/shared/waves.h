// SPDX-License-Identifier: Apache-2.0
// A wavy ground of triangles for Bullet: static, in world coordinates.
#pragma once

#include <BulletCollision/CollisionShapes/btConcaveShape.h>

#include <glm/vec3.hpp>
#include <memory>

#include <bilayer/sdf/mesh.h>

namespace bilayer::demo {

struct WavesOptions {
    float height;              ///< amplitude [m]
    float cell;                ///< edge of the squares of two triangles each [m]
    bool heightField = false;  ///< a btHeightfieldTerrainShape; otherwise a btBvhTriangleMeshShape
};

/// The height is `height sin(2.1 x + 1) cos(1.3 y)` at the corners of squares, and linear in each triangle.
class Waves {
  public:
    static constexpr float length = 14, width = 8;  ///< min size of the ground; its centre is the origin [m]

    explicit Waves(const WavesOptions& options);

    /// The ground as the top of a closed solid.
    const Mesh& solid() const { return solid_; }
    /// The shape stays valid after this object is destroyed.
    std::shared_ptr<btConcaveShape> shape() const { return shape_; }
    /// Returns the max height within a distance of a vertical line [m].
    float highestAround(float x, float y, float distance) const;
    /// Returns the angle between a direction and the cone of the normals of the triangles within a distance of a point
    /// [rad]; infinite if there are none.
    double angleToNormals(const glm::dvec3& place, const glm::dvec3& direction, double within) const;

  private:
    glm::vec3 cornerAt(int i, int j) const;
    void addSolid();

    WavesOptions options_;
    int cellsX_, cellsY_;
    Mesh solid_;
    std::shared_ptr<btConcaveShape> shape_;
};

}  // namespace bilayer::demo
