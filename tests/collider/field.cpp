// SPDX-License-Identifier: Apache-2.0
#include <bilayer/collider/field.h>

#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/parallel_for.h>

#include <bit>
#include <catch2/catch.hpp>
#include <limits>
#include <memory>
#include <stdexcept>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include "collider/contact/body/collider_data.h"
#include "collider/field/samples/field_data.h"
#include "demos/shared/shapes.h"
#include "sdf/base/access.h"
#include "sdf/base/openvdb.h"
#include "tests/support/random.h"
#include "tests/support/sampling.h"
#include "tests/support/support.h"

namespace bilayer::field_test {
using namespace bilayer::detail;
using namespace bilayer::test;

namespace {

constexpr double h = 0.02;  // of most fields here [m]
constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr float notANumber = std::numeric_limits<float>::quiet_NaN();

bool sameBits(const Sample& a, const Sample& b) {
    return a.inBand == b.inBand && a.gradient == b.gradient &&
           std::bit_cast<std::uint32_t>(a.distance) == std::bit_cast<std::uint32_t>(b.distance);
}

Sampler makeField(const LevelSet& levelSet) {
    return [field = Field(levelSet)](std::span<const glm::vec3> points) {
        std::vector<Sample> samples;
        for (const glm::vec3& p : points) samples.push_back(field.sample(p));
        return samples;
    };
}

Sampler makeBatched(const LevelSet& levelSet) {
    return [field = Field(levelSet)](std::span<const glm::vec3> points) {
        std::vector<Sample> samples(points.size());
        field.sample(points, samples);
        return samples;
    };
}

Sampler makeFieldSampler(const LevelSet& levelSet) {
    return [field = Field(levelSet)](std::span<const glm::vec3> points) {
        FieldSampler sampler(field);
        std::vector<Sample> samples;
        for (const glm::vec3& p : points) samples.push_back(sampler.sample(p));
        return samples;
    };
}

// Points in a field's box and around it, some of them not finite.
std::vector<glm::vec3> pointsAround(Random& random, std::size_t count) {
    std::vector<glm::vec3> points;
    for (std::size_t i = 0; i < count; ++i) points.push_back(random.point(i % 4 ? 0.5 : 3));
    for (std::size_t i = 7; i < count; i += 97) points[i][int(i % 3)] = i % 2 ? notANumber : infinity;
    return points;
}

}  // namespace

TEST_CASE("a field far from the zero point says where its coordinates begin, with its mesh and without") {
    Mesh mesh = shapes::box({1, 1, 1});
    mesh.origin = {5e6, -3e5, 100};
    const LevelSet levelSet = build(mesh, {.voxelSize = 0.1f});
    CHECK(Field(levelSet).origin() == mesh.origin);
    CHECK(Field(levelSet, mesh).origin() == mesh.origin);
    CHECK(Collider(mesh, levelSet).exactField().origin() == mesh.origin);
    CHECK(Field(levelSet).distance({0, 0, 0}) < 0);
}

TEST_CASE("in the band a sample is OpenVDB's trilinear interpolation, and only there it is in the band") {
    checkInBand(makeField);
}

TEST_CASE("voxel centres, cell borders and block borders give the stored values") {
    checkVoxelCentres(makeField);
}

TEST_CASE("out of the band a sample is a bound of the true distance with the right sign") {
    checkBeyondBand(makeField);
}

TEST_CASE("what a clearance rules out is ruled out, and little else far from the surface") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const float edge = Clearance::cellSide * float(h);
    for (const Solid& solid : smallSolids()) {
        const Field field(levelSetOf(solid, h, 3, 6));
        const Clearance clearance = dataOf(field).coarse;
        int farPoints = 0, ruledOut = 0;
        for (int i = 0; i < 20000; ++i) {
            const glm::vec3 p = random.point(i % 4 ? 0.6 : 3);
            const auto radius = float(random(0, 0.3)), reach = float(random(-2, 2) * h);
            const glm::vec3 place = glm::vec3(glm::dvec3(p) - dataOf(field).origin) / edge;
            const double truth = solid.distance(glm::dvec3(p));
            const Sample sample = field.sample(p);
            CAPTURE(p.x, p.y, p.z, truth, radius, reach);
            REQUIRE(clearance.around(place) * edge <= std::abs(truth) + 1e-6);
            if (clearance.isOutside(place, radius / edge)) REQUIRE(truth >= radius - 1e-6);
            if (clearance.isAbove(place, reach)) REQUIRE((!sample.inBand || sample.distance > reach - 1e-6f));
            // the diagonal of a coarse cell, plus the distance to the surface in another one
            if (truth < radius + 2 * 1.7321 * edge) continue;
            ++farPoints;
            ruledOut += clearance.isOutside(place, radius / edge);
        }
        REQUIRE(farPoints > 1000);
        REQUIRE(ruledOut > 0.9 * farPoints);  // about 0.95; the sample is a few thousand random points
    }
    const Field field(levelSetOf(sphereSolid(0.4), h));
    for (const glm::vec3& p : {glm::vec3(notANumber, 0, 0), glm::vec3(0, notANumber, 0)})
        REQUIRE_FALSE(dataOf(field).coarse.isOutside(p, 1));
    for (const float far : {1e9f, 1e30f, infinity, -infinity}) REQUIRE(dataOf(field).coarse.isOutside({0, far, 0}, 1));
}

