// Bodies of meshes with holes, cracks and self-intersections fall on all kinds of ground: none may gain energy.
#include <BulletCollision/CollisionShapes/btHeightfieldTerrainShape.h>
#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <string>
#include <vector>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "integration/bullet/detail/convert.h"
#include "tests/support/random.h"
#include "tests/support/support.h"
#include "world.h"

using namespace bilayer;
using namespace bilayer::detail;
using namespace bilayer::bullet::detail;
using namespace bilayer::test;

namespace {

constexpr float size = 0.8f;      // of bodies [m]
constexpr float fall = 0.1f;      // drop height above the top of the ground [m]
constexpr float height = 0.03f;   // of the waves in the ground [m]
constexpr float cell = 0.25f;     // of meshes and height fields [m]
constexpr int cells = 20;         // along each of their sides
constexpr double maxGain = 0.01;  // of the energy of the fall, m g h

float wave(float x, float y) {
    return height * std::sin(2.1f * x + 1) * std::cos(1.3f * y);
}

// A square in the waves around z, in cells.
Mesh waves(float side, int parts) {
    Mesh mesh;
    for (int j = 0; j <= parts; ++j)
        for (int i = 0; i <= parts; ++i) {
            const float x = side * float(i) - 0.5f * side * float(parts),
                        y = side * float(j) - 0.5f * side * float(parts);
            mesh.points.emplace_back(x, y, wave(x, y));
        }
    for (int j = 0; j < parts; ++j)
        for (int i = 0; i < parts; ++i) {
            const auto a = unsigned(j * (parts + 1) + i), c = a + unsigned(parts) + 1;
            mesh.triangles.insert(mesh.triangles.end(), {{a, a + 1, c + 1}, {a, c + 1, c}});
        }
    return mesh;
}

// A slab whose upper side is in waves.
Mesh slab() {
    Mesh mesh = shapes::box({1.25f, 1.25f, 0.15f}, 40);
    for (glm::vec3& p : mesh.points) p.z += p.z > 0 ? wave(p.x, p.y) - 0.15f : -0.15f;
    return mesh;
}

// All kinds of ground, with their tops at `height` or below.
class Grounds {
  public:
    Grounds()
        : triangles_(waves(cell, cells)),
          slab_(std::make_shared<Collider>(slab(), build(slab(), {.voxelSize = 0.025f}))) {
        for (const glm::vec3& p : waves(cell, cells).points) heights_.push_back(p.z);
        field_ = std::make_unique<bullet::Shape>(slab_);
        terrain_ = std::make_unique<btHeightfieldTerrainShape>(cells + 1, cells + 1, heights_.data(), 1.f, -height,
                                                               height, 2, PHY_FLOAT, false);
        terrain_->setLocalScaling({cell, cell, 1});
    }

    static constexpr const char* names[] = {"plane", "box", "field", "mesh", "height field"};
    btCollisionShape& operator[](int i) {
        btCollisionShape* const all[] = {&plane_, &box_, field_.get(), triangles_.shape.get(), terrain_.get()};
        return *all[i];
    }

