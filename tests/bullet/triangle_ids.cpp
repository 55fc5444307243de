// SPDX-License-Identifier: Apache-2.0
// Part and index identify the triangle or child of a contact for users.
#include <BulletCollision/CollisionShapes/btHeightfieldTerrainShape.h>
#include <BulletCollision/Gimpact/btGImpactShape.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "integration/bullet/detail/convert.h"
#include "tests/bullet/world.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::triangle_ids_test {
using namespace bilayer::detail;
using namespace bilayer::bullet::detail;
using namespace bilayer::test;
using bullet::Shape;
using bullet::detail::toGlm;

namespace {

constexpr float h = 0.05f;  // voxel [m]
constexpr int side = 13;    // points along a ground's side, a cell apart
constexpr float cell = 0.25f;

btTransform at(const btVector3& place) {
    return btTransform(btQuaternion::getIdentity(), place);
}

float heightAt(float x, float y) {
    return 0.1f * std::sin(2.1f * x + 1) * std::cos(1.3f * y);
}

/// Coordinate of a point of the ground's lattice.
float placeOf(int i) {
    return cell * (float(i) - 0.5f * (side - 1));
}

/// Hills of two parts: part 0 where x < 0, else part 1.
class TwoParts {
  public:
    TwoParts() {
        for (int y = 0; y < side; ++y)
            for (int x = 0; x < side; ++x)
                points_.insert(points_.end(), {placeOf(x), placeOf(y), heightAt(placeOf(x), placeOf(y))});
        for (int part = 0; part < 2; ++part) {
            const int half = (side - 1) / 2;
            for (int y = 0; y < side - 1; ++y)
                for (int x = part * half; x < (part + 1) * half; ++x) {
                    const int i = side * y + x;
                    indices_[part].insert(indices_[part].end(), {i, i + 1, i + side, i + side, i + 1, i + side + 1});
                }
            btIndexedMesh mesh;
            mesh.m_numTriangles = int(indices_[part].size() / 3);
            mesh.m_triangleIndexBase = reinterpret_cast<const unsigned char*>(indices_[part].data());
            mesh.m_triangleIndexStride = 3 * sizeof(int);
            mesh.m_numVertices = side * side;
            mesh.m_vertexBase = reinterpret_cast<const unsigned char*>(points_.data());
            mesh.m_vertexStride = 3 * sizeof(float);
            array.addIndexedMesh(mesh);
        }
        shape = std::make_unique<btBvhTriangleMeshShape>(&array, true);
    }

    btTriangleIndexVertexArray array;
    std::unique_ptr<btBvhTriangleMeshShape> shape;

  private:
    std::vector<float> points_;
    std::array<std::vector<int>, 2> indices_;
};

class Terrain {
  public:
    Terrain() {
        for (int y = 0; y < side; ++y)
            for (int x = 0; x < side; ++x) heights_[std::size_t(side * y + x)] = heightAt(placeOf(x), placeOf(y));
        shape = std::make_unique<btHeightfieldTerrainShape>(side, side, heights_.data(), 1.f, -0.1f, 0.1f, 2, PHY_FLOAT,
                                                            false);
        shape->setLocalScaling({cell, cell, 1});
    }

    std::unique_ptr<btHeightfieldTerrainShape> shape;

