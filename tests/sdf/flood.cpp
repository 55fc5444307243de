// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/flood.h"

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <random>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "tests/sdf/unsigned_band.h"
#include "tests/support/support.h"

namespace bilayer::flood_test {
using namespace bilayer::detail;

namespace {

Mesh someFlipped(Mesh mesh, unsigned seed) {
    std::mt19937 random(seed);
    for (auto& t : mesh.triangles)
        if (random() % 2) std::swap(t.y, t.z);
    return mesh;
}

// The mesh without the triangles whose centre satisfies `gone`.
template <class Gone>
Mesh without(const Mesh& mesh, const Gone& gone) {
    Mesh rest{mesh.points, {}};
    for (const auto& t : mesh.triangles)
        if (!gone((mesh.points[t.x] + mesh.points[t.y] + mesh.points[t.z]) / 3.f)) rest.triangles.push_back(t);
    return rest;
}

struct Field {
    openvdb::FloatGrid::Ptr distances, field;
};

Field flooded(const Mesh& mesh, float h, float gap, float interior = 3) {
    const BandWidths widths{3, interior, h};
    Field f{test::unsignedBand(mesh, h, std::max({widths.exterior, widths.interior, gap / 2 + 1})), nullptr};
    f.field = f.distances->deepCopy();
    signByFlood(*f.field, mesh, gap, widths);
    CHECK(test::fault(*f.field, *f.distances, widths) == "");
    return f;
}

// Voxels of the box around the band (or every nth), farther than `margin` [m] from the surface, whose sign is not
// `inside(p)`.
template <class Inside>
std::size_t wrongSigns(const Field& f, double margin, const Inside& inside, std::size_t every = 1) {
    openvdb::CoordBBox box = f.distances->evalActiveVoxelBoundingBox();
    box.expand(2);
    const auto values = f.field->getConstAccessor();
    const auto distances = f.distances->getConstAccessor();
    const double h = f.field->voxelSize()[0];
    std::size_t wrong = 0, i = 0;
    for (auto at = box.begin(); at; ++at) {
        if (i++ % every != 0) continue;
        const glm::dvec3 p = h * glm::dvec3((*at).x(), (*at).y(), (*at).z());
        if (double(distances.getValue(*at)) > margin) wrong += (values.getValue(*at) < 0) != inside(p);
    }
    return wrong;
}

bool inBox(const glm::dvec3& p, const glm::dvec3& half) {
    return glm::all(glm::lessThan(glm::abs(p), half));
}

}  // namespace

TEST_CASE("closed meshes get the right sign in every voxel, whichever way their faces are turned") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    // the plate is too thin for any free ball, and oblique to the voxels
    const glm::mat4 skew = glm::rotate(glm::mat4(1), 0.7f, glm::vec3(1, 2, 3));
    const Mesh sphere = shapes::sphere(1, 3), plate = transformed(shapes::box({1, 0.8f, 0.03f}, 2), skew);
    for (const float gap : {0.f, 5.f})
        for (const Mesh& mesh : {sphere, plate, shapes::torus(1, 0.3f, 24, 12)}) {
            const Field f = flooded(someFlipped(mesh, seed), 0.07f, gap, 2);
            CAPTURE(gap);
            CHECK(wrongSigns(f, 1e-4 * 0.07, [&](const glm::dvec3& p) { return test::windingNumber(mesh, p) > 0.5; }) ==
                  0);
        }
}

TEST_CASE("gaps up to the stated width are closed and wide openings stay open") {
    // a box with a slit along its whole lid; voxels of 1
    for (const float gap : {0.f, 2.f, 4.f, 6.f})
        for (const float offset : {0.f, 0.3f, 0.5f}) {
            const auto slit = [&](float width) {
                const float w = width / 2;
                Mesh mesh = without(shapes::box({20, 20, 20}, 1), [](const glm::vec3& p) { return p.z > 19.9f; });
                const auto quad = [&](float from, float to) {
                    const auto n = unsigned(mesh.points.size());
                    for (const glm::vec2 c : {glm::vec2(from, -20), {to, -20}, {to, 20}, {from, 20}})
                        mesh.points.push_back({c, 20});
                    mesh.triangles.push_back({n, n + 1, n + 2});
                    mesh.triangles.push_back({n, n + 2, n + 3});
                };
                quad(-20, -w);
                quad(w, 20);
                return shapes::moved(mesh, glm::vec3(offset));
            };
            CAPTURE(gap, offset);
            const openvdb::Coord middle(0, 0, 0), under(0, 0, 15);
            const auto closed = flooded(slit(gap), 1, gap), open = flooded(slit(gap + 2.9f), 1, gap);
            CHECK(closed.field->getConstAccessor().getValue(middle) == -3);
            CHECK(closed.field->getConstAccessor().getValue(under) == -3);
            CHECK(open.field->getConstAccessor().getValue(middle) == 3);
            CHECK(open.field->getConstAccessor().getValue(under) == 3);
        }
}