TEST_CASE("a sample within a reach is the sample, its gradient only there") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const Field field(levelSetOf(torusSolid(0.35, 0.13), h));
    for (int i = 0; i < 20000; ++i) {
        const glm::vec3 p = random.point(0.5);
        const auto reach = float(random(-3, 3) * h);
        const Sample whole = field.sample(p);
        Sample expected = whole;
        if (!(whole.distance <= reach)) expected.gradient = glm::vec3(0);
        REQUIRE(sameBits(field.sampleWithin(p, reach), expected));
        REQUIRE(field.distance(p) == whole.distance);
    }
}

TEST_CASE("a batch is its samples, whatever its length") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const Storage storage : {Storage::float32, Storage::fixed16}) {
        const Field field(levelSetOf(torusSolid(0.35, 0.13), h), {.storage = storage});
        for (const std::size_t count : {0, 1, 2, 31, 32, 33, 64, 65, 5000}) {
            const std::vector<glm::vec3> points = pointsAround(random, count);
            std::vector<Sample> samples(count, Sample{.distance = 7});
            field.sample(points, samples);
            for (std::size_t i = 0; i < count; ++i) {
                CAPTURE(count, i, points[i].x, points[i].y, points[i].z);
                REQUIRE(sameBits(samples[i], field.sample(points[i])));
            }
        }
        std::vector<Sample> tooFew(2);
        REQUIRE_THROWS_AS(field.sample(std::vector<glm::vec3>(3), tooFew), std::invalid_argument);
    }
}

TEST_CASE("batches answer as single samples do") {
    checkInBand(makeBatched);
    checkVoxelCentres(makeBatched);
    checkBeyondBand(makeBatched);
    checkNarrowBand(makeBatched);
    checkNowhere(makeBatched);
    checkFarFromOrigin(makeBatched);
}

TEST_CASE("a field sampler answers as single samples do") {
    checkInBand(makeFieldSampler);
    checkVoxelCentres(makeFieldSampler);
    checkBeyondBand(makeFieldSampler);
    checkNarrowBand(makeFieldSampler);
    checkNowhere(makeFieldSampler);
    checkFarFromOrigin(makeFieldSampler);
}

TEST_CASE("a field sampler's samples are the field's, whatever block it keeps") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const Storage storage : {Storage::float32, Storage::fixed16}) {
        const Field field(levelSetOf(torusSolid(0.35, 0.13), h), {.storage = storage});
        const Field other(levelSetOf(sphereSolid(0.4), h), {.storage = storage});
        FieldSampler sampler(field), otherSampler(other);
        int inBand = 0;
        const auto check = [&](const glm::vec3& p) {
            CAPTURE(p.x, p.y, p.z);
            const Sample expected = field.sample(p);
            REQUIRE(sameBits(sampler.sample(p), expected));
            REQUIRE(sameBits(otherSampler.sample(p), other.sample(p)));
            inBand += expected.inBand;
        };
        for (const glm::vec3& p : pointsAround(random, 20000)) check(p);
        // steps of a fifth of a voxel through cells, blocks, and the ends of the band
        for (int path = 0; path < 200; ++path) {
            const glm::vec3 from = random.point(0.5), to = random.point(0.5);
            const int steps = int(5 * glm::distance(from, to) / float(h));
            for (int i = 0; i <= steps; ++i) check(glm::mix(from, to, float(i) / float(steps)));
        }
        // the corners of voxels and blocks, one float below and above
        for (int i = 0; i < 5000; ++i) {
            glm::vec3 p(dataOf(field).origin + h * glm::round(glm::dvec3(random.point(30)) + 30.));
            for (int axis = 0; axis < 3; ++axis) {
                const float way = i % 3 == 0 ? 0.f : i % 3 == 1 ? -infinity : infinity;
                if (way != 0) p[axis] = std::nextafter(p[axis], way);
                check(p);
            }
        }
        // NaN with any bits, as a place that a sampler keeps may have
        for (const std::uint32_t bits : {0x7fc00000u, 0x7f800001u, 0x7fffffffu, 0xffc00000u, 0xffffffffu})
            for (int axis = 0; axis < 3; ++axis) {
                glm::vec3 p(0.35f, 0, 0);
                p[axis] = std::bit_cast<float>(bits);
                check(p);
                check(glm::vec3(p[axis]));
            }
        REQUIRE(inBand > 5000);  // about 11,000
    }
}

