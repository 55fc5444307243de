// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/body/body.h"
#include "collider/contact/body/collider_data.h"

#include <oneapi/tbb/parallel_for.h>
#include <openvdb/points/PointAttribute.h>
#include <openvdb/points/PointCount.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <limits>
#include <stdexcept>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/vdb_io.h>
#include "demos/shared/shapes.h"
#include "sdf/base/access.h"
#include "sdf/base/openvdb_points.h"
#include "tests/support/analytic.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::body_test {
using namespace bilayer::detail;
using namespace bilayer::test;

namespace {

Mesh shifted(Mesh mesh, const glm::vec3& by) {
    for (glm::vec3& point : mesh.points) point += by;
    return mesh;
}

// A collider of a mesh, and the same collider read from a file.
struct Pair {
    explicit Pair(const Mesh& mesh, float voxel, const VdbOptions& file = {}, const ColliderOptions& options = {})
        : field(build(mesh, {.voxelSize = voxel})), made(mesh, field, options), loaded(read(dataOf(made).body, file)) {}

    Collider withoutMesh() const {
        Body body = dataOf(made).body;
        body.mesh.reset();
        return read(body, {});
    }

    LevelSet field;
    Collider made, loaded;

  private:
    Collider read(const Body& body, const VdbOptions& options) const {
        const auto path = scratch("body.vdb");
        writeVdb(path, withBody(field, body), options);
        return Collider(readVdb(path));
    }
};

void requireSame(const Body& a, const Body& b) {
    REQUIRE(a.points.points().size() == b.points.points().size());
    for (std::size_t i = 0; i < a.points.points().size(); ++i) {
        const SurfacePoint &p = a.points.points()[i], &q = b.points.points()[i];
        REQUIRE(p.position == q.position);
        REQUIRE(p.normal == q.normal);
        REQUIRE(p.isSharp == q.isSharp);
    }
    REQUIRE(std::equal(a.points.tree().nodes().begin(), a.points.tree().nodes().end(), b.points.tree().nodes().begin(),
                       b.points.tree().nodes().end(), [](const auto& m, const auto& n) {
                           return m.centre == n.centre && m.radius == n.radius && m.begin == n.begin &&
                                  m.end == n.end && m.next == n.next;
                       }));
    REQUIRE(a.bounds.lower == b.bounds.lower);
    REQUIRE(a.bounds.upper == b.bounds.upper);
    REQUIRE(a.margin == b.margin);
    REQUIRE(a.accuracy == b.accuracy);
    REQUIRE((a.mesh == nullptr) == (b.mesh == nullptr));
    if (a.mesh) {
        REQUIRE(a.mesh->points == b.mesh->points);
        REQUIRE(a.mesh->triangles == b.mesh->triangles);
    }
    REQUIRE(a.mass.has_value() == b.mass.has_value());
    if (!a.mass) return;
    REQUIRE(a.mass->volume == b.mass->volume);
    REQUIRE(a.mass->centre == b.mass->centre);
    REQUIRE(a.mass->inertia == b.mass->inertia);
    REQUIRE(a.mass->principalInertia == b.mass->principalInertia);
    REQUIRE(a.mass->principalAxes == b.mass->principalAxes);
}

const LevelSet& stored() {
    static const LevelSet field = [] {
        const Mesh mesh = shapes::box({0.3f, 0.2f, 0.1f}, 3);
        const LevelSet plain = build(mesh, {.voxelSize = 0.02f});
        return withBody(plain, mesh);
    }();
    return field;
}

using Distance = openvdb::FloatGrid;
using Points = openvdb::points::PointDataGrid;

// The stored body, modified in copies of its grids.
LevelSet changed(const std::function<void(Distance&)>& distance, const std::function<void(Points&)>& points = {}) {
    auto grids = std::make_shared<Grids>(stored().grids());
    const auto field = grids->distance->deepCopy();
    if (distance) distance(*field);
    grids->distance = field;
    const auto copy = openvdb::gridConstPtrCast<Points>(grids->points)->deepCopy();
    if (points) points(*copy);
    grids->points = copy;
    return LevelSet(grids);
}

template <class Value>
std::function<void(Distance&)> setting(const char* name, const Value& value) {
    return [=](Distance& grid) {
        grid.removeMeta(name);
        grid.insertMeta(name, openvdb::TypedMetadata<Value>(value));
    };
}

template <class Value>
std::function<void(Points&)> settingPoint(const char* name, const Value& value) {
    return [=](Points& grid) {
        openvdb::points::AttributeWriteHandle<Value> handle(grid.tree().beginLeaf()->attributeArray(name));
        handle.set(0, value);
    };
}

void requireRefusal(const LevelSet& field, const std::string& why) {
    CAPTURE(why);
    REQUIRE_THROWS_AS(bodyOf(field), std::invalid_argument);
    REQUIRE_THROWS_WITH(Collider(field), Catch::Contains(why));
}

}  // namespace

