// SPDX-License-Identifier: Apache-2.0
// User code against the installed headers and all five libraries.
#include <BulletCollision/CollisionDispatch/btDefaultCollisionConfiguration.h>
#include <bilayer/cl/device.h>
#include <bilayer/collider/contact.h>
#include <bilayer/integration/bullet/dispatcher.h>
#include <bilayer/integration/bullet/extensions.h>
#include <bilayer/integration/bullet/shape.h>
#include <bilayer/integration/fluid/seed.h>
#include <bilayer/sdf/build.h>

#include <cstdio>
#include <memory>

int main() {
    bilayer::Mesh cube;
    for (int i = 0; i < 8; ++i) cube.points.push_back({i & 1, i >> 1 & 1, i >> 2});
    cube.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                      {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
    const bilayer::LevelSet field = bilayer::build(cube, {.voxelSize = 0.05f});
    const bool inside = bilayer::Field(field).sample({0.5f, 0.5f, 0.95f}).distance < 0;

    btDefaultCollisionConfiguration configuration;
    bilayer::bullet::Dispatcher dispatcher(&configuration);
    bilayer::bullet::Shape shape(std::make_shared<bilayer::Collider>(cube, field));
    btVector3 inertia;
    shape.calculateLocalInertia(2, inertia);

    const auto liquid = openvdb::createLevelSet<openvdb::FloatGrid>(0.05f, 3);
    bilayer::fluid::seed(*liquid, field);
    const std::size_t devices = bilayer::devices().size();
    std::printf("%d %g %zu\n", inside, double(inertia.x()), devices);
    return inside && inertia.x() > 0 && liquid->activeVoxelCount() > 0 ? 0 : 1;
}
