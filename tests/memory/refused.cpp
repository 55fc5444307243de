// SPDX-License-Identifier: Apache-2.0
// Memory is refused at each allocation in turn: std::bad_alloc reaches the caller, nothing ends the program, and the
// same work has the same result afterwards. Not so in surface(): OpenVDB 10 then waits for a task that never ends.
#include <algorithm>
#include <catch2/catch.hpp>
#include <functional>
#include <new>
#include <numeric>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include <bilayer/collider/distance.h>
#include <bilayer/integration/bullet/shape.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/inspect.h>
#include <bilayer/sdf/mesh_io.h>
#include <bilayer/sdf/vdb_io.h>
#include "demos/shared/shapes.h"
#include "tests/bullet/world.h"
#include "tests/memory/refusing_new.h"
#include "tests/support/support.h"

namespace bilayer::refused_test {
using namespace bilayer::test;

namespace {

constexpr std::size_t firstOnes = 60, others = 100;  // allocations that are refused, of many

Mesh smallMesh() {
    return shapes::sphere(1, 2);
}

BuildOptions coarse() {
    return {.voxelSize = 0.25f, .triangles = true};
}

/// The numbers of the allocations that are refused: all of a few, else the first ones and some at random.
std::vector<std::size_t> chosen(std::size_t count) {
    std::vector<std::size_t> numbers(count);
    std::iota(numbers.begin(), numbers.end(), 1);
    if (count <= firstOnes + others) return numbers;
    const unsigned seed = test::seed();
    std::shuffle(numbers.begin() + firstOnes, numbers.end(), std::mt19937(seed));
    numbers.resize(firstOnes + others);
    return numbers;
}

/// @param work  returns a number that depends on all of its result
void refuseEach(const char* name, const std::function<std::size_t()>& work) {
    CAPTURE(name);
    (void)work();  // what is allocated once
    refuseAllocation(0);
    const std::size_t expected = work(), count = endRefusal();
    std::size_t refused = 0;
    for (const std::size_t number : chosen(count)) {
        bool isRefused = false;
        std::string other;
        refuseAllocation(number);
        try {
            (void)work();
        } catch (const std::bad_alloc&) {
            isRefused = true;
        } catch (const std::exception& error) {
            other = error.what();
        }
        endRefusal();
        refused += isRefused;
        CAPTURE(number, count);
        // a reader reports that it had too little memory
        if (!other.empty()) CHECK_THAT(other, Catch::Contains("memory"));
    }
    CHECK(refused > 0);
    CHECK(work() == expected);
}

std::size_t sizeOf(const LevelSet& field) {
    return field.activeVoxels() + field.leaves() + field.memoryBytes();
}

}  // namespace

TEST_CASE("a build that is refused memory throws, and the next one is whole") {
    const Mesh mesh = smallMesh();
    refuseEach("inspect", [&] { return inspect(mesh, 0.1f).triangles; });
    for (const Method method : {Method::exact, Method::doubleLayer, Method::pseudonormal}) {
        BuildOptions options = coarse();
        options.method = method;
        refuseEach("build", [&] { return sizeOf(build(mesh, options)); });
    }
    for (const Sign sign : {Sign::winding, Sign::flood}) {
        BuildOptions options = coarse();
        options.sign = sign;
        refuseEach("build with signs", [&] { return sizeOf(build(mesh, options)); });
    }
    const LevelSet field = build(mesh, coarse());
    Mesh other = mesh;
    other.points[3] *= 1.05f;
    std::vector<std::uint32_t> moved;
    for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i)
        if (mesh.triangles[i].x == 3 || mesh.triangles[i].y == 3 || mesh.triangles[i].z == 3) moved.push_back(i);
    refuseEach("rebuild", [&] { return sizeOf(rebuild(field, mesh, other, moved, coarse())); });
}

TEST_CASE("files that are read and written with too little memory are left as they were") {
    const Mesh mesh = smallMesh();
    const LevelSet field = withBody(build(mesh, coarse()), mesh);
    for (const char* name : {"memory.obj", "memory.ply", "memory.stl"}) {
        const auto path = scratch(name);
        writeMesh(path, mesh);
        refuseEach(name, [&] { return readMesh(path).triangles.size(); });
        refuseEach(name, [&] {
            writeMesh(path, mesh);
            return std::size_t(0);
        });
        CHECK(readMesh(path).triangles.size() == mesh.triangles.size());
    }
    const auto path = scratch("memory.vdb");
    writeVdb(path, field);
    refuseEach("readVdb", [&] { return sizeOf(readVdb(path)); });
    refuseEach("writeVdb", [&] {
        writeVdb(path, field);
        return std::size_t(0);
    });
    CHECK(sizeOf(readVdb(path)) == sizeOf(field));
}

TEST_CASE("bodies and contacts that are refused memory throw, and the next ones are whole") {
    const Mesh mesh = smallMesh();
    const LevelSet field = build(mesh, coarse());
    refuseEach("field", [&] { return Field(field, mesh).memoryBytes(); });
    refuseEach("collider", [&] { return Collider(mesh, field).mesh().triangles.size(); });
    const Collider a(mesh, field), b(mesh, field);
    refuseEach("collide", [&] {
        std::vector<Contact> contacts;
        collide(a, {}, b, {{1.9f, 0, 0}, {1, 0, 0, 0}}, {.margin = 0.1f}, contacts);
        return contacts.size();
    });
    refuseEach("distance", [&] {
        const Collider fresh(mesh, field);
        return std::size_t(distance(Placed{fresh}, Placed{b, {{3, 0, 0}, {1, 0, 0, 0}}}).found);
    });
}

TEST_CASE("a step in Bullet that is refused memory throws, and the world continues") {
    const auto box = exactBox({0.3f, 0.2f, 0.15f}, 0.05f), ground = exactBox({2, 2, 0.2f}, 0.1f);
    refuseEach("step", [&] {
        bullet::Shape boxShape(box), groundShape(ground);
        World world;
        world.add(groundShape, 0, {0, 0, -0.2f});
        for (int i = 0; i < 4; ++i) world.add(boxShape, 1, {0.1f * float(i), 0, 0.14f + 0.3f * float(i)});
        for (int i = 0; i < 6; ++i) world.run(1.f / 240);
        return std::size_t(world.dispatcher.getNumManifolds());
    });
}

TEST_CASE("a world continues after a step that was refused memory") {
    const auto box = exactBox({0.3f, 0.2f, 0.15f}, 0.05f), ground = exactBox({2, 2, 0.2f}, 0.1f);
    bullet::Shape boxShape(box), groundShape(ground);
    World world;
    world.add(groundShape, 0, {0, 0, -0.2f});
    std::vector<btRigidBody*> bodies;
    for (int i = 0; i < 4; ++i) bodies.push_back(world.add(boxShape, 1, {0.1f * float(i), 0, 0.14f + 0.3f * float(i)}));
    for (std::size_t number = 1; number < 300; ++number) {
        refuseAllocation(1 + number % 40);
        try {
            world.run(1.f / 240);
        } catch (const std::bad_alloc&) {
            // the next step makes up for it
        }
        endRefusal();
    }
    world.run(1);
    for (const btRigidBody* body : bodies) {
        const btVector3 at = body->getWorldTransform().getOrigin();
        CAPTURE(at.x(), at.y(), at.z());
        CHECK(at.z() > 0.1f);
        CHECK(at.z() < 2);
    }
}
}  // namespace bilayer::refused_test
