// A ground of waves in triangles, as Bullet collides it: static, in the world's own coordinates.
#pragma once

#include <BulletCollision/CollisionShapes/btConcaveShape.h>

#include <glm/vec3.hpp>
#include <memory>

#include <bilayer/sdf/mesh.h>

namespace bilayer::demo {

struct WavesOptions {
    float height;              ///< amplitude [m]
    float cell;                ///< edge of the squares, of two triangles each [m]
    bool heightField = false;  ///< a btHeightfieldTerrainShape; else a btBvhTriangleMeshShape
};

/// The height is `height sin(2.1 x + 1) cos(1.3 y)` at the corners of squares, and even in each triangle.
class Waves {
  public:
    static constexpr float length = 14, width = 8;  ///< of the ground, at least; its middle is at the origin [m]

    explicit Waves(const WavesOptions& options);

    /// The triangles as the top of a closed solid.
    const Mesh& solid() const { return solid_; }
    /// Stays valid without this.
    std::shared_ptr<btConcaveShape> shape() const { return shape_; }
    /// The highest place within a distance of an upright line [m].
    float highestAround(float x, float y, float distance) const;
    /// The angle of a direction to the cone of the normals of the triangles within a distance of a place
    /// [rad]; infinite where there are none.
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
