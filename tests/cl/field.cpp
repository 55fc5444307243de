// SPDX-License-Identifier: Apache-2.0
// Samples on a device: the same checks as on the CPU, and a direct comparison of both.
#include <bilayer/cl/field.h>
#include <bilayer/sdf/mesh_io.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <thread>

#include <bilayer/collider/field.h>
#include "demos/shared/shapes.h"
#include "tests/support/random.h"
#include "tests/support/sampling.h"
#include "tests/support/support.h"

namespace bilayer::field_test {
using namespace bilayer::test;
using Catch::Matchers::Contains;

namespace {

constexpr double h = 0.02;  // of most fields here [m]
/// Tolerance between samples of device and CPU: single precision at a few voxels [voxels].
constexpr float margin = 1e-6f;

std::vector<Sample> samplesOf(const DeviceField& field, std::span<const glm::vec3> points) {
    // poisoned, so that a sample that is not written is detected
    std::vector<Sample> samples(points.size(), {.distance = 77, .gradient = glm::vec3(7), .inBand = true});
    field.sample(points, samples);
    return samples;
}

MakeSampler onDevice() {
    const OpenclOptions options{.mapping = GENERATE(KernelMapping::blockPerItem, KernelMapping::groupPerBlock)};
    return [options, device = openDevice()](const LevelSet& levelSet) -> Sampler {
        return [field = DeviceField(device, levelSet, options)](std::span<const glm::vec3> points) {
            return samplesOf(field, points);
        };
    };
}

// Points in the band, next to it, far away, and not finite.
std::vector<glm::vec3> allKindsOfPoints(Random& random, const Bounds& bounds, std::size_t count) {
    const glm::vec3 middle = 0.5f * (bounds.lower + bounds.upper);
    const double half = 0.5 * double(bounds.longestSide());
    const float nowhere[] = {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), -3e38f};
    std::vector<glm::vec3> points;
    for (std::size_t i = 0; i < count; ++i) {
        points.push_back(middle + random.point((i % 10 ? 1.1 : 20) * half));
        if (i % 1000 == 0) points.back()[int(i / 1000 % 3)] = nowhere[i / 3000 % 3];
    }
    return points;
}

bool areAlike(const Sample& a, const Sample& b, float voxelSize) {
    // far away the precision is relative to the distance
    const float allowed = margin * std::max(voxelSize, std::abs(b.distance));
    const glm::vec3 apart = glm::abs(a.gradient - b.gradient);
    return a.inBand == b.inBand && std::signbit(a.distance) == std::signbit(b.distance) &&
           (a.distance == b.distance || std::abs(a.distance - b.distance) <= allowed) &&
           std::max({apart.x, apart.y, apart.z}) <= margin;
}

void checkSameSamples(const Field& field, std::span<const glm::vec3> points, std::span<const Sample> samples) {
    std::size_t inBand = 0, differing = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
        const glm::vec3 p = points[i];
        const Sample expected = field.sample(p), &found = samples[i];
        inBand += found.inBand;
        if (areAlike(found, expected, field.voxelSize())) continue;
        if (differing++ > 0) continue;
        CAPTURE(i, p.x, p.y, p.z, expected.distance, found.distance, expected.inBand, found.inBand);
        CHECK(areAlike(found, expected, field.voxelSize()));
    }
    CHECK(differing == 0);
    CHECK(inBand > 500);
}

void checkSameSamples(const LevelSet& levelSet, const OpenclOptions& options, std::size_t count) {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const Field field(levelSet);
    const DeviceField deviceField(openDevice(), levelSet, options);
    CHECK(deviceField.bounds().lower == field.bounds().lower);
    CHECK(deviceField.bounds().upper == field.bounds().upper);
    const std::vector<glm::vec3> points = allKindsOfPoints(random, field.bounds(), count);
    checkSameSamples(field, points, samplesOf(deviceField, points));
}

BuildOptions optionsFor(const Mesh& mesh, float resolution, Method method) {
    BuildOptions options;
    options.method = method;
    options.voxelSize = voxelSizeFor(mesh, resolution);
    return options;
}