TEST_CASE("a small hole leaves the rest of a solid as it was") {
    const Mesh sphere = shapes::sphere(1, 4);
    const Mesh holed = without(sphere, [](const glm::vec3& p) { return p.z > 0.985f; });  // 0.35 wide
    const Field f = flooded(holed, 0.05f, 8);
    CHECK(wrongSigns(
              f, 1e-4 * 0.05,
              [&](const glm::dvec3& p) {
                  // in the hole the position of the border is not checked
                  if (p.z > 0.8 && glm::length(glm::dvec2(p)) < 0.3)
                      return std::signbit(f.field->getConstAccessor().getValue(
                          openvdb::Coord::round(openvdb::Vec3d(p.x, p.y, p.z) / 0.05)));
                  return test::windingNumber(sphere, p) > 0.5;
              },
              11) == 0);
    const Field leaking = flooded(holed, 0.05f, 2);
    CHECK(leaking.field->getConstAccessor().getValue({0, 0, 0}) > 0);
}

TEST_CASE("open surfaces have no inside") {
    const auto nowhere = [](const glm::dvec3&) { return false; };
    const glm::mat4 skew = glm::rotate(glm::mat4(1), 0.7f, glm::vec3(1, 2, 3));
    const Mesh sheet = without(shapes::box({20, 20, 0.5f}, 1), [](const glm::vec3& p) { return p.z < 0.4f; });
    for (const Mesh& one : {sheet, transformed(sheet, skew)}) {
        CHECK(wrongSigns(flooded(one, 1, 2), 0, nowhere) == 0);
        // two open surfaces with less room between them than the ball needs, open all around
        CHECK(wrongSigns(flooded(shapes::join({one, shapes::moved(one, {0, 0, 2.3f})}), 1, 4), 0, nowhere) == 0);
    }
}

TEST_CASE("a cavity that nothing leads to is inside") {
    const Mesh mesh = shapes::join({shapes::box({20, 20, 20}, 1), shapes::box({9.7f, 9.7f, 9.7f}, 1)});
    const Field f = flooded(mesh, 1, 2, 2);
    CHECK(wrongSigns(f, 1e-4, [](const glm::dvec3& p) { return inBox(p, glm::dvec3(20)); }) == 0);
}

TEST_CASE("public meshes flood to the solid they stand for", "[corpus]") {
    struct Expected {
        const char* name;
        float gap;
        glm::vec3 inside, outside;  // in fractions of the mesh's box
    };
    for (const Expected& e : {Expected{"bunny_zipper.ply", 4, {0.5f, 0.4f, 0.5f}, {0.02f, 0.02f, 0.02f}},
                              Expected{"cow.obj", 2, {0.5f, 0.6f, 0.5f}, {0.5f, 0.1f, 0.5f}}}) {
        const auto path = test::corpusMesh(e.name);
        if (!path) return;
        const Mesh mesh = readMesh(*path);
        const float h = voxelSizeFor(mesh, 48);
        const Field f = flooded(mesh, h, e.gap);
        const auto values = f.field->getConstAccessor();
        const auto at = [&](const glm::vec3& part) {
            const glm::vec3 p = (bounds(mesh).lower + part * bounds(mesh).size()) / h;
            return values.getValue(openvdb::Coord::round(openvdb::Vec3d(p.x, p.y, p.z)));
        };
        CAPTURE(e.name);
        CHECK(at(e.inside) < 0);
        CHECK(at(e.outside) > 0);
        // neighbours of different signs without a surface between them: only in a closed gap
        std::size_t jumps = 0, inside = 0;
        for (auto v = f.field->cbeginValueOn(); v; ++v) {
            inside += *v < 0;
            for (int axis = 0; axis < 3; ++axis) {
                openvdb::Coord next = v.getCoord();
                ++next[axis];
                const float other = values.getValue(next);
                jumps += (other < 0) != (*v < 0) && std::abs(*v) + std::abs(other) > 1.001f * h;
            }
        }
        CAPTURE(jumps, inside);
        CHECK(inside > f.field->activeVoxelCount() / 5);
        CHECK(jumps < inside / 50);
    }
}

TEST_CASE("a closed public mesh that is inside out floods right", "[corpus]") {
    const auto path = test::corpusMesh("casting_inverted.off");
    if (!path) return;
    const Mesh mesh = readMesh(*path);
    const float h = voxelSizeFor(mesh, 48);
    CHECK(wrongSigns(
              flooded(mesh, h, 2), 1e-4 * double(h),
              [&](const glm::dvec3& p) { return test::windingNumber(mesh, p) < -0.5; }, 29) == 0);
}

TEST_CASE("floods have the same bytes for any number of threads") {
    const Mesh mesh = without(shapes::sphere(1, 4), [](const glm::vec3& p) { return p.z > 0.985f; });
    for (const float gap : {2.f, 10.f}) {
        const auto distances = test::unsignedBand(mesh, 0.02f, std::max(3.f, gap / 2 + 1));
        CHECK(test::sameForAnyThreads(*distances, [&](openvdb::FloatGrid& grid) {
            signByFlood(grid, mesh, gap, {3, 3, 0.02f});
        }));
    }
}

TEST_CASE("a flood refuses a gap that the band does not hold") {
    const Mesh mesh = shapes::sphere(1, 2);
    const auto grid = test::unsignedBand(mesh, 0.1f, 3);
    CHECK_THROWS_AS(signByFlood(*grid, mesh, 5, {3, 3, 0.1f}), std::invalid_argument);
    CHECK_THROWS_AS(signByFlood(*grid, mesh, -1, {3, 3, 0.1f}), std::invalid_argument);
}
}  // namespace bilayer::flood_test