TEST_CASE("a body comes back from its file bit by bit") {
    const auto [mesh, voxel] =
        GENERATE(std::pair(shapes::torusKnot(2, 3, 0.5f, 0.15f, 200, 16), 0.03f),
                 std::pair(shapes::sphere(0.4f, 4), 1.f / 32), std::pair(shapes::box({0.3f, 0.2f, 0.1f}, 2), 0.0217f),
                 // coordinates with few digits left, and with many
                 std::pair(shifted(shapes::sphere(0.4f, 3), {1000.3f, -77.77f, 1e-4f}), 0.05f),
                 std::pair(shapes::torus(0.0035f, 0.0013f), 1e-4f));
    const bool half = GENERATE(false, true);
    CAPTURE(voxel, half);
    const Pair pair(mesh, voxel, {.halfFloat = half},
                    {.margin = GENERATE(-1.f, 0.0123f),
                     .accuracy = half ? ContactAccuracy::samples : ContactAccuracy::exactNearFeatures});
    REQUIRE(dataOf(pair.made).points().points().size() > 100);
    REQUIRE(dataOf(pair.made).body.mesh);
    requireSame(dataOf(pair.made).body, dataOf(pair.loaded).body);
    REQUIRE(pair.loaded.field().voxelSize() == pair.made.field().voxelSize());
}

TEST_CASE("bodies from files touch where those of meshes do, to the bit") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const float h = 0.03f;
    const ContactAccuracy accuracy =
        GENERATE(ContactAccuracy::samples, ContactAccuracy::exactNearFeatures, ContactAccuracy::exact);
    const Pair knot(shapes::torusKnot(2, 3, 0.5f, 0.15f, 200, 16), h, {}, {.accuracy = accuracy}),
        box(shapes::box({0.3f, 0.2f, 0.1f}, 2), h, {}, {.accuracy = accuracy});
    CHECK((knot.loaded.field().mesh() != nullptr) == (accuracy != ContactAccuracy::samples));
    std::size_t found = 0;
    for (int i = 0; i < 200; ++i) {
        const Pose a{random.point(0.5), glm::angleAxis(float(random(0, 6.28)), random.direction())};
        const Motion motion{random.point(0.1), random.point(0.2)};
        std::vector<Contact> expected, contacts;
        const auto collided = [&](const Collider& first, const Collider& second, std::vector<Contact>& list) {
            return collide(Placed{first, a, 1.5f, motion}, Placed{second}, {.margin = first.margin()}, list);
        };
        const ContactReport one = collided(box.made, knot.made, expected);
        const ContactReport other = collided(box.loaded, knot.loaded, contacts);
        REQUIRE(one.pointsTested == other.pointsTested);
        REQUIRE(one.beyondBand == other.beyondBand);
        REQUIRE(contacts.size() == expected.size());
        for (std::size_t k = 0; k < contacts.size(); ++k) {
            REQUIRE(contacts[k].position == expected[k].position);
            REQUIRE(contacts[k].normal == expected[k].normal);
            REQUIRE(contacts[k].distance == expected[k].distance);
            REQUIRE(contacts[k].approach == expected[k].approach);
            REQUIRE(contacts[k].feature == expected[k].feature);
        }
        found += contacts.size();
    }
    REQUIRE(found > 100);
}

TEST_CASE("the triangles of a body without a mesh are those of its field") {
    const Pair ball(shapes::sphere(0.4f, 4), 0.02f);
    const Collider loaded = ball.withoutMesh();
    REQUIRE_FALSE(dataOf(loaded).body.mesh);
    REQUIRE(loaded.mesh().triangles.size() > 1000);
    for (const glm::vec3& point : loaded.mesh().points) REQUIRE(glm::length(point) == Approx(0.4f).margin(1e-3));
    REQUIRE(massProperties(loaded.mesh()).volume == Approx(ball.made.mass().volume).epsilon(5e-3));
}

TEST_CASE("many threads may ask at once for the triangles of a body without a mesh") {
    const Pair ball(shapes::sphere(0.4f, 4), 0.02f);
    const Collider loaded = ball.withoutMesh();
    std::vector<const Mesh*> meshes(64);
    tbb::parallel_for(std::size_t(0), meshes.size(), [&](std::size_t i) { meshes[i] = &loaded.mesh(); });
    for (const Mesh* mesh : meshes) REQUIRE(mesh == meshes[0]);
    REQUIRE_FALSE(meshes[0]->triangles.empty());
    const Collider copy = loaded;
    REQUIRE(&copy.mesh() == meshes[0]);
}

