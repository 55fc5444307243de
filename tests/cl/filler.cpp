// SPDX-License-Identifier: Apache-2.0
// Fields built by an OpenCL device against those of the CPU, by both methods and in both mappings; budgets of device
// memory; error conditions. exact.cpp compares the exact method with the ground truth.
#include <bilayer/cl/filler.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <thread>
#include <utility>

#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include "cl/detail/program.h"
#include "demos/shared/shapes.h"
#include "sdf/base/access.h"
#include "sdf/base/openvdb.h"
#include "sdf/leaf/blocks.h"
#include "tests/support/support.h"
#include "tests/support/tiles.h"

namespace bilayer::filler_test {
using namespace bilayer::detail;
using Catch::Matchers::Contains;

namespace {

// Voxels along the longest side, and the mapping under test. A GPU's mapping is very slow on a CPU.
struct MappingCase {
    KernelMapping mapping;
    float resolution;
};
const MappingCase blockPerItem{KernelMapping::blockPerItem, 90}, groupPerBlock{KernelMapping::groupPerBlock, 24};

BuildOptions optionsFor(const Mesh& mesh, float resolution, Method method = Method::doubleLayer) {
    BuildOptions options;
    options.method = method;
    options.voxelSize = voxelSizeFor(mesh, resolution);
    options.exteriorWidthVoxels = options.interiorWidthVoxels = 2;
    return options;
}

// Distances of two triangles that may be equally near to a voxel.
class NearTriangles {
  public:
    virtual ~NearTriangles() = default;
    /// @param inside  the side of the surface on which the voxel lies
    virtual double distance(std::int32_t triangle, const openvdb::Coord& voxel, bool inside) const = 0;  // [voxels]
};

// By the triangles themselves.
class ExactTriangles : public NearTriangles {
  public:
    ExactTriangles(const Mesh& mesh, const BuildOptions& options) : mesh_(mesh), voxel_(double(options.voxelSize)) {}
    double distance(std::int32_t triangle, const openvdb::Coord& voxel, bool) const override {
        const glm::uvec3 t = mesh_.triangles[std::size_t(triangle)];
        const glm::dvec3 point = voxel_ * glm::dvec3(voxel.x(), voxel.y(), voxel.z());
        return std::sqrt(test::squaredDistance(point, glm::dvec3(mesh_.points[t.x]), glm::dvec3(mesh_.points[t.y]),
                                               glm::dvec3(mesh_.points[t.z]))) /
               voxel_;
    }

  private:
    const Mesh& mesh_;
    double voxel_;
};

// By the samples of each triangle in double precision.
class LayerSamplesOfTriangles : public NearTriangles {
  public:
    LayerSamplesOfTriangles(const Mesh& mesh, const BuildOptions& options) : tiles_(makeTiles(mesh, options)) {
        for (std::size_t t = 0; t < tiles_.tiles.size(); ++t) ofTriangle_[tiles_.triangles[t]].push_back(t);
    }

    // Distance to the nearest sample of the layer that determines the value: the farther layer.
    double distance(std::int32_t triangle, const openvdb::Coord& voxel, bool inside) const override {
        double nearest = std::numeric_limits<double>::infinity();
        for (const std::size_t t : ofTriangle_.at(triangle)) {
            const Tile& tile = tiles_.tiles[t];
            const glm::dvec3 from(glm::ivec3(voxel.x(), voxel.y(), voxel.z()) - tile.base);
            const glm::dvec3 layer = (inside ? 1.0 : -1.0) * glm::dvec3(tile.offset);
            for (int i = 0; i < tile.rows; ++i)
                for (int j = 0; j <= i; ++j)
                    nearest = std::min(nearest, glm::distance(from, glm::dvec3(tile.first) + layer +
                                                                        double(i) * glm::dvec3(tile.down) +
                                                                        double(j) * glm::dvec3(tile.across)));
        }
        return nearest;
    }