// A field that stays on the device gives the same answers as one that is built there and downloaded.
void checkBuiltOnDevice(const Mesh& mesh, const BuildOptions& build, const OpenclOptions& options = {}) {
    const Device device = openDevice();
    const Field field(bilayer::build(mesh, build, openclFiller(device, options)));
    const DeviceField onDevice(device, mesh, build, options);
    CHECK(onDevice.bounds().lower == field.bounds().lower);
    CHECK(onDevice.bounds().upper == field.bounds().upper);
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const std::vector<glm::vec3> points = allKindsOfPoints(random, field.bounds(), 100000);
    checkSameSamples(field, points, samplesOf(onDevice, points));
}

}  // namespace

TEST_CASE("device samples in the band are OpenVDB's trilinear interpolation") {
    checkInBand(onDevice());
}

TEST_CASE("device samples at voxel centres are the stored values") {
    checkVoxelCentres(onDevice());
}

TEST_CASE("device samples out of the band are bounds of the true distance") {
    checkBeyondBand(onDevice());
}

TEST_CASE("device samples in empty blocks grow with the distance") {
    checkEmptyBlocks(onDevice());
}

TEST_CASE("device samples of a band narrower than a cell have the right signs") {
    checkNarrowBand(onDevice());
}

TEST_CASE("device samples nowhere are far outside") {
    checkNowhere(onDevice());
}

TEST_CASE("device samples far from the origin are as good as near it") {
    checkFarFromOrigin(onDevice());
}

TEST_CASE("device samples of level sets from elsewhere are as good") {
    checkOtherLevelSets(onDevice());
}

TEST_CASE("device and processor sample alike, in several batches") {
    const OpenclOptions options{.mapping = GENERATE(KernelMapping::blockPerItem, KernelMapping::groupPerBlock)};
    const Solid solid = GENERATE(from_range(smallSolids()));
    checkSameSamples(levelSetOf(solid, h, 3, 5), options, 600001);
    checkSameSamples(levelSetOf(solid, h, 0.8f, 1), options, 100000);
}

TEST_CASE("device and processor sample a mesh's field alike") {
    const auto path = corpusMesh("bunny_watertight.obj");
    if (!path) return;
    const Mesh mesh = readMesh(*path);
    checkSameSamples(built(mesh, voxelSizeFor(mesh, 100)), {}, 300000);
}

TEST_CASE("any number of points is sampled, none too") {
    const LevelSet levelSet = levelSetOf(sphereSolid(0.4), h);
    const DeviceField field(openDevice(), levelSet);
    const std::vector<glm::vec3> points(1030, glm::vec3(0.4f, 0, 0));
    for (const std::size_t count : {0, 1, 2, 63, 64, 65, 1023, 1024, 1025}) {
        std::vector<Sample> samples(points.size(), {.distance = 77});
        field.sample(std::span(points).first(count), std::span(samples).first(count));
        for (std::size_t i = 0; i < samples.size(); ++i) {
            CAPTURE(count, i, samples[i].distance);
            REQUIRE((samples[i].distance == 77) == (i >= count));
        }
    }
    std::vector<Sample> tooFew(points.size() - 1);
    CHECK_THROWS_AS(field.sample(points, tooFew), std::invalid_argument);
}

TEST_CASE("a field on a device needs memory, says how much, and what it took") {
    const LevelSet levelSet = levelSetOf(sphereSolid(0.4), h);
    const Device device = openDevice();
    const DeviceField field(device, levelSet, {.memoryMiB = 64, .profile = true});
    CHECK(field.memoryBytes() > levelSet.leaves() * 729 * sizeof(float));
    CHECK(field.buildTimes().peakBytes == field.memoryBytes());
    const LevelSet fine = levelSetOf(sphereSolid(0.4), h / 2);
    CHECK_THROWS_AS(DeviceField(device, fine, {.memoryMiB = 1}), DeviceError);
    CHECK_THROWS_WITH(DeviceField(device, fine, {.memoryMiB = 1}),
                      Contains(" needs at least ") && Contains("MiB") && Contains(device.info().name));

    std::vector<glm::vec3> points(200000);
    std::vector<Sample> samples(points.size());
    const DeviceTimes times = field.sample(points, samples);
    CHECK(times.kernels > 0);
    CHECK(times.download >= 0);
}

