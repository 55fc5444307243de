// SPDX-License-Identifier: Apache-2.0
// The proof obligations of the exact method, asserted for every voxel of fields of the public corpus, and the error
// bound of the double layer method against these fields.
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <random>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "sdf/fill/exact.h"
#include "tests/support/support.h"

namespace bilayer::corpus_test {
namespace {

// The largest difference of the two fields where both have a distance [m]. Signs are left out: thin walls have those
// of the nearer layer.
double largestDifference(const LevelSet& exact, const LevelSet& layered) {
    const auto distances = exact.grids().distance->getConstAccessor();
    double largest = 0;
    for (auto voxel = layered.grids().distance->cbeginValueOn(); voxel; ++voxel)
        if (distances.isValueOn(voxel.getCoord()))
            largest = std::max(
                largest, std::abs(double(std::abs(*voxel)) - double(std::abs(distances.getValue(voxel.getCoord())))));
    return largest;
}

void verify(const Mesh& mesh, BuildOptions options) {
    const LevelSet exact = build(mesh, options);
    CHECK(exact.activeVoxels() > 0);
    options.method = Method::doubleLayer;
    const LevelSet layered = build(mesh, options);
    CHECK(largestDifference(exact, layered) <= double(layered.errorBound() + exact.errorBound()));
}

}  // namespace

TEST_CASE("the certificate is checked in this program") {
    CHECK(detail::exactIsVerified());
}

TEST_CASE("the certificate holds for every voxel of the corpus") {
    const auto any = test::corpusMesh("bunny_watertight.obj");
    if (!any) return;
    std::size_t verified = 0;
    for (const auto& file : std::filesystem::directory_iterator(any->parent_path())) {
        if (!file.is_regular_file() || file.file_size() > 4 << 20) continue;
        Mesh mesh;
        try {
            mesh = readMesh(file.path());
            (void)voxelSizeFor(mesh, 48);
        } catch (const std::exception&) {
            continue;  // tests of the readers judge these
        }
        INFO(file.path().filename());
        verify(mesh, {.voxelSize = voxelSizeFor(mesh, 48)});
        ++verified;
    }
    CHECK(verified > 50);
}

namespace {

using Random = std::mt19937;

float uniform(Random& random, float low, float high) {
    return std::uniform_real_distribution<float>(low, high)(random);
}

glm::vec3 uniformPoint(Random& random, float size) {
    return {uniform(random, -size, size), uniform(random, -size, size), uniform(random, -size, size)};
}

void addTriangle(Mesh& mesh, const glm::vec3& a, const glm::vec3& b, const glm::vec3& c) {
    const auto first = std::uint32_t(mesh.points.size());
    mesh.points.insert(mesh.points.end(), {a, b, c});
    mesh.triangles.push_back(glm::uvec3(first, first + 1, first + 2));
}

}  // namespace

TEST_CASE("the certificate holds for random triangles of all sizes") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int round = 0; round < 40; ++round) {
        Mesh mesh;
        for (int count = 1 + int(uniform(random, 0, 60)); count > 0; --count) {
            const float size = std::exp(uniform(random, std::log(1e-3f), std::log(40.f)));
            const glm::vec3 middle = uniformPoint(random, 15);
            addTriangle(mesh, middle + uniformPoint(random, size), middle + uniformPoint(random, size),
                        middle + uniformPoint(random, size));
        }
        verify(mesh, {.voxelSize = 1,
                      .exteriorWidthVoxels = uniform(random, 1, 6),
                      .interiorWidthVoxels = uniform(random, 1, 6)});
    }
}

// The large piece must lie in the cylinder of its cluster. Near 1, a cosine in floats is too coarse to give
// the sine of a small angle.
TEST_CASE("the certificate holds for a large piece that is nearly parallel to small ones") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int round = 0; round < 40; ++round) {
        Mesh mesh;
        for (int count = 0; count < 300; ++count) {
            const glm::vec3 at(uniform(random, -6, 6), uniform(random, -6, 6), 0);
            addTriangle(mesh, at, at + glm::vec3(0.1f, 0, 0), at + glm::vec3(0, 0.1f, 0));
        }
        const float tilt = std::exp(uniform(random, std::log(1e-4f), std::log(1e-3f)));
        addTriangle(mesh, {-7, -4, -7 * tilt}, {7, -4, 7 * tilt}, {0, 8, 0});
        verify(mesh, {.voxelSize = 1});
    }
}
}  // namespace bilayer::corpus_test
