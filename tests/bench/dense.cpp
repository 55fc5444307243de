// SPDX-License-Identifier: Apache-2.0
// The paper's serial program and the block-wise method give the same field, value by value.
#include "bench/paper/dense.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include "bench/paper/scatter.h"
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "tests/support/support.h"

namespace bilayer::dense_test {
using namespace bilayer::paper;

namespace {

constexpr float width = 7;  // beyond the corner of a cube of 7^3 nodes, so that no value is clamped [steps]

/// The dense program works in the mesh's unit, the blocks in voxels relative to a nearby origin. A float of 100 steps
/// is rounded by 4e-6; its error enters the distance at most twice [steps].
constexpr float rounding = 5e-5f;

/// Blocks round halves up from this far below, so that all ways to compute a position agree. A sample within the
/// rounding error of it may go to either node; the cube around it then shifts by one step.
constexpr float halfOfBlocks = 0.5001f, halfError = 2e-5f;

// A mesh in the middle of a lattice with this many nodes along its longest side.
std::pair<Mesh, Lattice> inLattice(Mesh mesh, int nodes) {
    const int margin = int(width) + 2;
    const Bounds box = bounds(mesh);
    const Lattice lattice{glm::ivec3(nodes), box.longestSide() / float(nodes - 1 - 2 * margin)};
    for (glm::vec3& p : mesh.points) p += 0.5f * lattice.step * float(nodes - 1) - box.centre();
    return {std::move(mesh), lattice};
}

bool agree(float a, float b, float step) {
    return std::abs(a) == farAway || std::abs(b) == farAway ? (std::abs(a) == std::abs(b))
                                                            : std::abs(a - b) < rounding * step;
}

// The layers are equally near up to rounding, so either sign is valid. Inside, the distance is that to the outer layer;
// outside, that to the inner one.
bool tie(float a, float b, float step) {
    return std::abs(a) != farAway && std::abs(b) != farAway && a * b <= 0 &&
           std::abs(std::abs(a) - std::abs(b)) < 0.02f * step;
}

struct Counts {
    std::size_t reached = 0, different = 0, tied = 0, far = 0, farSigns = 0;
};

Counts compare(const Mesh& input, int nodes, const DenseOptions& options) {
    const auto [mesh, lattice] = inLattice(input, nodes);
    DenseOptions low = options, high = options;
    low.half = halfOfBlocks - halfError;
    high.half = halfOfBlocks + halfError;
    const DenseField one = denseDoubleLayer(mesh, lattice, low), other = denseDoubleLayer(mesh, lattice, high);

    BuildOptions blocks{.voxelSize = lattice.step, .exteriorWidthVoxels = width, .interiorWidthVoxels = width};
    blocks.method = Method::doubleLayer;
    blocks.doubleLayer = {.delta = options.delta,
                          .epsilon = options.epsilon,
                          .neighbourhood = options.neighbourhood,
                          .maxSubdivision = options.maxSubdivision,
                          .subdivision = options.subdivision,
                          .fillGaps = false};
    const LevelSet field = build(mesh, blocks);
    const auto values = field.grids().distance->getConstAccessor();
    Counts counts;
    for (int i = 0; i < lattice.nodes.x; ++i)
        for (int j = 0; j < lattice.nodes.y; ++j)
            for (int k = 0; k < lattice.nodes.z; ++k) {
                const openvdb::Coord at(i, j, k);
                const float a = one.phi[lattice.index(i, j, k)], b = other.phi[lattice.index(i, j, k)];
                const float value =
                    values.isValueOn(at) ? values.getValue(at) : std::copysign(farAway, values.getValue(at));
                counts.reached += values.isValueOn(at);
                const bool same = agree(value, a, lattice.step) || agree(value, b, lattice.step);
                counts.tied += !same && (tie(value, a, lattice.step) || tie(value, b, lattice.step));
                counts.different += !same && !tie(value, a, lattice.step) && !tie(value, b, lattice.step);
                if (std::abs(value) != farAway || std::abs(a) != farAway) continue;
                ++counts.far;
                counts.farSigns += (value < 0) != (a < 0);
            }
    CHECK(counts.reached == field.activeVoxels());
    return counts;
}

// A closed mesh of random triangles: a sphere whose points are displaced in and out.
Mesh crumpled(unsigned seed, int levels, float depth) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> pull(1 - depth, 1 + depth);
    Mesh mesh = shapes::sphere(1, levels);
    for (glm::vec3& p : mesh.points) p *= pull(random);
    return mesh;
}

}  // namespace