TEST_CASE("A body keeps the flipped triangles of its mesh") {
    Mesh inside = shapes::torusKnot(2, 3, 0.5f, 0.15f, 200, 16);
    for (glm::uvec3& triangle : inside.triangles) std::swap(triangle.x, triangle.y);
    const Pair knot(inside, 0.03f, {}, {.accuracy = ContactAccuracy::exact});
    const Mesh outward = shapes::torusKnot(2, 3, 0.5f, 0.15f, 200, 16);
    REQUIRE(massProperties(knot.loaded.mesh()).volume == Approx(massProperties(outward).volume));
    requireSame(dataOf(knot.made).body, dataOf(knot.loaded).body);
}

TEST_CASE("an open mesh has no mass, in a file neither") {
    Mesh sheet;
    sheet.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
    sheet.triangles = {{0, 1, 2}, {2, 1, 3}};
    const Pair pair(sheet, 0.05f);
    requireSame(dataOf(pair.made).body, dataOf(pair.loaded).body);
    REQUIRE_THROWS_WITH(pair.made.mass(), Catch::Contains("no volume"));
    REQUIRE_THROWS_WITH(pair.loaded.mass(), Catch::Contains("no volume"));
    // added to a field that had a body with a mass, it replaces all of that
    Body body = bodyOf(stored());
    REQUIRE(body.mass);
    body.mass.reset();
    REQUIRE_FALSE(bodyOf(withBody(stored(), body)).mass);
    body.mesh.reset();
    REQUIRE_FALSE(bodyOf(withBody(stored(), body)).mesh);
    REQUIRE(bodyOf(withBody(stored(), body)).accuracy == ContactAccuracy::samples);
}

TEST_CASE("a field alone is no body") {
    const LevelSet plain = levelSetOf(sphereSolid(0.4), 0.05);
    REQUIRE_FALSE(hasBody(plain));
    REQUIRE(hasBody(stored()));
    requireRefusal(plain, "no body");
    REQUIRE_THROWS_AS(withBody(plain, Body{}), std::invalid_argument);
}

TEST_CASE("damaged bodies are refused by what is wrong") {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    REQUIRE_NOTHROW(Collider(changed({})));
    requireRefusal(changed(setting("bilayer:body", std::int32_t(99))), "format 99");
    requireRefusal(changed(setting("bilayer:margin", nan)), "bilayer:margin");
    requireRefusal(changed(setting("bilayer:margin", -1.f)), "bilayer:margin");
    requireRefusal(changed(setting("bilayer:volume", double(nan))), "bilayer:volume");
    requireRefusal(changed(setting("bilayer:volume", -1.0)), "bilayer:volume");
    requireRefusal(changed(setting("bilayer:principal_axes", openvdb::Vec4s(0, 0, 0, 0))), "no rotation");
    requireRefusal(changed(setting("bilayer:principal_inertia", openvdb::Vec3s(1, 1, -1))),
                   "bilayer:principal_inertia");
    for (const char* name : {"bilayer:bounds_lower", "bilayer:bounds_upper", "bilayer:centre_of_mass",
                             "bilayer:inertia", "bilayer:inertia_products", "bilayer:principal_inertia"}) {
        requireRefusal(changed(setting(name, openvdb::Vec3s(0, nan, 0))), name);
        requireRefusal(changed([=](Distance& grid) { grid.removeMeta(name); }), name);
    }
    requireRefusal(changed(setting("bilayer:bounds_upper", openvdb::Vec3s(0.3f, 0.2f, 0.05f))),
                   "outside of 'bilayer:bounds_lower'");

    requireRefusal(changed(setting("bilayer:measure", std::string("thumb"))), "'bilayer:measure' is 'thumb'");
    requireRefusal(changed([](Distance& grid) { grid.removeMeta("bilayer:measure"); }), "bilayer:measure");
    requireRefusal(changed(setting("bilayer:mesh", 7.f)), "type 'float'");

    requireRefusal(changed({}, [](Points& grid) { grid.clear(); }), "no surface points");
    auto grids = std::make_shared<Grids>(stored().grids());
    grids->points = nullptr;
    requireRefusal(LevelSet(grids), "no surface points");
    grids->points = openvdb::FloatGrid::create();
    requireRefusal(LevelSet(grids), "no surface points");

    requireRefusal(changed({}, settingPoint("N", openvdb::Vec3s(0, 0, 2))), "needs a finite position and a normal");
    requireRefusal(changed({}, settingPoint("P", openvdb::Vec3s(nan, 0, 0))), "needs a finite position and a normal");
    requireRefusal(changed({}, settingPoint("id", std::int32_t(-1))), "one has -1");
    requireRefusal(changed({}, settingPoint("id", std::int32_t(1 << 30))), "number");
    const std::int32_t taken =
        openvdb::points::AttributeHandle<std::int32_t>(
            openvdb::gridConstPtrCast<Points>(stored().grids().points)->tree().cbeginLeaf()->constAttributeArray("id"))
            .get(1);
    requireRefusal(changed({}, settingPoint("id", taken)), "number");
    for (const char* name : {"N", "id", "sharp", "back"})
        requireRefusal(changed({}, [=](Points& grid) { openvdb::points::dropAttribute(grid.tree(), name); }),
                       "contact_points");
}

