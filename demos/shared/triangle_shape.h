// A mesh as Bullet itself collides it.
#pragma once

#include <btBulletCollisionCommon.h>

#include <memory>

#include "integration/bullet/convert.h"
#include "sdf/mesh.h"

namespace bilayer::demo {

struct TriangleShape {
    explicit TriangleShape(const Mesh& mesh) {
        using bullet::toBullet;
        for (const glm::uvec3& t : mesh.triangles)
            triangles.addTriangle(toBullet(mesh.points[t.x]), toBullet(mesh.points[t.y]), toBullet(mesh.points[t.z]));
        shape = std::make_unique<btBvhTriangleMeshShape>(&triangles, true);
    }

    btTriangleMesh triangles;
    std::unique_ptr<btBvhTriangleMeshShape> shape;
};

}  // namespace bilayer::demo
