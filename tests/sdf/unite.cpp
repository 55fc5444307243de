// SPDX-License-Identifier: Apache-2.0
// Unions: unite() leaves the outer surface, compared with the ground truth of boxes and spheres; fields of unions are
// exact.
#include "sdf/mesh/unite.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <random>
#include <utility>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/inspect.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "sdf/sign/sign_choice.h"
#include "tests/sdf/union_solids.h"
#include "tests/support/support.h"
#include "tests/support/truth.h"

namespace bilayer::unite_test {
using namespace bilayer::detail;
using namespace bilayer::test;

namespace {

double toSegment(const glm::dvec3& p, const glm::dvec3& a, const glm::dvec3& b) {
    const glm::dvec3 edge = b - a;
    const double t =
        glm::dot(edge, edge) > 0 ? std::clamp(glm::dot(p - a, edge) / glm::dot(edge, edge), 0.0, 1.0) : 0.0;
    return glm::length(p - a - t * edge);
}

// The distance to the surface of one box outside another: to a face if the projection on it is free, else to the
// borders of its free part.
double toFree(const glm::dvec3& p, const RotatedBox& box, const RotatedBox& other) {
    double smallest = std::numeric_limits<double>::infinity();
    for (const auto& face : box.faces()) {
        const glm::dvec3 normal = glm::normalize(glm::cross(face[1] - face[0], face[2] - face[0]));
        const glm::dvec3 foot = p - glm::dot(normal, p - face[0]) * normal;
        const glm::dvec3 local = glm::abs(box.toLocal(foot)) - box.half;
        if (std::max({local.x, local.y, local.z}) < 1e-12 && !other.holds(foot))
            smallest = std::min(smallest, glm::length(p - foot));
        for (std::size_t i = 0; i < 4; ++i) {
            const glm::dvec3 &a = face[i], &b = face[(i + 1) % 4];
            const auto [first, last] = other.within(a, b);
            if (first > last) {
                smallest = std::min(smallest, toSegment(p, a, b));
                continue;
            }
            if (first > 0) smallest = std::min(smallest, toSegment(p, a, a + first * (b - a)));
            if (last < 1) smallest = std::min(smallest, toSegment(p, a + last * (b - a), b));
        }
        // the border of the other box on the face; the face's own border is handled above
        const auto hole = other.clipped(face);
        for (std::size_t i = 0; i < hole.size(); ++i) {
            const glm::dvec3 &a = hole[i], &b = hole[(i + 1) % hole.size()];
            const glm::dvec3 middle = glm::abs(other.toLocal(0.5 * (a + b))) - other.half;
            if (std::abs(std::max({middle.x, middle.y, middle.z})) < 1e-9)
                smallest = std::min(smallest, toSegment(p, a, b));
        }
    }
    return smallest;
}

double coneVolume(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
    return glm::dot(a, glm::cross(b, c)) / 6;
}

// The volume of the union of two boxes, from the faces of each within the other.
double unionVolume(const RotatedBox& a, const RotatedBox& b) {
    double volume = 8 * (a.half.x * a.half.y * a.half.z + b.half.x * b.half.y * b.half.z);
    for (const auto& [box, other] : {std::pair(a, b), std::pair(b, a)})
        for (const auto& face : box.faces()) {
            const auto common = other.clipped(face);
            // `faces` runs around some faces in the other direction
            const double side = glm::dot(glm::cross(face[1] - face[0], face[2] - face[0]), face[0] - box.centre);
            for (std::size_t i = 2; i < common.size(); ++i)
                volume -= (side > 0 ? 1 : -1) * coneVolume(common[0], common[i - 1], common[i]);
        }
    return volume;
}

double volumeWithin(const LabelledMesh& boundary) {
    double volume = 0;
    for (std::size_t i = 0; i < boundary.mesh.triangles.size(); ++i) {
        const glm::uvec3& t = boundary.mesh.triangles[i];
        const auto& points = boundary.mesh.points;
        volume += coneVolume(points[t.x], points[t.y], points[t.z]) / boundary.labels[i];
    }
    return volume;
}

Mesh randomSolid(std::mt19937& random) {
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<float> size(0.2f, 0.6f), place(-0.4f, 0.4f);
    std::vector<Mesh> kinds{shapes::sphere(size(random), 3), shapes::torus(size(random) + 0.2f, 0.18f, 48, 24),
                            shapes::box({size(random), size(random), 0.15f}), shapes::cylinder(size(random), 0.9f, 40)};
    const glm::dquat rotation =
        glm::normalize(glm::dquat(normal(random), normal(random), normal(random), normal(random)));
    Mesh solid = turned(kinds[random() % kinds.size()], rotation);
    return shapes::moved(solid, {place(random), place(random), place(random)});
}

// The signed distance of two balls whose surfaces intersect.
double toBalls(const glm::dvec3& p, const glm::dvec3& c1, double r1, const glm::dvec3& c2, double r2) {
    const double d1 = glm::length(p - c1) - r1, d2 = glm::length(p - c2) - r2;
    if (d1 > 0 && d2 > 0) return std::min(d1, d2);
    const glm::dvec3 axis = glm::normalize(c2 - c1);
    const double apart = glm::length(c2 - c1), along = 0.5 * (apart + (r1 * r1 - r2 * r2) / apart);
    const double ring = std::sqrt(r1 * r1 - along * along);
    const glm::dvec3 q = p - c1 - along * axis, radial = q - glm::dot(q, axis) * axis;
    double smallest = std::hypot(glm::dot(q, axis), glm::length(radial) - ring);
    const auto addCap = [&](const glm::dvec3& c, double r, const glm::dvec3& other, double otherRadius) {
        const glm::dvec3 foot = c + r * glm::normalize(p - c);
        if (glm::length(foot - other) > otherRadius) smallest = std::min(smallest, glm::length(p - foot));
    };
    addCap(c1, r1, c2, r2);
    addCap(c2, r2, c1, r1);
    return -smallest;
}

// Pairs of boxes at any angle that mostly overlap.
class RotatedPairs {
  public:
    RotatedPairs(std::mt19937& random, double minSize) : random_(random), size_(minSize, 0.7) {}