TEST_CASE("several threads sample one field at once") {
    const LevelSet levelSet = levelSetOf(torusSolid(0.35, 0.13), h);
    const DeviceField field(openDevice(), levelSet);
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    std::vector<std::vector<glm::vec3>> points(4);
    std::vector<std::vector<Sample>> samples(points.size());
    for (auto& some : points) some = allKindsOfPoints(random, field.bounds(), 150000);
    std::vector<std::thread> threads;
    for (std::size_t i = 0; i < points.size(); ++i)
        threads.emplace_back([&, i] { samples[i] = samplesOf(field, points[i]); });
    for (std::thread& thread : threads) thread.join();
    for (std::size_t i = 0; i < points.size(); ++i) checkSameSamples(Field(levelSet), points[i], samples[i]);
}

TEST_CASE("a field built to stay on the device answers as the same field from there") {
    const Method method = GENERATE(Method::exact, Method::doubleLayer);
    const bool forGpu = GENERATE(false, true);
    const OpenclOptions options{.mapping = forGpu ? KernelMapping::groupPerBlock : KernelMapping::blockPerItem};
    for (const Mesh& mesh : {shapes::sphere(1.f, 4), shapes::torus(1.f, 0.4f), shapes::box({1.f, 0.6f, 0.3f}),
                             shapes::torusKnot(2, 3, 1.f, 0.3f)}) {
        BuildOptions build = optionsFor(mesh, forGpu ? 24 : 90, method);
        CAPTURE(mesh.triangles.size(), forGpu, method == Method::exact);
        checkBuiltOnDevice(mesh, build, options);
        build.exteriorWidthVoxels = 4.5f;
        build.interiorWidthVoxels = 1.25f;
        checkBuiltOnDevice(mesh, build, options);
        build.exteriorWidthVoxels = 0.7f;
        checkBuiltOnDevice(mesh, build, options);
    }
}

TEST_CASE("fields of the corpus stay on the device") {
    const Method method = GENERATE(Method::exact, Method::doubleLayer);
    for (const char* name : {"bunny_watertight.obj", "cgal-knot2.off"}) {
        const auto path = corpusMesh(name);
        if (!path) continue;
        CAPTURE(name, method == Method::exact);
        const Mesh mesh = readMesh(*path);
        checkBuiltOnDevice(mesh, optionsFor(mesh, 100, method));
    }
}

TEST_CASE("fields stay on the device of a mesh that is repaired, and of such whose sides the processor finds") {
    for (const char* name : {"casting_inverted.off", "thingi_73416.stl", "degenerated.obj"}) {
        const auto path = corpusMesh(name);
        if (!path) continue;
        CAPTURE(name);
        const Mesh mesh = readMesh(*path);
        checkBuiltOnDevice(mesh, optionsFor(mesh, 64, Method::exact));
    }
}

TEST_CASE("a field far from the origin stays on the device") {
    const Mesh mesh =
        transformed(shapes::sphere(1.f, 3), glm::mat4(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -900, 700, -1300, 1));
    checkBuiltOnDevice(mesh, optionsFor(mesh, 40, Method::exact));
}

TEST_CASE("what needs the processor cannot stay on the device, nor what exceeds its memory") {
    const Device device = openDevice();
    const Mesh ball = shapes::sphere(1.f, 4);
    for (const Method method : {Method::prism, Method::pseudonormal})
        CHECK_THROWS_AS(DeviceField(device, ball, optionsFor(ball, 40, method)), std::invalid_argument);
    BuildOptions options = optionsFor(ball, 40, Method::exact);
    options.sign = Sign::winding;
    CHECK_THROWS_WITH(DeviceField(device, ball, options), Contains("signs") && Contains("level set"));
    options = optionsFor(ball, 200, Method::exact);
    CHECK_THROWS_AS(DeviceField(device, ball, options, {.memoryMiB = 16}), DeviceError);
    options.progress = [](float) { return false; };
    CHECK_THROWS_AS(DeviceField(device, ball, options), Cancelled);

    // two balls that overlap: inside one, the normals of the other contradict
    Mesh both = ball;
    const Mesh other = transformed(ball, glm::mat4(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.7f, 0.1f, 0, 1));
    const auto shift = std::uint32_t(both.points.size());
    both.points.insert(both.points.end(), other.points.begin(), other.points.end());
    for (const glm::uvec3& t : other.triangles) both.triangles.push_back(t + shift);
    CHECK_THROWS_WITH(DeviceField(device, both, optionsFor(both, 40, Method::exact)), Contains("contradict"));
}
}  // namespace bilayer::field_test