using Bytes = openvdb::UnknownMetadata;

std::shared_ptr<const Bytes> meshBytes(const LevelSet& field) {
    return std::dynamic_pointer_cast<const Bytes>((*field.grids().distance)["bilayer:mesh"]);
}

LevelSet withMeshBytes(const Bytes::ByteVec& bytes) {
    return changed([&](Distance& grid) {
        Bytes entry("bilayer_mesh");
        entry.setValue(bytes);
        grid.removeMeta("bilayer:mesh");
        grid.insertMeta("bilayer:mesh", entry);
    });
}

TEST_CASE("a damaged mesh of a body is refused, whichever byte it is") {
    const Bytes::ByteVec whole = meshBytes(stored())->value();
    REQUIRE_NOTHROW(Collider(withMeshBytes(whole)));
    for (const double part : {0., 0.01, 0.5, 0.999}) {
        Bytes::ByteVec bytes = whole;
        bytes.resize(std::size_t(part * double(bytes.size())));
        requireRefusal(withMeshBytes(bytes), "bilayer:mesh");
    }
    for (std::size_t i = 0; i < whole.size(); i += i < 24 ? 1 : 41) {
        Bytes::ByteVec bytes = whole;
        bytes[i] ^= 0x55;
        requireRefusal(withMeshBytes(bytes), "bilayer:mesh");
    }
}

TEST_CASE("a body with the mesh of another, or with one that is not valid, is refused") {
    const Pair other(shapes::box({0.3f, 0.2f, 0.11f}, 3), 0.02f);
    requireRefusal(withMeshBytes(meshBytes(withBody(other.field, dataOf(other.made).body))->value()),
                   "'bilayer:mesh_hash'");
    Body body = bodyOf(stored());
    Mesh bad = *body.mesh;
    bad.triangles[7].y = 1u << 30;
    body.mesh = std::make_shared<const Mesh>(bad);
    REQUIRE_THROWS_AS(withBody(stored(), body), std::invalid_argument);
}

TEST_CASE("a field that was moved away from its body is rejected") {
    requireRefusal(changed([](Distance& grid) { grid.transform().postTranslate(openvdb::Vec3d(0.1, 0, 0)); }),
                   "another field");
    requireRefusal(changed([](Distance& grid) { grid.transform().postScale(0.5); }), "another field");
}

TEST_CASE("a body's file that was cut is refused by name") {
    const auto whole = scratch("whole_body.vdb"), path = scratch("cut_body.vdb");
    writeVdb(whole, stored());
    for (const double part : {0.1, 0.5, 0.8, 0.9, 0.99, 0.999}) {
        std::filesystem::copy_file(whole, path, std::filesystem::copy_options::overwrite_existing);
        std::filesystem::resize_file(path, std::uintmax_t(part * double(std::filesystem::file_size(whole))));
        CAPTURE(part);
        REQUIRE_THROWS_WITH(readVdb(path), Catch::Contains("cut_body.vdb"));
    }
}

TEST_CASE("other programs see a body's points where they are") {
    const auto grid = openvdb::gridConstPtrCast<Points>(stored().grids().points);
    const Body body = bodyOf(stored());
    const auto points = body.points.points();
    REQUIRE(openvdb::points::pointCount(grid->tree()) == points.size());
    REQUIRE(grid->getName() == "contact_points");
    for (auto leaf = grid->tree().cbeginLeaf(); leaf; ++leaf) {
        const openvdb::points::AttributeHandle<openvdb::Vec3s> place(leaf->constAttributeArray("P"));
        const openvdb::points::AttributeHandle<std::int32_t> id(leaf->constAttributeArray("id"));
        for (auto index = leaf->beginIndexOn(); index; ++index) {
            const openvdb::Vec3s local = place.get(*index);
            REQUIRE(std::max({std::abs(local.x()), std::abs(local.y()), std::abs(local.z())}) <= 0.5f);
            const openvdb::Vec3d world = grid->indexToWorld(index.getCoord().asVec3d() + openvdb::Vec3d(local));
            const glm::vec3 position = points[std::size_t(id.get(*index))].position;
            REQUIRE(glm::distance(position, glm::vec3(world.x(), world.y(), world.z())) < 1e-6f);
        }
    }
}
}  // namespace bilayer::body_test