    std::array<RotatedBox, 2> operator()() {
        std::array<RotatedBox, 2> boxes;
        for (RotatedBox& box : boxes)
            box = {{place_(random_), place_(random_), place_(random_)},
                   {size_(random_), size_(random_), size_(random_)},
                   glm::normalize(glm::dquat(normal_(random_), normal_(random_), normal_(random_), normal_(random_)))};
        return boxes;
    }

  private:
    std::mt19937& random_;
    std::uniform_real_distribution<double> size_, place_{-0.3, 0.3};
    std::normal_distribution<double> normal_;
};

}  // namespace

TEST_CASE("a mesh without buried walls keeps its bytes") {
    std::vector<Mesh> meshes{shapes::sphere(0.5f, 4), shapes::torus(0.5f, 0.2f), shapes::box({0.4f, 0.3f, 0.2f}, 3),
                             shapes::bowl(0.5f, 0.05f)};
    meshes.push_back(shapes::join({shapes::sphere(0.5f, 3), shapes::flipped(shapes::sphere(0.3f, 3))}));
    meshes.push_back(shapes::join({shapes::sphere(0.5f, 3), shapes::moved(shapes::sphere(0.5f, 3), {2, 0, 0})}));
    for (const char* name : {"bunny_watertight.obj", "spot.obj", "fandisk.obj", "bunny_5k_open.obj"})
        if (const auto path = test::corpusMesh(name)) meshes.push_back(readMesh(*path));
    for (const Mesh& mesh : meshes) {
        CAPTURE(mesh.triangles.size());
        const UnionSurface united = unite(mesh);
        CHECK(united.buriedTriangles == 0);
        CHECK(united.cutTriangles == 0);
        CHECK(hash(united.mesh) == hash(mesh));
    }
}

TEST_CASE("the union of boxes has their outer surface, also where they touch and lie flush") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    int changed = 0;
    for (int i = 0; i < 200; ++i) {
        const auto boxes = randomBoxes(random, 2 + i % 5);
        CAPTURE(i, boxes.size());
        const glm::dquat rotation =
            i % 2 ? glm::normalize(glm::dquat(normal(random), normal(random), normal(random), normal(random)))
                  : glm::dquat(1, 0, 0, 0);
        const UnionSurface united = unite(turned(joined(boxes), rotation));
        changed += united.changed();
        CHECK(difference(united.mesh, turned(truthOf(boxes), rotation), randomPoints(random, 200)) < 1e-6);
    }
    CHECK(changed > 120);
}

TEST_CASE("the union of two boxes at any angle has their outer surface") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    RotatedPairs randomPair(random, 0.2);
    for (int i = 0; i < 200; ++i) {
        CAPTURE(i);
        const std::array<RotatedBox, 2> boxes = randomPair();
        const test::Truth united(unite(shapes::join({boxes[0].mesh(), boxes[1].mesh()})).mesh);
        for (const glm::dvec3& p : randomPoints(random, 100))
            REQUIRE(united.distance(p) ==
                    Approx(std::min(toFree(p, boxes[0], boxes[1]), toFree(p, boxes[1], boxes[0]))).margin(2e-6));
    }
}

