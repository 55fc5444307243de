// SPDX-License-Identifier: Apache-2.0
#include <bilayer/integration/fluid/obstacle.h>

#include <openvdb/tools/Diagnostics.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <limits>

#include <bilayer/sdf/build.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"

namespace bilayer::obstacle_test {
using openvdb::Coord;
using openvdb::math::Transform;

namespace {

// Sums of the solid fractions: of cells, and of faces across each axis [voxels].
struct Sums {
    double cells = 0;
    openvdb::Vec3d faces{0, 0, 0};
};

Sums sumsOf(const fluid::Solid& solid) {
    Sums sums;
    for (auto v = solid.cellFluidFraction->cbeginValueOn(); v; ++v)
        sums.cells += (1 - double(*v)) * double(v.getVoxelCount());
    for (auto v = solid.faceFluidFraction->cbeginValueOn(); v; ++v)
        sums.faces += (openvdb::Vec3d(1) - openvdb::Vec3d(*v)) * double(v.getVoxelCount());
    return sums;
}

}  // namespace

TEST_CASE("what planes cut off is exact") {
    // a box whose sides lie at fractions of a voxel: 2.3, 1.6 and 3.1 voxels from its centre at the origin
    const float h = 0.1f;
    const auto cells = Transform::createLinearTransform(h);
    const fluid::Solid solid = fluid::solid(shapes::box({0.23f, 0.16f, 0.31f}), {}, *cells);
    const auto volume = solid.cellFluidFraction->getConstAccessor();
    const auto faces = solid.faceFluidFraction->getConstAccessor();
    CHECK(volume.getValue(Coord(0)) == 0);
    CHECK(volume.getValue(Coord(2, 0, 0)) == Approx(0.2f).margin(1e-4));  // the cell: 1.5 to 2.5, solid up to 2.3
    CHECK(volume.getValue(Coord(0, -2, 0)) == Approx(0.9f).margin(1e-4));
    CHECK(volume.getValue(Coord(0, 0, 3)) == Approx(0.4f).margin(1e-4));
    CHECK(volume.getValue(Coord(0, 0, 4)) == 1);
    // faces across y and z of a cell that the plane x = 2.3 cuts; its lower face across x is covered, the next is not
    CHECK(faces.getValue(Coord(2, 0, 0)).x() == 0);
    CHECK(faces.getValue(Coord(2, 0, 0)).y() == Approx(0.2f).margin(1e-4));
    CHECK(faces.getValue(Coord(2, 0, 0)).z() == Approx(0.2f).margin(1e-4));
    CHECK(faces.getValue(Coord(3, 0, 0)).x() == 1);
    CHECK_FALSE(solid.cellFluidFraction->tree().isValueOn(Coord(3, 0, 0)));
}

TEST_CASE("open parts leave the body's volume, by cells and by faces, to second order") {
    const double radius = 0.5, volume = 4 * glm::pi<double>() / 3 * radius * radius * radius;
    const Mesh ball = shapes::sphere(float(radius), 6);
    const fluid::Placement placement({{0.313f, -0.127f, 0.071f}, glm::angleAxis(0.6f, glm::vec3(0, 0, 1))});
    // a linear function on an edge of length l is off from a distance of curvature 1 / radius by at most l^2 / (8
    // radius); the longest edges are diagonals of cells and of faces
    const auto bound = [&](double longest) { return 3 * longest * longest / (8 * radius * radius); };
    std::vector<double> errors;
    for (const double h : {0.1, 0.05, 0.025}) {
        const auto cells = Transform::createLinearTransform(h);
        const Sums sums = sumsOf(fluid::solid(ball, placement, *cells));
        errors.push_back(std::abs(sums.cells * h * h * h / volume - 1));
        CAPTURE(h);
        CHECK(errors.back() < bound(std::sqrt(3) * h));
        for (int axis = 0; axis < 3; ++axis)
            CHECK(sums.faces[axis] * h * h * h == Approx(volume).epsilon(bound(std::sqrt(2) * h)));
    }
    CAPTURE(errors);
    CHECK(errors[2] < errors[0] / 8);  // 16 for second order
}

TEST_CASE("faces and cells of a stretched field agree with its mesh's") {
    const Mesh mesh = shapes::torus(0.5f, 0.2f);
    const LevelSet field = build(mesh, {.voxelSize = 0.01f});
    const auto cells = Transform::createLinearTransform(0.04);
    const fluid::Placement placement({{0.1f, 0, 0.2f}, glm::angleAxis(1.f, glm::vec3(1, 0, 0))}, {1, 1.5f, 0.8f});
    const fluid::Solid byField = fluid::solid(field, placement, *cells), byMesh = fluid::solid(mesh, placement, *cells);
    CHECK(openvdb::tools::checkLevelSet(*byMesh.distance, 1) == "");
    double most = 0;
    for (auto v = byMesh.cellFluidFraction->cbeginValueOn(); v; ++v)
        if (v.isVoxelValue())
            most = std::max(most, double(std::abs(*v - byField.cellFluidFraction->tree().getValue(v.getCoord()))));
    CHECK(most < 0.02);
    CHECK(sumsOf(byField).cells == Approx(sumsOf(byMesh).cells).epsilon(1e-3));
}

TEST_CASE("faces go as the body turns") {
    const float h = 0.05f;
    const auto cells = Transform::createLinearTransform(h);
    const glm::vec3 centre(0.3f, 0.1f, -0.2f), linear(1, 2, 3), angular(0.5f, -0.25f, 4);
    const fluid::Solid solid = fluid::solid(shapes::sphere(0.4f, 4), Pose{centre}, *cells,
                                            {.velocity = {linear, angular}, .halfWidthVoxels = 4});
    CHECK(solid.velocity->getGridClass() == openvdb::GRID_STAGGERED);
    CHECK(solid.velocity->activeVoxelCount() == solid.distance->activeVoxelCount());
    float most = 0;
    for (auto v = solid.velocity->cbeginValueOn(); v; ++v)
        for (int axis = 0; axis < 3; ++axis) {
            glm::vec3 face(v.getCoord().x(), v.getCoord().y(), v.getCoord().z());
            face[axis] -= 0.5f;
            most = std::max(most, std::abs((linear + glm::cross(angular, h * face - centre))[axis] - (*v)[axis]));
        }
    CHECK(most < 1e-5f);
}

TEST_CASE("bad input is refused") {
    const Mesh mesh = shapes::sphere(0.4f, 3);
    const auto cells = Transform::createLinearTransform(0.05);
    const float nan = std::numeric_limits<float>::quiet_NaN();
    CHECK_THROWS_WITH(fluid::solid(mesh, {{}, {1, 1, -1}}, *cells), Catch::Matchers::Contains("mirror"));
    CHECK_THROWS_WITH(fluid::solid(mesh, {}, *cells, {.velocity = {glm::vec3(nan)}}),
                      Catch::Matchers::Contains("velocity"));
    CHECK_THROWS_WITH(fluid::solid(mesh, {}, *cells, {.halfWidthVoxels = 2}),
                      Catch::Matchers::Contains("halfWidthVoxels must be in 3..1000, not 2"));
    const auto turned = Transform::createLinearTransform(0.05);
    turned->preRotate(0.3);
    CHECK_THROWS_WITH(fluid::solid(mesh, {}, *turned), Catch::Matchers::Contains("axes"));
    CHECK_THROWS_AS(fluid::solid(Mesh{}, {}, *cells), std::invalid_argument);
    const Mesh sheet{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
    CHECK_THROWS_WITH(fluid::solid(sheet, {}, *cells), Catch::Matchers::Contains("no inside"));
    const LevelSet empty = build(sheet, {.voxelSize = 0.05f, .sign = Sign::flood});
    CHECK_THROWS_WITH(fluid::solid(empty, {}, *cells), Catch::Matchers::Contains("no inside"));
}
}  // namespace bilayer::obstacle_test