  private:
    std::array<float, std::size_t(side* side)> heights_{};
};

using Id = std::pair<int, int>;

/// Triangles by Bullet's identifiers; a cell of a height field has two.
std::multimap<Id, std::array<glm::dvec3, 3>> trianglesOf(const btConcaveShape& mesh) {
    struct All : btTriangleCallback {
        void processTriangle(btVector3* corners, int part, int index) override {
            const auto place = [&](int i) { return glm::dvec3(toGlm(corners[i])); };
            found.emplace(Id(part, index), std::array{place(0), place(1), place(2)});
        }
        std::multimap<Id, std::array<glm::dvec3, 3>> found;
    } all;
    mesh.processAllTriangles(&all, {-100, -100, -100}, {100, 100, 100});
    return all.found;
}

/// A contact as users receive it. The mesh is the static side.
struct Seen {
    btVector3 onMesh, normal;
    Id ofMesh, ofOther;
};

std::vector<Seen> told;

Seen seenOf(const btManifoldPoint& point, bool meshIsFirst) {
    const Id first(point.m_partId0, point.m_index0), second(point.m_partId1, point.m_index1);
    return {meshIsFirst ? point.m_positionWorldOnA : point.m_positionWorldOnB, point.m_normalWorldOnB,
            meshIsFirst ? first : second, meshIsFirst ? second : first};
}

bool storeTriangle(btManifoldPoint& point, const btCollisionObjectWrapper* first, int part0, int index0,
                   const btCollisionObjectWrapper*, int part1, int index1) {
    CHECK(Id(part0, index0) == Id(point.m_partId0, point.m_index0));
    CHECK(Id(part1, index1) == Id(point.m_partId1, point.m_index1));
    told.push_back(seenOf(point, first->getCollisionObject()->isStaticObject()));
    return false;
}

/// The identifiers of a step's contacts in callbacks; the manifolds hold the same.
std::vector<Seen> namesOf(World& world) {
    told.clear();
    gContactAddedCallback = storeTriangle;
    world.dynamics.performDiscreteCollisionDetection();
    gContactAddedCallback = nullptr;
    for (int m = 0; m < world.dispatcher.getNumManifolds(); ++m) {
        const btPersistentManifold& manifold = *world.dispatcher.getManifoldByIndexInternal(m);
        for (int i = 0; i < manifold.getNumContacts(); ++i) {
            const Seen kept = seenOf(manifold.getContactPoint(i), manifold.getBody0()->isStaticObject());
            const auto isSame = [&](const Seen& one) {
                return one.ofMesh == kept.ofMesh && one.ofOther == kept.ofOther;
            };
            CHECK(std::any_of(told.begin(), told.end(), isSame));
        }
    }
    return told;
}

/// Whether a contact's triangle is among the nearest, and among these faces the contact most directly.
void checkTriangle(const Seen& seen, const std::multimap<Id, std::array<glm::dvec3, 3>>& triangles,
                   const btTransform& ofMesh, double tolerance) {
    const btTransform inMesh = ofMesh.inverse();
    const glm::dvec3 place(toGlm(inMesh * seen.onMesh)), normal(toGlm(inMesh.getBasis() * seen.normal));
    const auto away = [&](const auto& t) { return std::sqrt(squaredDistance(place, t[0], t[1], t[2])); };
    const auto facing = [&](const auto& t) {
        return std::abs(glm::dot(glm::normalize(glm::cross(t[1] - t[0], t[2] - t[0])), normal));
    };
    double least = std::numeric_limits<double>::max(), most = 0;
    for (const auto& [id, triangle] : triangles) least = std::min(least, away(triangle));
    for (const auto& [id, triangle] : triangles)
        if (away(triangle) <= least + 0.1 * tolerance) most = std::max(most, facing(triangle));
    const auto [first, last] = triangles.equal_range(seen.ofMesh);
    CAPTURE(seen.ofMesh.first, seen.ofMesh.second, place.x, place.y, place.z, least, most);
    bool isNamed = false;
    for (auto it = first; it != last; ++it)
        isNamed = isNamed || (away(it->second) <= least + tolerance && facing(it->second) >= most - 1e-3);
    CHECK(first != last);
    CHECK(isNamed);
}

struct Ground {
    const char* name;
    btConcaveShape& shape;
};

}  // namespace

