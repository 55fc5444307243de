// SPDX-License-Identifier: Apache-2.0
#include "tests/support/sampling.h"

#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/LevelSetSphere.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

#include <bilayer/sdf/grids.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::test {
namespace {

constexpr double h = 0.02;                 // of most fields here [m]
constexpr double rounding = 4e-7 * 3 * h;  // of single precision at the band's width
constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr float notANumber = std::numeric_limits<float>::quiet_NaN();

openvdb::Vec3d toIndex(const LevelSet& levelSet, const glm::vec3& p) {
    return levelSet.grids().distance->worldToIndex(openvdb::Vec3d(p.x, p.y, p.z));
}

double trilinear(const LevelSet& levelSet, const openvdb::Vec3d& index) {
    return openvdb::tools::BoxSampler::sample(levelSet.grids().distance->tree(), index);
}

bool allEightActive(const LevelSet& levelSet, const openvdb::Vec3d& index) {
    for (int corner = 0; corner < 8; ++corner)
        if (!levelSet.grids().distance->tree().isValueOn(
                openvdb::Coord::floor(index).offsetBy(corner >> 2, corner >> 1 & 1, corner & 1)))
            return false;
    return true;
}

// Points and the samples of a field there.
struct Sampled {
    std::vector<glm::vec3> points;
    std::vector<Sample> samples;
};

Sampled sampled(const Sampler& sample, std::vector<glm::vec3> points) {
    std::vector<Sample> samples = sample(points);
    REQUIRE(samples.size() == points.size());
    return {std::move(points), std::move(samples)};
}

std::vector<glm::vec3> randomPoints(Random& random, int count, double halfSize) {
    std::vector<glm::vec3> points;
    for (int i = 0; i < count; ++i) points.push_back(random.point(halfSize));
    return points;
}

float distanceAt(const Sampler& sample, const glm::vec3& point) {
    return sample(std::span(&point, 1)).at(0).distance;
}

}  // namespace

std::vector<Solid> smallSolids() {
    return {sphereSolid(0.4), boxSolid({0.35, 0.22, 0.3}), torusSolid(0.35, 0.13)};
}

void checkInBand(const MakeSampler& make) {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const Solid& solid : smallSolids()) {
        const LevelSet levelSet = levelSetOf(solid, h, 3, 2);
        const auto [points, samples] = sampled(make(levelSet), randomPoints(random, 40000, 0.6));
        int inBand = 0;
        for (std::size_t i = 0; i < points.size(); ++i) {
            const glm::vec3 p = points[i];
            const Sample& sample = samples[i];
            CAPTURE(p.x, p.y, p.z);
            const openvdb::Vec3d index = toIndex(levelSet, p);
            REQUIRE(sample.inBand == allEightActive(levelSet, index));
            if (!sample.inBand) {
                REQUIRE(sample.gradient == glm::vec3(0));
                continue;
            }
            ++inBand;
            REQUIRE(std::abs(sample.distance - trilinear(levelSet, index)) <= rounding);
            // along an axis, within a cell, the interpolant is linear: differences equal the derivative
            for (int axis = 0; axis < 3; ++axis) {
                openvdb::Vec3d low = index, high = index;
                low[axis] = std::floor(index[axis]);
                high[axis] = low[axis] + 1;
                const double slope = (trilinear(levelSet, high) - trilinear(levelSet, low)) / h;
                REQUIRE(std::abs(sample.gradient[axis] - slope) <= 2 * rounding / h);
            }
        }
        REQUIRE(inBand > 1000);
    }
}

void checkVoxelCentres(const MakeSampler& make) {
    const LevelSet levelSet = levelSetOf(sphereSolid(0.4), 0.0625);  // a power of two: points fall on voxels exactly
    std::vector<glm::vec3> centres;
    std::vector<float> values;
    for (auto value = levelSet.grids().distance->cbeginValueOn(); value; ++value) {
        const openvdb::Coord c = value.getCoord();
        centres.push_back(0.0625f * glm::vec3(c.x(), c.y(), c.z()));
        values.push_back(*value);
    }
    const auto [points, samples] = sampled(make(levelSet), centres);
    for (std::size_t i = 0; i < points.size(); ++i) {
        if (samples[i].inBand) REQUIRE(samples[i].distance == values[i]);
        REQUIRE(std::abs(samples[i].distance) <= std::abs(values[i]));
    }
}

