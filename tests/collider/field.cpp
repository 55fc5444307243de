#include "collider/field.h"

#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/parallel_for.h>

#include <bit>
#include <catch2/catch.hpp>
#include <limits>

#include "demos/shared/shapes.h"
#include "tests/support/sampling.h"
#include "tests/support/support.h"

using namespace bilayer;
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

}  // namespace

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
    const float edge = Clearance::partSide * float(h);
    for (const Solid& solid : smallSolids()) {
        const Field field(levelSetOf(solid, h, 3, 6));
        const Clearance clearance = field.clearance();
        int beside = 0, ruledOut = 0;
        for (int i = 0; i < 20000; ++i) {
            const glm::vec3 p = random.point(i % 4 ? 0.6 : 3);
            const auto radius = float(random(0, 0.3)), reach = float(random(-2, 2) * h);
            const glm::vec3 place = glm::vec3(glm::dvec3(p) - field.origin()) / edge;
            const double truth = solid.distance(glm::dvec3(p));
            const Sample sample = field.sample(p);
            CAPTURE(p.x, p.y, p.z, truth, radius, reach);
            REQUIRE(clearance.around(place) * edge <= std::abs(truth) + 1e-6);
            if (clearance.isOutside(place, radius / edge)) REQUIRE(truth >= radius - 1e-6);
            if (clearance.isAbove(place, reach)) REQUIRE((!sample.inBand || sample.distance > reach - 1e-6f));
            // a part's diagonal, and the way to where the surface is in another
            if (truth < radius + 2 * 1.7321 * edge) continue;
            ++beside;
            ruledOut += clearance.isOutside(place, radius / edge);
        }
        REQUIRE(beside > 1000);
        REQUIRE(ruledOut > 0.9 * beside);  // about 0.95, and these are a few thousand random points
    }
    const Field field(levelSetOf(sphereSolid(0.4), h));
    for (const glm::vec3& p : {glm::vec3(notANumber, 0, 0), glm::vec3(0, notANumber, 0)})
        REQUIRE_FALSE(field.clearance().isOutside(p, 1));
    for (const float far : {1e9f, 1e30f, infinity, -infinity}) REQUIRE(field.clearance().isOutside({0, far, 0}, 1));
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

TEST_CASE("the bound grows with the number of empty blocks, outside and inside") {
    checkEmptyBlocks(makeField);
}

TEST_CASE("a band narrower than a cell still tells the sides apart") {
    checkNarrowBand(makeField);
}

TEST_CASE("points that are nowhere are far outside") {
    checkNowhere(makeField);
}

TEST_CASE("far from the origin a field is as good as near it") {
    checkFarFromOrigin(makeField);
    const glm::dvec3 centre(1e4, -1e4, 5e3);
    const auto hit = Field(levelSetOf(sphereSolid(0.3, centre), 0.01))
                         .raycast(glm::vec3(centre) + glm::vec3(2, 0, 0), {-1, 0, 0}, 10);
    REQUIRE(hit);
    REQUIRE(hit->distance == Approx(1.7).margin(2e-4));
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

TEST_CASE("rays meet a sphere and a box where geometry says") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const Solid& solid : {sphereSolid(0.4), boxSolid({0.35, 0.22, 0.3})}) {
        const Field field(levelSetOf(solid, h));
        int hits = 0, misses = 0;
        for (int i = 0; i < 4000; ++i) {
            const glm::vec3 origin = float(random(0.8, 5)) * random.direction();
            const glm::vec3 towards = glm::normalize(random.point(0.6) - origin);
            CAPTURE(origin.x, origin.y, origin.z, towards.x, towards.y, towards.z);
            // the truth by tiny steps of the formula's own distance, in double precision
            const glm::dvec3 from(origin), along = glm::normalize(glm::dvec3(towards));
            double t = 0, nearest = 1e9;
            for (int step = 0; step < 2000 && t < 12 && nearest > 1e-9; ++step) {
                const double distance = solid.distance(from + t * along);
                nearest = std::min(nearest, distance);
                t += distance;
            }
            const auto hit = field.raycast(origin, towards, 100);
            if (nearest > 0.3 * h) {
                ++misses;
                REQUIRE_FALSE(hit);
                continue;
            }
            if (nearest > 1e-6) continue;  // grazes the surface by less than the interpolant's error
            const glm::dvec3 p = from + t * along;
            if (solid.distance(p + h * along) > -0.5 * h) continue;  // cuts an edge that the interpolant rounds off
            ++hits;
            REQUIRE(hit);
            REQUIRE(std::abs(field.distance(hit->position)) < 2e-4 * h);
            // where a corner of the box lies amid a cell, the interpolant is off by half a voxel
            REQUIRE(std::abs(solid.distance(glm::dvec3(hit->position))) < 0.5 * h);
            REQUIRE(std::abs(hit->distance - t) < 2 * h);
            REQUIRE(glm::distance(origin + hit->distance * towards, hit->position) < 1e-5f);
            REQUIRE(glm::length(hit->normal) == Approx(1).margin(1e-5));
            REQUIRE(glm::dot(hit->normal, towards) < 0.2f);
        }
        REQUIRE(hits > 500);
        REQUIRE(misses > 200);
    }
}