TEST_CASE("Contacts with a mesh or a height field name their triangle, as those of Bullet's own box do") {
    const unsigned from = seed();
    CAPTURE(from);
    Random random(from);
    TwoParts twoParts;
    Terrain terrain;
    btScaledBvhTriangleMeshShape scaled(twoParts.shape.get(), {1.2f, 0.9f, 1.5f});
    btBoxShape bulletBox({0.3f, 0.3f, 0.15f});
    Shape box(exactBox({0.3f, 0.3f, 0.15f}, h)), ball(exactSphere(0.3f, h)), ring(exactTorus(0.3f, 0.1f, h));
    btGImpactMeshShape gimpact(&twoParts.array);
    gimpact.updateBound();
    const Ground grounds[] = {
        {"two parts", *twoParts.shape}, {"scaled", scaled}, {"height field", *terrain.shape}, {"GImpact", gimpact}};
    const struct {
        const char* name;
        btCollisionShape& shape;
        bool isField;
    } bodies[] = {{"Bullet's box", bulletBox, false}, {"box", box, true}, {"ball", ball, true}, {"ring", ring, true}};
    const bool groundIsFirst = GENERATE(true, false);
    for (const Ground& ground : grounds) {
        const auto triangles = trianglesOf(ground.shape);
        for (const auto& body : bodies) {
            if (&ground.shape == &gimpact && !body.isField) continue;  // requires its own algorithm
            int contacts = 0;
            std::map<int, int> parts;
            for (int round = 0; round < 40; ++round) {
                CAPTURE(ground.name, body.name, groundIsFirst, round);
                const btQuaternion rotation(bullet::detail::toBullet(random.direction()), float(random(0, 6.28)));
                const btVector3 place(float(random(-1, 1)), float(random(-1, 1)), float(random(0.1, 0.45)));
                const btTransform groundPlace(btQuaternion({0, 0, 1}, 0.3f), {0.1f, 0.2f, 0.05f});
                World world;
                const auto addGround = [&] {
                    world.add(ground.shape, 0, groundPlace.getOrigin(), groundPlace.getRotation());
                };
                if (groundIsFirst) addGround();
                btRigidBody* one = world.add(body.shape, 1, place, rotation);
                if (!groundIsFirst) addGround();
                one->setCollisionFlags(one->getCollisionFlags() | btCollisionObject::CF_CUSTOM_MATERIAL_CALLBACK);
                for (const Seen& seen : namesOf(world)) {
                    ++contacts;
                    ++parts[seen.ofMesh.first];
                    if (body.isField) {
                        checkTriangle(seen, triangles, groundPlace, 0.01 * h);
                        CHECK(seen.ofOther.first == 0);
                    } else {
                        CHECK(triangles.count(seen.ofMesh) > 0);  // Bullet leaves the other side unchanged
                    }
                }
            }
            CHECK(contacts > 20);
            CHECK(parts.size() > 1);
        }
    }
}

namespace {

/// A small box on the middle of a triangle, and the identifiers found below it.
struct Small {
    std::vector<Seen> inStep, inTest;
    std::vector<std::vector<int>> children;  ///< of the mesh's side, innermost first
};

std::vector<std::vector<int>> toldChildren;

struct Test : btCollisionWorld::ContactResultCallback {
    std::vector<Seen> seen;
    btScalar addSingleResult(btManifoldPoint& point, const btCollisionObjectWrapper* first, int part0, int index0,
                             const btCollisionObjectWrapper*, int part1, int index1) override {
        CHECK(Id(part0, index0) == Id(point.m_partId0, point.m_index0));
        CHECK(Id(part1, index1) == Id(point.m_partId1, point.m_index1));
        seen.push_back(seenOf(point, first->getCollisionObject()->isStaticObject()));
        return 0;
    }
};

bool tellChildren(btManifoldPoint& point, const btCollisionObjectWrapper* first, int part0, int index0,
                  const btCollisionObjectWrapper* second, int part1, int index1) {
    storeTriangle(point, first, part0, index0, second, part1, index1);
    const btCollisionObjectWrapper* mesh = first->getCollisionObject()->isStaticObject() ? first : second;
    // Bullet's own contacts have a triangle in place of the mesh
    if (mesh->getCollisionShape()->getShapeType() == TRIANGLE_SHAPE_PROXYTYPE) mesh = mesh->m_parent;
    toldChildren.emplace_back();
    for (; mesh->m_parent; mesh = mesh->m_parent) toldChildren.back().push_back(mesh->m_index);
    return false;
}

Small namesUnder(btCollisionShape& ground, btCollisionShape& body, const btTransform& place, bool groundIsFirst) {
    World world;
    btRigidBody* under = groundIsFirst ? world.add(ground, 0, {0, 0, 0}) : nullptr;
    btRigidBody* one = world.add(body, 1, place.getOrigin(), place.getRotation());
    if (!groundIsFirst) under = world.add(ground, 0, {0, 0, 0});
    one->setCollisionFlags(one->getCollisionFlags() | btCollisionObject::CF_CUSTOM_MATERIAL_CALLBACK);
    told.clear();
    toldChildren.clear();
    gContactAddedCallback = tellChildren;
    world.dynamics.performDiscreteCollisionDetection();
    gContactAddedCallback = nullptr;
    Test test;
    world.dynamics.contactPairTest(one, under, test);
    return {told, test.seen, toldChildren};
}

}  // namespace