void checkBeyondBand(const MakeSampler& make) {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const auto& [exterior, interior] : {std::pair(3.f, 3.f), std::pair(2.f, 4.f), std::pair(6.5f, 2.f)})
        for (const Solid& solid : smallSolids()) {
            std::vector<glm::vec3> nearAndFar = randomPoints(random, 10000, 0.5);
            for (const glm::vec3& p : randomPoints(random, 10000, 3)) nearAndFar.push_back(p);
            const auto [points, samples] = sampled(make(levelSetOf(solid, h, exterior, interior)), nearAndFar);
            for (std::size_t i = 0; i < points.size(); ++i) {
                const glm::vec3 p = points[i];
                const Sample& sample = samples[i];
                const double truth = solid.distance(glm::dvec3(p));
                CAPTURE(p.x, p.y, p.z, truth, sample.distance, sample.inBand, exterior, interior);
                if (sample.inBand) {
                    REQUIRE(std::abs(sample.distance - truth) < 0.5 * h);
                    continue;
                }
                REQUIRE((sample.distance < 0) == (truth < 0));
                REQUIRE(std::abs(sample.distance) <= std::abs(truth) + 1e-6);
                const double width = (truth < 0 ? interior : exterior) * h;
                REQUIRE(std::abs(sample.distance) >= width - 1.7321 * h - 1e-6);
                if (truth > 2) REQUIRE(sample.distance > 0.5 * truth);
            }
        }
}

void checkEmptyBlocks(const MakeSampler& make) {
    const Sampler sample = make(levelSetOf(sphereSolid(1), h));
    REQUIRE(distanceAt(sample, {0, 0, 0}) < -0.3f);  // of 1: coarse cells are counted by the longest axis, 0.16 each
    REQUIRE(distanceAt(sample, {0, 0, 0}) >= -1.f);
    REQUIRE(distanceAt(sample, {1, 1, 1}) > 0.2f);  // of 0.73
    REQUIRE(distanceAt(sample, {100, 0, 0}) == Approx(99).epsilon(0.01));
}

void checkNarrowBand(const MakeSampler& make) {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const Solid solid = sphereSolid(0.4);
    const auto [points, samples] = sampled(make(levelSetOf(solid, h, 1, 1)), randomPoints(random, 20000, 0.5));
    for (std::size_t i = 0; i < points.size(); ++i) {
        const double truth = solid.distance(glm::dvec3(points[i]));
        if (std::abs(truth) < h) continue;
        REQUIRE(std::signbit(samples[i].distance) == (truth < 0));
        if (!samples[i].inBand) REQUIRE(std::abs(samples[i].distance) <= std::abs(truth));
    }
}

void checkNowhere(const MakeSampler& make) {
    const Sampler sample = make(levelSetOf(sphereSolid(0.4), h));
    std::vector<glm::vec3> nowhere, farAway;
    for (int axis = 0; axis < 3; ++axis)
        for (const float bad : {notANumber, infinity, -infinity}) {
            nowhere.emplace_back(0);
            nowhere.back()[axis] = bad;
        }
    for (const Sample& s : sample(nowhere)) {
        REQUIRE(s.distance == infinity);
        REQUIRE_FALSE(s.inBand);
        REQUIRE(s.gradient == glm::vec3(0));
    }
    for (const float far : {1e9f, 1e20f, 3e38f})
        for (const float sign : {-1.f, 1.f}) farAway.emplace_back(sign * far, 0, far);
    const auto [points, samples] = sampled(sample, farAway);
    for (std::size_t i = 0; i < points.size(); ++i) {
        REQUIRE_FALSE(samples[i].inBand);
        REQUIRE(samples[i].distance > 0.9f * points[i].z);
    }
}

void checkFarFromOrigin(const MakeSampler& make) {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const glm::dvec3 centre(1e4, -1e4, 5e3);
    const Solid solid = sphereSolid(0.3, centre);
    std::vector<glm::vec3> around = randomPoints(random, 20000, 0.4);
    for (glm::vec3& p : around) p += glm::vec3(centre);  // rounded to a millimetre, and exact from here on
    const auto [points, samples] = sampled(make(levelSetOf(solid, 0.01)), around);
    int inBand = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
        if (!samples[i].inBand) continue;
        ++inBand;
        REQUIRE(std::abs(samples[i].distance - solid.distance(glm::dvec3(points[i]))) < 0.02 * 0.01);
    }
    REQUIRE(inBand > 1000);
}

void checkOtherLevelSets(const MakeSampler& make) {
    const auto grid = openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(0.4f, openvdb::Vec3f(0), float(h), 3.f);
    auto grids = std::make_shared<Grids>();
    grids->distance = grid;
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const auto check = [&](const LevelSet& levelSet, double margin) {
        const auto [points, samples] = sampled(make(levelSet), randomPoints(random, 20000, 0.5));
        for (std::size_t i = 0; i < points.size(); ++i)
            if (samples[i].inBand) REQUIRE(std::abs(samples[i].distance - (glm::length(points[i]) - 0.4)) < margin);
    };
    check(LevelSet(grids), 0.05 * h);
    check(built(shapes::sphere(0.4f, 5), float(h)), 0.5 * h);
}

}  // namespace bilayer::test
