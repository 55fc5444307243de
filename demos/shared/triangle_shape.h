// SPDX-License-Identifier: Apache-2.0
// A mesh as Bullet's own triangle mesh shape.
#pragma once

#include <btBulletCollisionCommon.h>

#include <memory>

#include <bilayer/sdf/mesh.h>
#include "integration/bullet/detail/convert.h"

namespace bilayer::demo {

struct TriangleShape {
    explicit TriangleShape(const Mesh& mesh) {
        using bullet::detail::toBullet;
        for (const glm::uvec3& t : mesh.triangles)
            triangles.addTriangle(toBullet(mesh.points[t.x]), toBullet(mesh.points[t.y]), toBullet(mesh.points[t.z]));
        shape = std::make_unique<btBvhTriangleMeshShape>(&triangles, true);
    }

    btTriangleMesh triangles;
    std::unique_ptr<btBvhTriangleMeshShape> shape;
};

}  // namespace bilayer::demo