TEST_CASE("in 16 bits distances are off by half a step, in half the memory") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const auto& [outside, inside] : {std::pair(3., 3.), std::pair(2., 6.), std::pair(5., 1.5)}) {
        const LevelSet levelSet = levelSetOf(torusSolid(0.35, 0.13), h, outside, inside);
        const Field exact(levelSet), small(levelSet, {.storage = Storage::fixed16});
        const double step = std::max(outside, inside) * h / 32766;
        int inBand = 0;
        for (const glm::vec3& p : pointsAround(random, 20000)) {
            const Sample a = exact.sample(p), b = small.sample(p);
            CAPTURE(p.x, p.y, p.z, a.distance, b.distance);
            REQUIRE(a.inBand == b.inBand);
            if (!std::isfinite(a.distance)) REQUIRE(b.distance == a.distance);
            if (std::isfinite(a.distance)) REQUIRE(std::abs(a.distance - b.distance) <= 0.51 * step + 1e-7);
            if (!a.inBand) REQUIRE((a.distance == 0 || std::signbit(a.distance) == std::signbit(b.distance)));
            for (int axis = 0; axis < 3; ++axis)
                REQUIRE(std::abs(a.gradient[axis] - b.gradient[axis]) <= 1.02 * step / h + 1e-5);
            inBand += a.inBand;
        }
        REQUIRE(inBand > 1000);
        REQUIRE(double(small.memoryBytes()) < 0.6 * double(exact.memoryBytes()));
    }
}

TEST_CASE("the bound grows with the number of empty blocks, outside and inside") {
    checkEmptyBlocks(makeField);
}

TEST_CASE("a band narrower than a cell still has the right signs") {
    checkNarrowBand(makeField);
}

TEST_CASE("points that are nowhere are far outside") {
    checkNowhere(makeField);
}

TEST_CASE("far from the origin a field is as good as near it") {
    checkFarFromOrigin(makeField);
}

TEST_CASE("bounds hold all points in the band, and what a field says of itself is its level set's") {
    const LevelSet levelSet = levelSetOf(torusSolid(0.35, 0.13), h, 3, 2);
    const Field field(levelSet);
    REQUIRE(field.voxelSize() == levelSet.voxelSize());
    REQUIRE(field.exteriorWidth() == Approx(3 * h));
    REQUIRE(field.interiorWidth() == Approx(2 * h));
    REQUIRE(field.memoryBytes() > levelSet.leaves() * 729 * sizeof(float));
    REQUIRE(field.bounds().upper.x == Approx(0.48 + 3 * h).margin(1.5 * h));
    REQUIRE(field.bounds().lower.z == Approx(-0.13 - 3 * h).margin(1.5 * h));

    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int i = 0; i < 20000; ++i) {
        const glm::vec3 p = random.point(0.7);
        if (!field.sample(p).inBand) continue;
        const glm::vec3 inside = glm::clamp(p, field.bounds().lower, field.bounds().upper);
        REQUIRE(glm::distance(p, inside) < 1e-6f);
    }
}

TEST_CASE("a field whose box is too large for its voxels is refused") {
    const auto grid = openvdb::FloatGrid::create(1.f);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    grid->tree().setValueOn({0, 0, 0}, 0.5f);
    grid->tree().setValueOn({1000000, 1000000, 1000000}, 0.5f);
    auto grids = std::make_shared<Grids>();
    grids->distance = grid;
    const LevelSet levelSet(grids);
    REQUIRE_THROWS_AS(Field(levelSet), std::invalid_argument);
}

TEST_CASE("fields are the same for any number of threads, and so are queries") {
    const LevelSet levelSet = levelSetOf(torusSolid(0.35, 0.13), h);
    const Field field(levelSet);
    const Field alone = [&] {
        const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
        return Field(levelSet);
    }();
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    std::vector<glm::vec3> points(50000);
    for (glm::vec3& p : points) p = random.point(0.6);
    std::vector<Sample> samples(points.size());
    tbb::parallel_for(std::size_t(0), points.size(), [&](std::size_t i) { samples[i] = field.sample(points[i]); });
    for (std::size_t i = 0; i < points.size(); ++i) REQUIRE(sameBits(samples[i], alone.sample(points[i])));
}

TEST_CASE("a level set of OpenVDB's own and one of the double layer method serve as well") {
    checkOtherLevelSets(makeField);
}

TEST_CASE("bounds of points as far away as floats reach are finite, and so are the boxes of fields") {
    const Mesh ball = shapes::sphere(1, 3);
    const Field field(build(ball, {.voxelSize = 0.001f, .exteriorWidthVoxels = 2, .interiorWidthVoxels = 2}));
    for (const float away : {1e10f, 1e36f, 3e38f}) {
        const Sample sample = field.sample({0, away, 0});
        CHECK_FALSE(sample.inBand);
        CHECK(sample.distance <= away);
        CHECK(sample.distance > 0.99f * away);
    }
    // two voxels of the band, farther apart than the range of int
    const auto grid = openvdb::createLevelSet<openvdb::FloatGrid>(1.f, 3.f);
    for (const int x : {-2147483640, 2147483632}) grid->tree().setValue({x, x, 0}, 0.5f);
    auto grids = std::make_shared<Grids>();
    grids->distance = grid;
    CHECK_THROWS_AS(Field(LevelSet(grids)), std::invalid_argument);
}
}  // namespace bilayer::field_test
