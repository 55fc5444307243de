// SPDX-License-Identifier: Apache-2.0
// Exact fields of random meshes on an OpenCL device against those of the processor. BILAYER_FUZZ multiplies the meshes.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <random>
#include <stdexcept>
#include <vector>

#include <bilayer/cl/filler.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include "sdf/base/openvdb.h"
#include "tests/fuzz/mesh_recipe.h"
#include "tests/support/support.h"

namespace bilayer::random_meshes_test {
namespace {

struct Recipe {
    Mesh mesh;
    BuildOptions options;
};

Recipe randomRecipe(std::mt19937& random) {
    std::vector<std::uint8_t> bytes(200);
    for (std::uint8_t& byte : bytes) byte = std::uint8_t(random());
    test::ByteSource source(bytes);
    Recipe recipe{test::meshOf(source), {}};
    constexpr float minVoxel = 2e-5f, widths[] = {0.6f, 1, 3, 2.25f, 5};
    constexpr Sign signs[] = {Sign::automatic, Sign::normals, Sign::winding, Sign::flood};
    recipe.options.voxelSize = std::max(minVoxel, bounds(recipe.mesh).longestSide() / float(1 + source.below(20)));
    recipe.options.exteriorWidthVoxels = recipe.options.interiorWidthVoxels = widths[source.below(5)];
    recipe.options.sign = signs[source.below(4)];
    return recipe;
}

// Compares all voxels that are active in either field. Returns their count.
std::size_t compare(const LevelSet& device, const LevelSet& processor) {
    const openvdb::FloatGrid &a = *device.grids().distance, &b = *processor.grids().distance;
    const float tolerance = device.errorBound() + processor.errorBound();
    std::size_t count = 0;
    for (const auto* some : {&a, &b}) {
        const auto other = (some == &a ? b : a).getConstAccessor();
        for (auto voxel = some->cbeginValueOn(); voxel; ++voxel, ++count) {
            const float here = *voxel, there = other.getValue(voxel.getCoord());
            CAPTURE(voxel.getCoord(), here, there);
            REQUIRE(std::abs(std::abs(here) - std::abs(there)) <= tolerance);
            if (std::abs(here) > tolerance) REQUIRE(std::signbit(here) == std::signbit(there));
        }
    }
    return count;
}

}  // namespace

TEST_CASE("random meshes have the same exact field on an OpenCL device as on the processor") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    const BlockFiller filler = openclFiller(openDevice(), {});
    const char* const factor = std::getenv("BILAYER_FUZZ");
    const unsigned long meshes = 60 * (factor ? std::strtoul(factor, nullptr, 10) : 1);
    std::size_t voxels = 0;
    for (unsigned long i = 0; i < meshes; ++i) {
        const auto [mesh, options] = randomRecipe(random);
        CAPTURE(i, mesh.triangles.size(), options.voxelSize, options.exteriorWidthVoxels, int(options.sign));
        std::string onProcessor, onDevice;
        std::optional<LevelSet> processor, device;
        try {
            processor = build(mesh, options);
        } catch (const std::invalid_argument& error) {
            onProcessor = error.what();
        }
        try {
            device = build(mesh, options, filler);
        } catch (const std::invalid_argument& error) {
            onDevice = error.what();
        }
        REQUIRE(onDevice == onProcessor);
        if (!onDevice.empty()) continue;
        REQUIRE(device->sign() == processor->sign());
        voxels += compare(*device, *processor);
    }
    CHECK(voxels > 1000);
}
}  // namespace bilayer::random_meshes_test
