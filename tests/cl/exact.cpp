// SPDX-License-Identifier: Apache-2.0
// The exact method on an OpenCL device against the ground truth: every distance, every sign, the whole band.
#include <catch2/catch.hpp>

#include <bilayer/cl/filler.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "tests/support/clean.h"
#include "tests/support/support.h"
#include "tests/support/truth.h"
#include "tests/support/verdict.h"

namespace bilayer::exact_test {
namespace {

constexpr std::size_t manyVoxels = 10000;  // active voxels checked per mesh; smaller grids are checked completely

void checkExact(const Mesh& mesh, float resolution, const test::Band& band, KernelMapping mapping, unsigned seed) {
    const float voxelSize = voxelSizeFor(mesh, resolution);
    const LevelSet field = build(mesh,
                                 {.voxelSize = voxelSize,
                                  .exteriorWidthVoxels = float(band.exterior),
                                  .interiorWidthVoxels = float(band.interior)},
                                 openclFiller(openDevice(), {.mapping = mapping}));
    const openvdb::FloatGrid& grid = *field.grids().distance;
    const auto voxels = test::trueVoxels(test::Truth(mesh), test::chooseVoxels(grid, mesh, band, manyVoxels, seed),
                                         grid.voxelSize()[0]);
    const test::Verdict verdict = test::judge(grid, band, voxels);
    std::string faults;
    for (const test::Witness& witness : verdict.witnesses) faults += "\n  " + witness.text();
    INFO(verdict.active << " of " << verdict.checked << " voxels active, worst " << verdict.worst << faults);
    CHECK(verdict.active > 0);
    CHECK(verdict.exact());
}

}  // namespace

TEST_CASE("an OpenCL device builds exact fields of the clean public meshes") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    const auto names = test::cleanMeshes();
    if (names.empty()) {
        WARN("skipped: the public meshes are absent");
        return;
    }
    for (const std::string& name : names) {
        CAPTURE(name);
        checkExact(readMesh(*test::corpusMesh(name)), 48, {3, 2}, KernelMapping::blockPerItem, seed);
    }
}

TEST_CASE("an OpenCL device builds exact fields in both mappings, of thin, sharp and tiny things") {
    const unsigned seed = test::seed();
    const auto [mapping, resolution] = GENERATE(
        table<KernelMapping, float>({{KernelMapping::blockPerItem, 70.f}, {KernelMapping::groupPerBlock, 20.f}}));
    CAPTURE(seed, resolution);
    const Mesh mesh =
        GENERATE(shapes::box({1.f, 0.01f, 0.3f}), shapes::cone(0.02f, 1, 12),
                 shapes::torusKnot(2, 3, 1.f, 0.2f, 150, 12), shapes::cylinder(0.3f, 2, 800), shapes::sphere(1.f, 5));
    checkExact(mesh, resolution, {2.5, 1.5}, mapping, seed);
}
}  // namespace bilayer::exact_test
