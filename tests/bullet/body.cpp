// SPDX-License-Identifier: Apache-2.0
// Bodies from files in a world.
#include "collider/contact/body/body.h"
#include "collider/contact/body/collider_data.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <vector>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/vdb_io.h>
#include "demos/shared/shapes.h"
#include "sdf/base/access.h"
#include "tests/bullet/world.h"
#include "tests/support/support.h"

namespace bilayer::body_test {
using namespace bilayer::detail;
using namespace bilayer::test;
using bullet::Shape;

namespace {

struct Pair {
    std::shared_ptr<const Collider> made, loaded;
};

Pair bodyOf(const Mesh& mesh, float voxelSize) {
    const LevelSet field = build(mesh, {.voxelSize = voxelSize});
    const auto path = scratch("body.vdb");
    const auto made = std::make_shared<Collider>(mesh, field, ColliderOptions{.margin = 0.6f * voxelSize});
    writeVdb(path, withBody(field, dataOf(*made).body));
    return {made, std::make_shared<Collider>(readVdb(path))};
}

// The poses of a pile of two fields, a ball and a block over 1.5 s.
std::vector<btTransform> pile(const std::shared_ptr<const Collider>& knot,
                              const std::shared_ptr<const Collider>& slab) {
    Shape floor(slab), body(knot, {.frame = bullet::centreOfMassFrame(*knot)});
    btSphereShape ball(0.1f);
    btBoxShape block({0.1f, 0.08f, 0.06f});
    World world;
    world.add(floor, 0, {0, 0, -0.1f});
    const std::vector<btRigidBody*> bodies{
        world.add(body, 2, {0, 0, 0.5f}), world.add(body, 1, {0.1f, 0.1f, 1.1f}, btQuaternion({1, 2, 0}, 0.7f)),
        world.add(ball, 0.5f, {-0.3f, 0, 1.4f}), world.add(block, 0.5f, {0.35f, 0.1f, 1.5f})};
    std::vector<btTransform> poses;
    for (int i = 0; i < 15; ++i) {
        world.run(0.1f);
        for (const btRigidBody* one : bodies) poses.push_back(one->getWorldTransform());
    }
    return poses;
}

}  // namespace

TEST_CASE("Bodies from files move as those of meshes, to the bit") {
    const Pair knot = bodyOf(shapes::torusKnot(2, 3, 0.25f, 0.08f, 200, 16), 0.02f);
    const Pair slab = bodyOf(shapes::box({2, 2, 0.1f}, 4), 0.04f);
    const auto expected = pile(knot.made, slab.made), poses = pile(knot.loaded, slab.loaded);
    REQUIRE(poses.size() == expected.size());
    for (std::size_t i = 0; i < poses.size(); ++i) {
        CAPTURE(i);
        REQUIRE(std::memcmp(&poses[i], &expected[i], sizeof(btTransform)) == 0);
    }
    // they did collide: the block rests on the slab by then, on one of its faces
    const float height = poses.back().getOrigin().z();
    CHECK(std::min({std::abs(height - 0.06f), std::abs(height - 0.08f), std::abs(height - 0.1f)}) < 0.004f);
}

TEST_CASE("A shape of a body from a file has its margin, its inertia and its box") {
    const Pair knot = bodyOf(shapes::torusKnot(2, 3, 0.25f, 0.08f, 200, 16), 0.02f);
    const Shape made(knot.made), loaded(knot.loaded);
    CHECK(made.getMargin() == 0.6f * 0.02f);
    CHECK(loaded.getMargin() == made.getMargin());
    btVector3 expected(0, 0, 0), inertia(0, 0, 0);
    made.calculateLocalInertia(2, expected);
    loaded.calculateLocalInertia(2, inertia);
    CHECK(inertia == expected);
    btVector3 lower[2], upper[2];
    const btTransform pose(btQuaternion({1, 2, 3}, 0.5f), {1, 2, 3});
    made.getAabb(pose, lower[0], upper[0]);
    loaded.getAabb(pose, lower[1], upper[1]);
    CHECK(lower[0] == lower[1]);
    CHECK(upper[0] == upper[1]);
}

TEST_CASE("A shape's own margin goes before that of its body") {
    const Pair slab = bodyOf(shapes::box({2, 2, 0.1f}, 4), 0.04f);
    CHECK(Shape(slab.loaded, {.margin = 0.01f}).getMargin() == 0.01f);
}
}  // namespace bilayer::body_test
