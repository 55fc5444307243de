// SPDX-License-Identifier: Apache-2.0
// A body twice: as a field and as Bullet's triangle mesh, each in a world of its own; and convex shapes to test it
// with.
#pragma once

#include <BulletCollision/CollisionShapes/btMultiSphereShape.h>

#include <random>

#include <bilayer/sdf/build.h>
#include "demos/shared/shapes.h"
#include "integration/bullet/detail/convert.h"
#include "tests/bullet/world.h"
#include "tests/support/support.h"

namespace bilayer::test {

inline constexpr float voxel = 0.05f;  // at scale 1 [m]

inline Mesh scaled(Mesh mesh, float scale) {
    for (glm::vec3& point : mesh.points) point *= scale;
    return mesh;
}

// The same body twice, as a field and as triangles, each in its own world.
struct FieldAndMesh {
    /// @param scaledByBullet  scale the field by Bullet instead of its mesh
    /// @param itsScale        of the triangles
    FieldAndMesh(const Mesh& mesh, float scale, bool scaledByBullet, float itsScale)
        : field(std::make_shared<Collider>(scaledByBullet ? mesh : scaled(mesh, scale),
                                           build(scaledByBullet ? mesh : scaled(mesh, scale),
                                                 {.voxelSize = scaledByBullet ? voxel : scale * voxel}))),
          triangles(scaled(mesh, itsScale)) {
        triangles.shape->setMargin(0);
        if (scaledByBullet) field.setLocalScaling({scale, scale, scale});
        const btVector3 place(0.3f, -0.2f, 0.1f);
        const btQuaternion rotation(btVector3(1, 2, 3).normalized(), 0.8f);
        ofField.add(field, 0, scale * place, rotation);
        ofTriangles.add(*triangles.shape, 0, itsScale * place, rotation);
    }
    bullet::Shape field;
    TriangleShape triangles;
    World ofField, ofTriangles;
};

inline Mesh bodyOf(int kind) {
    if (kind == 0) return shapes::box({0.5f, 0.4f, 0.3f}, 3);
    return kind == 1 ? shapes::torusKnot(2, 3, 0.5f, 0.12f, 160, 16) : shapes::torus(0.5f, 0.2f);
}

class Directions {
  public:
    explicit Directions(unsigned seed) : random_(seed) {}
    float part() { return part_(random_); }
    btVector3 vector() { return {part(), part(), part()}; }
    btQuaternion rotation() { return btQuaternion(part(), part(), part(), part() + 0.01f).normalized(); }
    /// From somewhere outside a ball to a place in it, and beyond.
    std::pair<btVector3, btVector3> path(float scale) {
        const btVector3 through = 0.6f * scale * vector(), from = 2 * scale * vector().normalized();
        return {from, from + 1.8f * (through - from)};
    }

  private:
    std::mt19937 random_;
    std::uniform_real_distribution<float> part_{-1, 1};
};

// Sets the sizes minus the margin, which Bullet itself rounds differently at each scale.
inline void setSize(btConvexInternalShape& shape, float s, const btVector3& halfExtents, float margin) {
    shape.setMargin(s * margin);
    shape.setImplicitShapeDimensions(s * (halfExtents - btVector3(margin, margin, margin)));
}

inline std::unique_ptr<btConvexShape> shapeOf(int kind, float s) {
    switch (kind) {
        case 0:
            return std::make_unique<btSphereShape>(0.12f * s);
        case 1: {
            // Bullet rounds the shape off by this
            const btVector3 halfExtents(0.1f, 0.15f, 0.2f);
            auto box = std::make_unique<btBoxShape>(s * halfExtents);
            setSize(*box, s, halfExtents, 0.005f);
            return box;
        }
        case 2:
            return std::make_unique<btCapsuleShape>(0.08f * s, 0.3f * s);
        case 3: {
            const btVector3 halfExtents(0.1f, 0.2f, 0.1f);
            auto cylinder = std::make_unique<btCylinderShape>(s * halfExtents);
            setSize(*cylinder, s, halfExtents, 0.005f);
            return cylinder;
        }
        case 4: {
            auto cone = std::make_unique<btConeShape>(0.12f * s, 0.3f * s);
            cone->setMargin(0.01f * s);
            return cone;
        }
        case 5: {
            auto hull = std::make_unique<btConvexHullShape>();
            for (const glm::vec3& point : shapes::sphere(0.15f * s, 1).points)
                hull->addPoint(bullet::detail::toBullet(point));
            hull->setMargin(0.01f * s);
            return hull;
        }
        default: {
            const btVector3 centres[] = {{-0.1f * s, 0, 0}, {0.1f * s, 0, 0}};
            const float radii[] = {0.1f * s, 0.06f * s};
            auto spheres = std::make_unique<btMultiSphereShape>(centres, radii, 2);
            spheres->setMargin(0.05f * s);
            return spheres;
        }
    }
}

}  // namespace bilayer::test