TEST_CASE("the boundary of a union encloses its volume: boxes at any angle") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    RotatedPairs randomPair(random, 0.05);
    for (int i = 0; i < 300; ++i) {
        CAPTURE(i);
        const std::array<RotatedBox, 2> boxes = randomPair();
        const double volume = unionVolume(boxes[0], boxes[1]);
        CHECK(volumeWithin(unionBoundary(shapes::join({boxes[0].mesh(), boxes[1].mesh()}))) ==
              Approx(volume).margin(1e-6));
    }
}

TEST_CASE("the boundary of a union encloses its volume: boxes that touch and lie flush, copies, cavities") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    for (int i = 0; i < 200; ++i) {
        auto boxes = randomBoxes(random, 2 + i % 5);
        if (i % 4 == 0) boxes.push_back(boxes.front());
        CAPTURE(i, boxes.size());
        Mesh mesh = joined(boxes);
        double volume = inspect(truthOf(boxes)).volume;
        if (i % 3 == 0) {
            // a cavity that one more solid fills in part
            const Box around{{-2, -2, -2}, {2, 2, 2}}, cavity{{-1.5f, -1.5f, -1.5f}, {1.5f, 1.5f, 1.5f}};
            mesh = shapes::join({mesh, around.mesh(), shapes::flipped(cavity.mesh())});
            volume += 64 - 27;
        }
        if (i % 2) {
            const glm::dquat rotation(normal(random), normal(random), normal(random), normal(random));
            mesh = turned(std::move(mesh), glm::normalize(rotation));
        }
        CHECK(volumeWithin(unionBoundary(mesh)) == Approx(volume).margin(5e-6));
    }
}

TEST_CASE("the boundary of a union encloses the points with a winding number above one half") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (int i = 0; i < 4; ++i) {
        CAPTURE(i);
        std::vector<Mesh> solids;
        for (int k = 0; k < 5; ++k) solids.push_back(randomSolid(random));
        const Mesh mesh = shapes::join(solids);
        const LabelledMesh boundary = unionBoundary(mesh);
        const test::Truth truth(mesh);
        constexpr int count = 200000;
        constexpr double side = 3;
        int inside = 0;
        for (const glm::dvec3& p : randomPoints(random, count, side / 2)) inside += truth.winding(p) > 0;
        const double share = double(inside) / count, deviation = std::sqrt(share * (1 - share) / count);
        const double cube = side * side * side;
        CHECK(volumeWithin(boundary) == Approx(share * cube).margin(5 * deviation * cube));
    }
}

TEST_CASE("a union far from the world origin keeps its origin") {
    Mesh mesh = joined({{{-1, -1, -1}, {0.5f, 1, 1}}, {{0, -1, -1}, {1, 1, 1}}});
    mesh.origin = {5e6, 0, -3e6};
    CHECK(unite(mesh).mesh.origin == mesh.origin);
    CHECK(unionBoundary(mesh).mesh.origin == mesh.origin);
}

TEST_CASE("the union of balls is that of their formula but for what their facets cut off") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> anywhere(-0.2f, 0.2f);
    for (int i = 0; i < 5; ++i) {
        const float r1 = 0.5f, r2 = 0.4f + anywhere(random);
        const glm::vec3 c2(0.45f + anywhere(random), anywhere(random), anywhere(random));
        const UnionSurface united =
            unite(shapes::join({shapes::sphere(r1, 5), shapes::moved(shapes::sphere(r2, 5), c2)}));
        if (std::abs(r1 - r2) > 0.8f * glm::length(c2)) continue;  // ill-conditioned circle
        CHECK(united.buriedTriangles > 100);
        CHECK(united.cutTriangles > 50);
        const test::Truth truth(united.mesh);
        // sagitta of edges 1/26 of the radius long, larger where the surfaces meet at an angle
        for (const glm::dvec3& p : randomPoints(random, 500))
            REQUIRE(truth.distance(p) ==
                    Approx(std::abs(toBalls(p, glm::dvec3(0), double(r1), glm::dvec3(c2), double(r2)))).margin(2e-3));
    }
}

