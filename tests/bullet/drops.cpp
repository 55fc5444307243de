// SPDX-License-Identifier: Apache-2.0
// Bodies of meshes with holes, cracks and self-intersections fall on all kinds of ground: none may gain energy.
#include <algorithm>
#include <catch2/catch.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <string>
#include <vector>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "tests/support/drops.h"
#include "tests/support/random.h"
#include "tests/support/random_pose.h"
#include "tests/support/support.h"

namespace bilayer::drops_test {
using namespace bilayer::test;

namespace {

// The first grounds of grounds() have no edges that a body could touch sideways.
constexpr std::size_t smoothGrounds = 3;

// A round stone with a flat base; if open, four holes are cut into the base.
Mesh stone(bool isOpen) {
    Mesh mesh = shapes::sphere(0.4f, 5);
    for (glm::vec3& p : mesh.points) p = {p.x, 0.8f * p.y, std::max(0.6f * p.z, -0.12f)};
    if (!isOpen) return mesh;
    const std::vector<glm::vec3> holes{
        {0.1f, 0, 0.06f}, {-0.12f, 0.05f, 0.05f}, {0, -0.14f, 0.03f}, {0.05f, 0.15f, 0.04f}};  // x, y, radius
    std::erase_if(mesh.triangles, [&](const glm::uvec3& t) {
        const glm::vec3 middle = (mesh.points[t.x] + mesh.points[t.y] + mesh.points[t.z]) / 3.f;
        return middle.z < -0.11f && std::any_of(holes.begin(), holes.end(), [&](const glm::vec3& hole) {
                   return glm::distance(glm::vec2(middle), glm::vec2(hole)) < hole.z;
               });
    });
    return mesh;
}

// A rotation about the vertical axis.
glm::quat turned(float angle) {
    return glm::angleAxis(angle, glm::vec3(0, 0, 1));
}

// A tetrahedron from which a long triangle sticks out.
Mesh finned() {
    const glm::vec3 a(0.4f, 0.3f, 0.4f), b(-0.4f, -0.3f, 0.4f), c(-0.4f, 0.3f, -0.4f), d(0.4f, -0.3f, -0.4f);
    return {{a, b, c, d, {-0.4f, 0.04f, 0.4f}, {-0.4f, -0.04f, -0.4f}, {0.05f, 0.02f, 0}},
            {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}, {4, 5, 6}}};
}

}  // namespace

TEST_CASE("an open surface that sticks out of a body bears it") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const Mesh mesh = finned();
    const LevelSet field = build(mesh, {.voxelSize = voxelSizeFor(mesh, 96), .interiorWidthVoxels = 6});
    CHECK(field.sign() == "winding");
    const auto collider = std::make_shared<Collider>(mesh, field);
    for (const Ground& ground : grounds())
        for (int i = 0; i < 8; ++i) {
            const Drop result =
                drop(collider, *ground.shape, {randomRotation(random), glm::vec2(random.point(0.3))}, 2);
            CAPTURE(ground.name, i, result.sidewaysContacts);
            CHECK(result.gain < maxEnergyGain);
            CHECK_FALSE(result.fell);
        }
}

TEST_CASE("a body with small holes in its base gains no energy on any ground") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const std::vector<Ground> all = grounds();
    for (const bool isOpen : {false, true}) {
        const Mesh mesh = stone(isOpen);
        const LevelSet field = build(mesh, {.voxelSize = voxelSizeFor(mesh, 64), .interiorWidthVoxels = 6});
        CHECK(field.sign() == (isOpen ? "winding" : "normals"));
        const auto collider = std::make_shared<Collider>(mesh, field);
        for (std::size_t ground = 0; ground < all.size(); ++ground)
            for (int i = 0; i < 4; ++i) {
                const Drop result =
                    drop(collider, *all[ground].shape, {turned(float(random(-3, 3))), glm::vec2(random.point(0.3))}, 3);
                CAPTURE(isOpen, all[ground].name, i, result.sidewaysContacts);
                CHECK(result.gain < maxEnergyGain);
                CHECK_FALSE(result.fell);
                CHECK(result.sleeps);
                if (ground < smoothGrounds) CHECK(result.sidewaysContacts == 0);
            }
    }
}

TEST_CASE("dirty meshes that are usable as bodies gain no energy on any ground") {
    const std::vector<Ground> all = grounds();
    for (const char* name :
         {"bunny_5k_open.obj", "bunny_res2_nasty.ply", "beetle.obj", "cgal-elephant-with-holes.off", "cgal-bones.off",
          "factory_round_hole_8mm_subdiv_3x.obj", "kuka_link_0.stl", "cow.obj", "suzanne.obj",
          "two-boxes-bad-self-union.ply", "ycb_mug_visual.obj", "ycb_potted_meat_can.obj"}) {
        const auto path = corpusMesh(name);
        if (!path) return;
        const Mesh mesh = droppable(readMesh(*path));
        const LevelSet field = build(mesh, {.voxelSize = voxelSizeFor(mesh, 96), .interiorWidthVoxels = 6});
        const auto collider = std::make_shared<Collider>(mesh, field);
        for (const Ground& ground : all) {
            const Drop result = drop(collider, *ground.shape, {turned(0.3f), {0.1f, -0.05f}}, 2);
            CAPTURE(name, ground.name, result.sleeps);
            CHECK(result.gain < maxEnergyGain);
            CHECK_FALSE(result.fell);
        }
    }
}
}  // namespace bilayer::drops_test
