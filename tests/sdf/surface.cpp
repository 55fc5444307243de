// SPDX-License-Identifier: Apache-2.0
#include <bilayer/sdf/surface.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/inspect.h>
#include "demos/shared/shapes.h"

namespace bilayer::surface_test {
TEST_CASE("the surface of a field is closed, outward, and where the mesh was") {
    const LevelSet field = build(shapes::sphere(1, 5), {.voxelSize = 0.03f});
    const Mesh mesh = surface(field);
    const MeshReport report = inspect(mesh);
    CHECK(report.closed());
    CHECK(report.oriented());
    CHECK(report.volume > 0);
    for (const auto& point : mesh.points) REQUIRE(std::abs(glm::length(point) - 1.f) < 0.5f * 0.03f);
    CHECK(surface(field, {.adaptivity = 0.5f}).triangles.size() < mesh.triangles.size());
}

TEST_CASE("other isovalues give offset surfaces") {
    const LevelSet field = build(shapes::sphere(1, 5), {.voxelSize = 0.03f});
    for (const float isovalue : {-0.05f, 0.05f})
        for (const auto& point : surface(field, {.isovalue = isovalue}).points)
            REQUIRE(std::abs(glm::length(point) - 1.f - isovalue) < 0.5f * 0.03f);
    CHECK_THROWS_AS(surface(field, {.isovalue = 0.2f}), std::invalid_argument);
    CHECK_THROWS_AS(surface(field, {.isovalue = NAN}), std::invalid_argument);
    CHECK_THROWS_AS(surface(field, {.adaptivity = 2}), std::invalid_argument);
}
}  // namespace bilayer::surface_test