TEST_CASE("rays meet the interpolant where steps of a fiftieth of a voxel do") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const Solid& solid : smallSolids()) {
        const Field field(levelSetOf(solid, h));
        for (int i = 0; i < 1000; ++i) {
            const glm::vec3 origin = random.direction();
            const glm::vec3 towards = glm::normalize(random.point(0.5) - origin);
            const double step = 0.02 * h;
            int negative = 0, longest = 0;
            double first = 0;
            for (double t = 0; t < 2 && longest < 6; t += step) {
                negative = field.distance(origin + float(t) * towards) < 0 ? negative + 1 : 0;
                if (negative == 1) first = t;
                longest = std::max(longest, negative);
            }
            const auto hit = field.raycast(origin, towards, 2);
            CAPTURE(origin.x, origin.y, origin.z, towards.x, towards.y, towards.z, longest, first);
            // chords below a tenth of a voxel may be seen or not
            if (longest == 0 && hit) REQUIRE(std::abs(field.distance(hit->position)) < 2e-4 * h);
            if (longest < 6) continue;
            REQUIRE(hit);
            REQUIRE(hit->distance <= first + 0.01 * h);
            if (hit->distance < first - 1.5 * step) REQUIRE(std::abs(field.distance(hit->position)) < 2e-4 * h);
        }
    }
}

TEST_CASE("rays straight at flat and round walls are exact") {
    const Field box(levelSetOf(boxSolid({0.35, 0.22, 0.3}), h));
    const auto hit = box.raycast({2, 0.05f, -0.07f}, {-1, 0, 0}, infinity);
    REQUIRE(hit);
    REQUIRE(hit->distance == Approx(1.65).margin(2e-4 * h));
    REQUIRE(hit->normal.x == Approx(1).margin(1e-5));

    const Field sphere(levelSetOf(sphereSolid(0.4), h));
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int i = 0; i < 500; ++i) {
        const glm::vec3 out = random.direction();
        const auto round = sphere.raycast(3.f * out, -out, 10);
        REQUIRE(round);
        REQUIRE(round->distance == Approx(2.6).margin(0.02 * h));
        REQUIRE(glm::dot(round->normal, out) > 0.999f);
    }
}

TEST_CASE("a ray does not pass a wall of one voxel") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int i = 0; i < 20; ++i) {
        const double offset = random(-0.5, 0.5) * h;
        const Solid slab{[=](const glm::dvec3& p) {
                             return boxSolid({0.4, 0.4, 0.55 * h}).distance(p - glm::dvec3(0, 0, offset));
                         },
                         {0.4, 0.4, 2 * h}};
        const Field field(levelSetOf(slab, h));
        for (int k = 0; k < 200; ++k) {
            const glm::vec3 target(float(random(-0.3, 0.3)), float(random(-0.3, 0.3)), float(offset));
            glm::vec3 towards = random.direction();
            if (std::abs(towards.z) < 0.2f) towards.z = 0.2f;
            towards = glm::normalize(towards);
            const auto hit = field.raycast(target - 0.9f * towards, towards, 10);
            CAPTURE(offset, target.x, target.y, towards.x, towards.y, towards.z);
            REQUIRE(hit);
            REQUIRE(glm::distance(hit->position, target) < 5 * h);
        }
    }
}

TEST_CASE("rays that start inside, end early or are no rays") {
    const Field field(levelSetOf(sphereSolid(0.4), h));
    for (const glm::vec3 start : {glm::vec3(0), glm::vec3(0.39f, 0, 0)}) {
        const auto hit = field.raycast(start, {1, 0, 0}, 10);
        REQUIRE(hit);
        REQUIRE(hit->distance == 0);
        REQUIRE(hit->position == start);
        REQUIRE(glm::length(hit->normal) == Approx(1));
    }
    REQUIRE(field.raycast({1, 0, 0}, {-1, 0, 0}, 0.61f));
    REQUIRE_FALSE(field.raycast({1, 0, 0}, {-1, 0, 0}, 0.59f));
    REQUIRE_FALSE(field.raycast({1, 0, 0}, {1, 0, 0}, infinity));
    REQUIRE(field.raycast({1, 0, 0}, {-5, 0, 0}, 1)->distance == Approx(0.6).margin(1e-4));

    REQUIRE_FALSE(field.raycast({1, 0, 0}, {0, 0, 0}, infinity));
    REQUIRE_FALSE(field.raycast({notANumber, 0, 0}, {1, 0, 0}, 10));
    REQUIRE_FALSE(field.raycast({1, 0, 0}, {notANumber, 0, 0}, 10));
    REQUIRE_FALSE(field.raycast({infinity, 0, 0}, {-1, 0, 0}, infinity));
    REQUIRE_FALSE(field.raycast({1, 0, 0}, {-1, 0, 0}, notANumber));
    REQUIRE_FALSE(field.raycast({1, 0, 0}, {-1, 0, 0}, -1));
    // from so far that single precision cannot tell whether it hits: it must only end
    (void)field.raycast({1e30f, 1e30f, 1e30f}, {-1, -1, -1}, infinity);
    (void)field.raycast({3e38f, 0, 0}, {-1, 0, 0}, infinity);
    // along the surface all the way
    (void)field.raycast({0.4f, -3, 0}, {0, 1, 0}, infinity);
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