TEST_CASE("A small box names the triangle and the children that Bullet's own box does") {
    const float half = 0.03f;
    TwoParts twoParts;
    Terrain terrain;
    const Ground grounds[] = {{"two parts", *twoParts.shape}, {"height field", *terrain.shape}};
    btBoxShape bulletBox({half, half, half});
    Shape box(exactBox({half, half, half}, 0.01f));
    const bool groundIsFirst = GENERATE(true, false), groundInCompound = GENERATE(false, true),
               boxInCompound = GENERATE(false, true);
    for (const Ground& ground : grounds) {
        const auto triangles = trianglesOf(ground.shape);
        btCompoundShape inner, outer, ofBullet, ofField;
        // the first children have no contacts
        btSphereShape far(0.1f);
        inner.addChildShape(at({0, 0, 50}), &far);
        inner.addChildShape(at({0, 0, 0}), &ground.shape);
        outer.addChildShape(at({0, 0, 40}), &far);
        outer.addChildShape(at({0, 0, 30}), &far);
        outer.addChildShape(at({0, 0, 0}), &inner);
        for (auto [compound, child] : {std::pair<btCompoundShape*, btCollisionShape*>{&ofBullet, &bulletBox},
                                       std::pair<btCompoundShape*, btCollisionShape*>{&ofField, &box}}) {
            compound->addChildShape(at({0, 0, 20}), &far);
            compound->addChildShape(at({0, 0, 0}), child);
        }
        btCollisionShape& under = groundInCompound ? static_cast<btCollisionShape&>(outer) : ground.shape;
        int tried = 0;
        for (const auto& [id, triangle] : triangles) {
            if (tried++ % 17 != 0) continue;
            CAPTURE(ground.name, groundIsFirst, groundInCompound, boxInCompound, id.first, id.second);
            glm::dvec3 up = glm::normalize(glm::cross(triangle[1] - triangle[0], triangle[2] - triangle[0]));
            if (up.z < 0) up = -up;
            const glm::vec3 middle((triangle[0] + triangle[1] + triangle[2]) / 3. + (double(half) - 0.002) * up);
            const btTransform place(shortestArcQuat({0, 0, 1}, bullet::detail::toBullet(glm::vec3(up))),
                                    bullet::detail::toBullet(middle));
            btCollisionShape &theirs = boxInCompound ? static_cast<btCollisionShape&>(ofBullet) : bulletBox,
                             &ours = boxInCompound ? static_cast<btCollisionShape&>(ofField) : box;
            const Small expected = namesUnder(under, theirs, place, groundIsFirst),
                        found = namesUnder(under, ours, place, groundIsFirst);
            REQUIRE_FALSE(expected.inStep.empty());
            REQUIRE_FALSE(found.inStep.empty());
            REQUIRE_FALSE(found.inTest.empty());
            const auto has = [&](const std::vector<Seen>& all, const Seen& one) {
                return std::any_of(all.begin(), all.end(), [&](const Seen& other) {
                    return one.ofMesh == other.ofMesh && (!boxInCompound || one.ofOther == other.ofOther);
                });
            };
            for (const auto* seen : {&found.inStep, &found.inTest})
                for (const Seen& one : *seen) {
                    CAPTURE(one.ofMesh.first, one.ofMesh.second, one.ofOther.first, one.ofOther.second);
                    CHECK(one.ofMesh == id);
                    if (boxInCompound)
                        CHECK(one.ofOther == Id(-1, 1));
                    else
                        CHECK(one.ofOther.first == 0);
                    CHECK(has(expected.inStep, one));
                }
            for (const auto& children : found.children) CHECK(children == expected.children.front());
        }
    }
}
}  // namespace bilayer::triangle_ids_test