  private:
    btStaticPlaneShape plane_{{0, 0, 1}, 0};
    btBoxShape box_{{3, 3, height}};
    TriangleShape triangles_;
    std::shared_ptr<const Collider> slab_;
    std::vector<float> heights_;
    std::unique_ptr<bullet::Shape> field_;
    std::unique_ptr<btHeightfieldTerrainShape> terrain_;
};

double energyOf(const btRigidBody& body) {
    const btVector3 spin = body.getAngularVelocity();
    return (9.81 * double(body.getWorldTransform().getOrigin().z()) +
            0.5 * double(body.getLinearVelocity().length2())) /
               double(body.getInvMass()) +
           0.5 * double(spin.dot(body.getInvInertiaTensorWorld().inverse() * spin));
}

struct Drop {
    double gain = 0;  // maximum increase over the minimum energy before, divided by that of the fall
    int aside = 0;    // contacts whose normals point sideways or down
    bool sleeps = false;
};

/// Drops a body of 1 kg upright.
/// @param turn  initial rotation about z
Drop drop(const std::shared_ptr<const Collider>& collider, btCollisionShape& ground, float turn, const glm::vec2& place,
          float seconds) {
    bullet::Shape shape(collider, {.frame = bullet::centreOfMassFrame(*collider)});
    World world;
    world.dynamics.getSolverInfo().m_splitImpulsePenetrationThreshold = -shape.voxelSize();
    world.add(ground, 0, {0, 0, 0});
    const Pose& frame = shape.frame();
    const btTransform inMesh(bullet::detail::toBullet(frame.rotation), bullet::detail::toBullet(frame.position));
    const btTransform mesh(btQuaternion(btVector3(0, 0, 1), turn), btVector3(place.x, place.y, 0));
    btTransform at = mesh * inMesh.inverse();
    at.getOrigin().setZ(at.getOrigin().z() + height + fall - lowest(collider->mesh(), mesh));
    btRigidBody& body = *world.add(shape, 1, at.getOrigin(), at.getRotation());
    double least = energyOf(body), gain = 0;
    Drop result;
    for (int step = 0; step < int(240 * seconds); ++step) {
        world.dynamics.stepSimulation(1.f / 240, 1, 1.f / 240);
        const double now = energyOf(body);
        least = std::min(least, now);
        gain = std::max(gain, now - least);
        for (int i = 0; i < world.dispatcher.getNumManifolds(); ++i) {
            const btPersistentManifold& manifold = *world.dispatcher.getManifoldByIndexInternal(i);
            const float side = manifold.getBody0() == &body ? 1.f : -1.f;
            for (int k = 0; k < manifold.getNumContacts(); ++k)
                result.aside += side * manifold.getContactPoint(k).m_normalWorldOnB.z() < 0.5f;
        }
    }
    result.gain = gain / (9.81 * double(fall));  // of 1 kg
    result.sleeps = !body.isActive();
    return result;
}

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

// Upright, scaled to the size of all others.
Mesh corpusBody(const std::filesystem::path& path) {
    const Mesh mesh = readMesh(path);
    const Bounds box = bounds(mesh);
    glm::mat4 map = glm::rotate(glm::mat4(1), 1.57079633f, glm::vec3(1, 0, 0));
    map = glm::scale(map, glm::vec3(size / box.longestSide()));
    return transformed(mesh, glm::translate(map, -box.centre()));
}

}  // namespace

TEST_CASE("a body with small holes in its base gains no energy on any ground") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    Grounds grounds;
    for (const bool isOpen : {false, true}) {
        const Mesh mesh = stone(isOpen);
        const LevelSet field = build(mesh, {.voxelSize = voxelSizeFor(mesh, 64), .interiorWidthVoxels = 6});
        CHECK(field.sign() == (isOpen ? "winding" : "normals"));
        const auto collider = std::make_shared<Collider>(mesh, field);
        for (int ground = 0; ground < 5; ++ground)
            for (int i = 0; i < 4; ++i) {
                const Drop result =
                    drop(collider, grounds[ground], float(random(-3, 3)), glm::vec2(random.point(0.3)), 3);
                CAPTURE(isOpen, Grounds::names[ground], i, result.aside);
                CHECK(result.gain < maxGain);
                CHECK(result.sleeps);
                if (ground < 3) CHECK(result.aside == 0);
            }
    }
}

TEST_CASE("dirty meshes that are usable as bodies gain no energy on any ground") {
    Grounds grounds;
    for (const char* name :
         {"bunny_5k_open.obj", "bunny_res2_nasty.ply", "beetle.obj", "cgal-elephant-with-holes.off", "cgal-bones.off",
          "factory_round_hole_8mm_subdiv_3x.obj", "kuka_link_0.stl", "octagonal_pocket.stl", "suzanne.obj",
          "two-boxes-bad-self-union.ply", "ycb_mug_visual.obj", "ycb_potted_meat_can.obj"}) {
        const auto path = corpusMesh(name);
        if (!path) return;
        const Mesh mesh = corpusBody(*path);
        const LevelSet field = build(mesh, {.voxelSize = voxelSizeFor(mesh, 96), .interiorWidthVoxels = 6});
        const auto collider = std::make_shared<Collider>(mesh, field);
        for (int ground = 0; ground < 5; ++ground) {
            const Drop result = drop(collider, grounds[ground], 0.3f, {0.1f, -0.05f}, 2);
            CAPTURE(name, Grounds::names[ground], result.sleeps);
            CHECK(result.gain < maxGain);
        }
    }
}
