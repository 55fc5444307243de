// SPDX-License-Identifier: Apache-2.0
// Summaries of the benchmarks must follow from their measurements.
#include "bench/measure.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <mutex>
#include <thread>

#include "demos/shared/shapes.h"

namespace bilayer::measure_test {
using namespace bilayer::bench;

TEST_CASE("medians, geometric means and slopes") {
    CHECK(median({3, 1, 2}) == 2);
    CHECK(median({4, 1, 3, 2}) == 2.5);
    CHECK(std::isnan(median({})));
    CHECK(geometricMean({2, 8}) == Approx(4));
    CHECK(std::isnan(geometricMean({})));
    CHECK(logSlope({1, 10, 100}, {5, 500, 50000}) == Approx(2));
    CHECK(logSlope({1, 2}, {7, 7}) == Approx(0).margin(1e-12));
    CHECK(std::isnan(logSlope({1}, {1})));
}

TEST_CASE("a build in a child process reports what it took there") {
    const auto make = [] { return scene("ball", shapes::sphere(1, 4), 96); };
    const Footprint footprint = inChild(make, {Builder::reference, 3, 1}, 3, 10);
    CHECK(footprint.outcome.seconds > 0);
    // a shell of radius 48 voxels, six voxels thick
    CHECK(double(footprint.outcome.activeVoxels) == Approx(4 * 3.1416 * 48 * 48 * 6).epsilon(0.02));
    CHECK(footprint.inputBytes == 12 * (5120 + 2562));
    CHECK(footprint.peakBytes > footprint.outcome.bytes / 2);
    CHECK(footprint.peakBytes < 500'000'000);
}

TEST_CASE("what fails in a child process is said by its parent") {
    const auto make = []() -> Scene { throw std::runtime_error("no such ball"); };
    CHECK_THROWS_WITH(inChild(make, {}), Catch::Contains("no such ball"));
}

TEST_CASE("a process with threads of its own is not forked") {
    std::mutex mutex;
    std::unique_lock lock(mutex);
    std::thread other([&] { const std::lock_guard wait(mutex); });
    CHECK_THROWS_AS(inChild([] { return scene("ball", shapes::sphere(1, 1), 8); }, {}), std::logic_error);
    lock.unlock();
    other.join();
}

TEST_CASE("builders and meshes are found by name") {
    for (const Builder builder : builders()) CHECK(builderNamed(nameOf(builder)) == builder);
    CHECK_THROWS_AS(builderNamed("fastest"), std::invalid_argument);
    CHECK(findSource("carved box").file.empty());
    CHECK_THROWS_AS(findSource("no such mesh"), std::invalid_argument);
}

TEST_CASE("fields differ where their meshes do") {
    const Scene ball = scene("ball", shapes::sphere(1, 3), 32);
    const LevelSet one = fieldOf(ball, {}), narrow = fieldOf(ball, {.halfWidth = 2});
    const Difference none = difference(one, one), width = difference(one, narrow);
    CHECK((none.voxels == 0 && none.signs == 0 && none.distance == 0));
    CHECK(width.voxels == one.activeVoxels() - narrow.activeVoxels());
    CHECK(difference(narrow, one).voxels == width.voxels);
    CHECK(width.signs == 0);

    // shifted by half a voxel: distances on the axis differ by as much, voxels around the equator change sign
    Scene moved = ball;
    for (glm::vec3& point : moved.mesh.points) point.x += moved.voxelSize / 2;
    const Difference shifted = difference(one, fieldOf(moved, {}));
    CHECK(shifted.distance == Approx(0.5f).margin(0.02));
    CHECK(shifted.signs > 100);
    CHECK(shifted.voxels > 100);
}
}  // namespace bilayer::measure_test