  private:
    Tiles tiles_;
    std::map<std::int32_t, std::vector<std::size_t>> ofTriangle_;
};

// Checks that both fields have the same voxels and signs everywhere, and distances within the margin [voxels].
void checkSame(const LevelSet& a, const LevelSet& b, float margin = openclMargin) {
    const openvdb::FloatGrid &expected = *a.grids().distance, &found = *b.grids().distance;
    REQUIRE(found.activeVoxelCount() == expected.activeVoxelCount());
    REQUIRE(found.tree().hasSameTopology(expected.tree()));
    std::size_t signs = 0;
    float farthest = 0;
    auto f = found.cbeginValueAll();
    for (auto e = expected.cbeginValueAll(); e; ++e, ++f) {
        signs += std::signbit(*e) != std::signbit(*f);
        farthest = std::max(farthest, std::abs(*e - *f));
    }
    CHECK(signs == 0);
    CHECK(farthest <= margin * a.voxelSize());
}

void checkSameTriangles(const Mesh& mesh, const BuildOptions& options, const LevelSet& a, const LevelSet& b) {
    REQUIRE(a.grids().triangle);
    REQUIRE(b.grids().triangle);
    REQUIRE(b.grids().triangle->tree().hasSameTopology(a.grids().triangle->tree()));
    const auto distances = a.grids().distance->getConstAccessor();
    std::unique_ptr<NearTriangles> near;
    if (options.method == Method::exact)
        near = std::make_unique<ExactTriangles>(mesh, options);
    else
        near = std::make_unique<LayerSamplesOfTriangles>(mesh, options);
    std::size_t differing = 0, none = 0;
    auto f = b.grids().triangle->cbeginValueOn();
    for (auto e = a.grids().triangle->cbeginValueOn(); e; ++e, ++f) {
        none += *f < 0;
        if (*e == *f || *f < 0) continue;
        // two triangles may be equally near
        const bool inside = std::signbit(distances.getValue(e.getCoord()));
        const double one = near->distance(*e, e.getCoord(), inside), other = near->distance(*f, e.getCoord(), inside);
        differing += std::abs(one - other) > double(openclMargin);
    }
    CHECK(differing == 0);
    CHECK(none == 0);
}

// Compares both fillers; shared by all tests. Returns the times of the device.
DeviceTimes checkFillers(const Mesh& mesh, const BuildOptions& options, const OpenclOptions& opencl = {}) {
    const LevelSet expected = build(mesh, options);
    REQUIRE(expected.activeVoxels() > 0);
    const BlockFiller filler = openclFiller(openDevice(), opencl);
    const LevelSet found = build(mesh, options, filler);
    checkSame(expected, found, options.method == Method::doubleLayer ? 0 : openclMargin);
    CHECK(found.sign() == expected.sign());
    CHECK(found.signReason() == expected.signReason());
    if (options.triangles) checkSameTriangles(mesh, options, expected, found);
    return found.buildTimes().device;
}

struct Shape {
    const char* name;
    Mesh mesh;
};

std::vector<Shape> allShapes() {
    return {{"sphere", shapes::sphere(1.f)},
            {"torus", shapes::torus(1.f, 0.4f)},
            {"box of 12 triangles", shapes::box({1.f, 0.6f, 0.3f})},
            {"knot", shapes::torusKnot(2, 3, 1.f, 0.3f)}};
}

}  // namespace

TEST_CASE("OpenCL and TBB agree on shapes") {
    const MappingCase variant = GENERATE(blockPerItem, groupPerBlock);
    const Method method = GENERATE(Method::exact, Method::doubleLayer);
    for (const Shape& shape : allShapes()) {
        CAPTURE(shape.name, variant.resolution, int(method));
        BuildOptions options = optionsFor(shape.mesh, variant.resolution, method);
        options.triangles = true;
        checkFillers(shape.mesh, options, {.mapping = variant.mapping});
    }
}

TEST_CASE("OpenCL and TBB agree without triangles") {
    const MappingCase variant = GENERATE(blockPerItem, groupPerBlock);
    const Mesh mesh = shapes::torus(1.f, 0.4f);
    checkFillers(mesh, optionsFor(mesh, variant.resolution), {.mapping = variant.mapping});
}

TEST_CASE("OpenCL and TBB agree on the corpus") {
    const Method method = GENERATE(Method::exact, Method::doubleLayer);
    for (const char* name : {"TinyTorus.obj", "cow.obj", "bunny_watertight.obj", "cgal-knot2.off", "beetle.obj"}) {
        const auto path = bilayer::test::corpusMesh(name);
        if (!path) continue;
        CAPTURE(name, int(method));
        const Mesh mesh = readMesh(*path);
        BuildOptions options = optionsFor(mesh, 64, method);
        options.triangles = true;
        checkFillers(mesh, options);
    }
}

TEST_CASE("OpenCL and TBB agree by the paper to the letter, by recursion and with other parameters") {
    const MappingCase variant = GENERATE(blockPerItem, groupPerBlock);
    const bool triangles = GENERATE(false, true);
    const Mesh mesh = shapes::box({1.f, 0.6f, 0.3f}, 2);
    BuildOptions options = optionsFor(mesh, variant.resolution);
    options.triangles = triangles;
    SECTION("letter") {
        options.doubleLayer.fillGaps = false;
        options.doubleLayer.neighbourhood = GENERATE(1, 2, 9);
    }
    SECTION("recursion") {
        options.doubleLayer.subdivision = Subdivision::recursive;
    }
    SECTION("layers as near to each other as they may be") {
        options.doubleLayer.delta = 0.1f;
    }
    SECTION("fine samples, thick layers, unequal widths") {
        options.doubleLayer.epsilon = 0.3f;
        options.doubleLayer.delta = 0.9f;
        options.exteriorWidthVoxels = 4.5f;
        options.interiorWidthVoxels = 1.25f;
    }
    checkFillers(mesh, options, {.mapping = variant.mapping});
}

TEST_CASE("OpenCL and TBB agree far from the origin") {
    const Mesh mesh =
        transformed(shapes::sphere(1.f, 3), glm::mat4(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -900, 700, -1300, 1));
    BuildOptions options = optionsFor(mesh, 40, GENERATE(Method::exact, Method::doubleLayer));
    options.triangles = true;
    checkFillers(mesh, options);
}

TEST_CASE("OpenCL and TBB agree on triangles of very different size, however wide the band") {
    // long needles, a fine ball, and a box whose faces are far larger than a brick
    const Mesh mesh = shapes::join(
        {shapes::cone(0.01f, 2, 24), shapes::moved(shapes::sphere(0.1f, 4), glm::vec3(0.5f, 0, 0)),
         transformed(shapes::box({0.4f, 0.9f, 0.8f}),
                     glm::rotate(glm::translate(glm::mat4(1), glm::vec3(-1, 0, 0)), 0.3f, glm::vec3(1, 2, 3)))});
    const MappingCase variant = GENERATE(blockPerItem, groupPerBlock);
    const Method method = GENERATE(Method::exact, Method::doubleLayer);
    BuildOptions options = optionsFor(mesh, variant.resolution, method);
    const float width = GENERATE(1.f, 6.f);
    options.exteriorWidthVoxels = width;
    options.interiorWidthVoxels = 2;
    CAPTURE(variant.resolution, int(method), width);
    checkFillers(mesh, options, {.mapping = variant.mapping});
}

TEST_CASE("OpenCL and TBB agree on signs that are asked for, and on meshes that are no solids") {
    const Sign sign = GENERATE(Sign::automatic, Sign::normals, Sign::winding, Sign::flood);
    const bool open = GENERATE(false, true);
    Mesh mesh = shapes::join({shapes::sphere(1.f, 3), shapes::moved(shapes::sphere(0.5f, 2), glm::vec3(1, 0, 0))});
    if (open) mesh.triangles.resize(mesh.triangles.size() - 40);
    BuildOptions options = optionsFor(mesh, 40, Method::exact);
    options.sign = sign;
    CAPTURE(int(sign), open);
    checkFillers(mesh, options);
}

TEST_CASE("blocks whose sides the nearest normals leave open come from the processor") {
    // Two boxes that share a corner. At the voxel on the far side of that corner their normals cancel out.
    const Mesh mesh = shapes::join({shapes::moved(shapes::box(glm::vec3(0.5f)), glm::vec3(0.5f)),
                                    shapes::moved(shapes::box(glm::vec3(0.5f)), glm::vec3(-0.5f))});
    BuildOptions options = optionsFor(mesh, 40, Method::exact);
    const MappingCase variant = GENERATE(blockPerItem, groupPerBlock);
    checkFillers(mesh, options, {.mapping = variant.mapping});
}

TEST_CASE("OpenCL and TBB agree where faces of opposite sides lie on each other") {
    // a box in a box of the same height, inside out or not: their tops and bottoms are coplanar
    Mesh inner = shapes::box({0.7f, 0.4f, 0.5f}, GENERATE(1, 3));
    if (GENERATE(false, true))
        for (glm::uvec3& t : inner.triangles) std::swap(t.x, t.y);
    const Mesh mesh = shapes::join({shapes::box({1.f, 0.6f, 0.5f}), inner});
    const MappingCase variant = GENERATE(blockPerItem, groupPerBlock);
    BuildOptions options = optionsFor(mesh, 2 * variant.resolution / 3, Method::exact);
    options.sign = GENERATE(Sign::normals, Sign::automatic);
    checkFillers(mesh, options, {.mapping = variant.mapping});
}

TEST_CASE("a little device memory means many batches and the same field") {
    const Mesh mesh = shapes::sphere(1.f, 3);
    BuildOptions options = optionsFor(mesh, 250, GENERATE(Method::exact, Method::doubleLayer));
    options.triangles = GENERATE(false, true);
    const std::uint64_t memory = GENERATE(2, 3);
    CAPTURE(memory);
    const LevelSet expected = build(mesh, options);
    REQUIRE(expected.leaves() * blockVoxels * sizeof(float) > memory << 20);
    const DeviceTimes times = checkFillers(mesh, options, {.memoryMiB = memory, .profile = true});
    CHECK(times.peakBytes <= memory << 20);
    CHECK(times.kernels > 0);
}

TEST_CASE("a device keeps buffers for the next build, which may be of another mesh and have less memory") {
    const Device device = openDevice();
    const Mesh ball = shapes::sphere(1.f, 4), ring = shapes::torus(1.f, 0.4f);
    const BuildOptions ofBall = optionsFor(ball, 100, GENERATE(Method::exact, Method::doubleLayer)),
                       ofRing = optionsFor(ring, 60, ofBall.method);
    const LevelSet expected = build(ball, ofBall), other = build(ring, ofRing);
    std::uint64_t kept = 0;
    for (int i = 0; i < 3; ++i) {
        checkSame(expected, build(ball, ofBall, openclFiller(device)));
        CHECK(dataOf(device).spareBytes > 0);
        if (i > 0) CHECK(dataOf(device).spareBytes == kept);  // the spare buffers were reused, and none was added
        kept = dataOf(device).spareBytes;
    }
    constexpr std::uint64_t memory = 4;
    const LevelSet small = build(ring, ofRing, openclFiller(device, {.memoryMiB = memory}));
    checkSame(other, small);
    CHECK(small.buildTimes().device.peakBytes > 0);
    CHECK(small.buildTimes().device.peakBytes <= memory << 20);
    CHECK(small.buildTimes().device.kernels == 0);  // not measured without `profile`
    CHECK(dataOf(device).spareBytes <= memory << 20);
    checkSame(expected, build(ball, ofBall, openclFiller(device)));
}

TEST_CASE("results come from a device with memory of its own") {
    const Device device = openDevice();
    dataOf(device).info.unifiedMemory = false;
    const KernelMapping mapping = GENERATE(KernelMapping::blockPerItem, KernelMapping::groupPerBlock);
    const BlockFiller filler = openclFiller(device, {.mapping = mapping, .profile = true});
    const Mesh mesh = shapes::torus(1.f, 0.4f);
    for (const bool triangles : {false, true}) {
        BuildOptions options = optionsFor(mesh, 150, GENERATE(Method::exact, Method::doubleLayer));
        options.triangles = triangles;
        const LevelSet expected = build(mesh, options), found = build(mesh, options, filler);
        CAPTURE(int(mapping), triangles, int(options.method), found.leaves());
        checkSame(expected, found);
        if (triangles) checkSameTriangles(mesh, options, expected, found);
        CHECK(dataOf(device).pinned.size() == 1);
        CHECK(found.buildTimes().device.download > 0);
        CHECK(expected.buildTimes().device.kernels == 0);
    }
}

TEST_CASE("a device without double precision is refused by name") {
    DeviceImpl& impl = dataOf(openDevice());
    auto single = std::make_shared<DeviceImpl>();
    single->info = impl.info;
    single->info.name = "Single";
    single->info.doubles = false;
    single->device = impl.device;
    single->context = impl.context;
    single->queue = impl.queue;
    const Mesh mesh = shapes::sphere(1.f, 2);
    for (const Method method : {Method::exact, Method::doubleLayer})
        CHECK_THROWS_WITH(build(mesh, optionsFor(mesh, 20, method), openclFiller(makeOf<Device>(single))),
                          Contains("Single") && Contains("double precision"));
}

TEST_CASE("too little device memory is an error that says how much is needed") {
    const Device device = openDevice();
    SECTION("for the mesh") {
        const Mesh mesh = shapes::sphere(1.f, 6);
        CHECK_THROWS_AS(build(mesh, optionsFor(mesh, 60), openclFiller(device, {.memoryMiB = 1})), DeviceError);
        CHECK_THROWS_WITH(build(mesh, optionsFor(mesh, 60), openclFiller(device, {.memoryMiB = 1})),
                          Contains("MiB") && Contains(device.info().name));
    }
    SECTION("for a brick") {
        const Mesh mesh = shapes::sphere(1.f, 5);
        BuildOptions options = optionsFor(mesh, 100);
        options.triangles = true;
        options.exteriorWidthVoxels = options.interiorWidthVoxels = 6;
        CHECK_THROWS_WITH(build(mesh, options, openclFiller(device, {.memoryMiB = 1})),
                          Contains("brick") && Contains("MiB") && Contains(device.info().name));
    }
}

TEST_CASE("a cancelled build leaves the device usable") {
    const Mesh mesh = shapes::sphere(1.f, 3);
    BuildOptions options = optionsFor(mesh, 250);
    const BlockFiller filler = openclFiller(openDevice(), {.memoryMiB = 2});
    options.method = GENERATE(Method::exact, Method::doubleLayer);
    const bool atOnce = GENERATE(true, false);
    options.progress = [&](float part) { return !atOnce && part == 0.f; };
    CHECK_THROWS_AS(build(mesh, options, filler), Cancelled);
    options.progress = nullptr;
    checkSame(build(mesh, options), build(mesh, options, filler));
}

TEST_CASE("one device serves two builds at once") {
    const Mesh ball = shapes::sphere(1.f, 4), ring = shapes::torus(1.f, 0.4f);
    const BlockFiller filler = openclFiller(openDevice());
    std::optional<LevelSet> ringField;
    std::thread other([&] { ringField = build(ring, optionsFor(ring, 60), filler); });
    const LevelSet ballField = build(ball, optionsFor(ball, 60), filler);
    other.join();
    checkSame(build(ball, optionsFor(ball, 60)), ballField);
    checkSame(build(ring, optionsFor(ring, 60)), *ringField);
}

TEST_CASE("the filler reports its name and device") {
    const Device device = openDevice();
    CHECK(openclFiller(device).backend() == "opencl");
    CHECK(openclFiller(device).device() == device.info().name);
}
}  // namespace bilayer::filler_test