TEST_CASE("block by block, the double layer's field is the serial program's") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    for (const Subdivision subdivision : {Subdivision::rows, Subdivision::recursive})
        for (int k = 1; k <= 3; ++k) {
            const DenseOptions options{.neighbourhood = k, .maxSubdivision = 16, .subdivision = subdivision};
            for (const int levels : {1, 3}) {
                const Counts counts = compare(crumpled(seed + unsigned(k), levels, 0.1f), 56, options);
                CAPTURE(k, levels, int(subdivision), counts.reached, counts.tied);
                CHECK(counts.reached > 5000);
                CHECK(counts.different == 0);
                CHECK(double(counts.tied) < 1e-3 * double(counts.reached));
            }
        }
}

TEST_CASE("so it is for the bunny, and far signs too") {
    const auto path = test::corpusMesh("bunny_watertight.obj");
    if (!path) return;
    const Counts counts = compare(readMesh(*path), 126, {});
    CAPTURE(counts.reached, counts.tied, counts.far);
    CHECK(counts.different == 0);
    CHECK(double(counts.tied) < 1e-3 * double(counts.reached));
    CHECK(counts.farSigns == 0);
}

TEST_CASE("sharing squares along rows changes nothing") {
    const auto [mesh, lattice] = inLattice(shapes::torusKnot(2, 3, 5, 1, 150, 12), 60);
    DenseOptions plain;
    plain.shareRows = false;
    CHECK(denseDoubleLayer(mesh, lattice).phi == denseDoubleLayer(mesh, lattice, plain).phi);
}

TEST_CASE("samples of a triangle are counted") {
    const Mesh triangle{{{1, 1, 1}, {2, 1, 1}, {1, 2, 1}}, {{0, 1, 2}}};
    const Lattice lattice{glm::ivec3(40), 0.1f};  // an area of 50 steps^2: 8 rows
    const DenseField field = denseDoubleLayer(triangle, lattice);
    CHECK(field.samples == 36);
    CHECK(field.maxSamples == 36);
    CHECK(denseDoubleLayer(triangle, lattice, {.subdivision = Subdivision::recursive}).samples == 64);
    CHECK(denseDoubleLayer(triangle, lattice, {.maxSubdivision = 4}).samples == 10);
}

TEST_CASE("the scattered pseudonormals are the true distances, inside and out") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    const auto [mesh, lattice] = inLattice(crumpled(seed, 2, 0.3f), 40);
    const DenseField field = scatterPseudonormal(mesh, lattice, 3);
    std::mt19937 random(seed);
    std::uniform_int_distribution<int> any(0, 39);
    int inBand = 0;
    for (int trial = 0; trial < 4000; ++trial) {
        const glm::ivec3 at(any(random), any(random), any(random));
        const double truth = test::signedDistance(mesh, glm::dvec3(at) * double(lattice.step)) / lattice.step;
        const float phi = field.phi[lattice.index(at.x, at.y, at.z)];
        if (std::abs(std::abs(truth) - 3) > 1e-4) CHECK((std::abs(phi) < farAway) == (std::abs(truth) < 3));
        if (std::abs(truth) > 1e-4) CHECK((phi < 0) == (truth < 0));
        if (std::abs(phi) == farAway) continue;
        ++inBand;
        CHECK(phi / lattice.step == Approx(truth).margin(1e-5));
    }
    CHECK(inBand > 300);
}

TEST_CASE("pseudonormals of an open mesh are refused") {
    const auto [mesh, lattice] = inLattice({{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}}, 30);
    CHECK_THROWS_AS(scatterPseudonormal(mesh, lattice, 2), std::invalid_argument);
}
}  // namespace bilayer::dense_test