TEST_CASE("solids within solids, copies and neighbours") {
    const Mesh outer = shapes::sphere(0.5f, 3);
    SECTION("a solid within a solid goes, a cavity within that stays") {
        const Mesh cavity = shapes::flipped(shapes::sphere(0.1f, 2));
        const UnionSurface united = unite(shapes::join({outer, shapes::sphere(0.3f, 3)}));
        CHECK(united.buriedTriangles == shapes::sphere(0.3f, 3).triangles.size());
        CHECK(united.cutTriangles == 0);
        CHECK(
            unite(shapes::join({outer, shapes::flipped(shapes::sphere(0.3f, 3)), shapes::sphere(0.2f, 3)})).changed() ==
            false);
        CHECK(unite(shapes::join({outer, cavity})).changed() == false);
    }
    SECTION("a copy stays") {
        CHECK_FALSE(unite(shapes::join({outer, outer})).changed());
    }
    SECTION("a cavity that another solid fills goes") {
        const Mesh filled =
            shapes::join({shapes::sphere(0.5f, 3), shapes::flipped(shapes::sphere(0.3f, 3)), shapes::sphere(0.3f, 3)});
        const UnionSurface united = unite(filled);
        CHECK(united.mesh.triangles.size() == outer.triangles.size());
    }
    SECTION("the wall between neighbours goes") {
        const Box left{{-1, -1, -1}, {0, 1, 1}}, right{{0, -1, -1}, {1, 1, 1}};
        const UnionSurface united = unite(joined({left, right}));
        CHECK(united.buriedTriangles == 4);
        CHECK(united.cutTriangles == 0);
        CHECK(inspect(united.mesh).area == Approx(24));
        CHECK(inspect(united.mesh).volume == Approx(8));
    }
}

TEST_CASE("fields of unions have exact distances and the right sides") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    const Method method = GENERATE(Method::exact, Method::pseudonormal);
    for (int i = 0; i < 6; ++i) {
        CAPTURE(i);
        const auto boxes = randomBoxes(random, 4);
        const Mesh mesh = joined(boxes);
        const test::Truth truth(truthOf(boxes));
        const LevelSet field = build(mesh, {.voxelSize = 0.04f, .method = method, .unite = true, .triangles = true});
        const auto& grids = field.grids();
        const Mesh outward = outwardMesh(field, mesh);
        int wrong = 0, other = 0, missing = 0;
        for (auto voxel = grids.distance->cbeginValueOn(); voxel; ++voxel) {
            const openvdb::Vec3d at = grids.distance->indexToWorld(voxel.getCoord());
            const glm::dvec3 p(at.x(), at.y(), at.z());
            const double distance = truth.distance(p);
            wrong += std::abs(std::abs(double(*voxel)) - distance) > 1e-4 * 0.04;
            if (distance > 1e-5) wrong += (truth.winding(p) > 0) != (*voxel < 0);
            const auto& t = outward.triangles[std::size_t(grids.triangle->tree().getValue(voxel.getCoord()))];
            other += std::abs(std::sqrt(test::squaredDistance(p, outward.points[t.x], outward.points[t.y],
                                                              outward.points[t.z])) -
                              distance) > 1e-4 * 0.04;
        }
        for (const glm::dvec3& p : randomPoints(random, 2000)) {
            const auto voxel = openvdb::Coord::round(grids.distance->worldToIndex({p.x, p.y, p.z}));
            const openvdb::Vec3d at = grids.distance->indexToWorld(voxel);
            const double d = truth.signedDistance({at.x(), at.y(), at.z()});
            if (std::abs(d) < 1e-5) continue;
            missing +=
                grids.distance->tree().isValueOn(voxel) != (std::abs(d) < 0.12) && std::abs(std::abs(d) - 0.12) > 1e-5;
            missing += (grids.distance->tree().getValue(voxel) < 0) != (d < 0);
        }
        CHECK(wrong == 0);
        CHECK(other == 0);
        CHECK(missing == 0);
    }
}

TEST_CASE("A union that is inside out is flipped") {
    const Box first{{-0.5f, -0.5f, -0.5f}, {0.2f, 0.2f, 0.2f}}, second{{-0.1f, -0.1f, -0.1f}, {0.6f, 0.6f, 0.6f}};
    const Mesh mesh = joined({first, second});
    const LevelSet right = build(mesh, {.voxelSize = 0.05f, .unite = true});
    const LevelSet wrong = build(shapes::flipped(mesh), {.voxelSize = 0.05f, .unite = true});
    CHECK(right.activeVoxels() == wrong.activeVoxels());
    CHECK(right.signReason().find("union") == 0);
    CHECK(wrong.grids().distance->tree().getValue({1, 1, 1}) < 0);
    CHECK(outwardMesh(right, mesh).triangles.size() == unite(mesh).mesh.triangles.size());
}

TEST_CASE("what no union can be made of is refused") {
    const Mesh mesh = shapes::sphere(0.5f, 2);
    CHECK_THROWS_AS(build(mesh, {.voxelSize = 0.1f, .method = Method::doubleLayer, .unite = true}),
                    std::invalid_argument);
    CHECK_THROWS_AS(build(mesh, {.voxelSize = 0.1f, .sign = Sign::flood, .unite = true}), std::invalid_argument);
}
}  // namespace bilayer::unite_test
