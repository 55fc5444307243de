// SPDX-License-Identifier: Apache-2.0
// The number of threads of a build.
#include <bilayer/sdf/build.h>

#include <oneapi/tbb/global_control.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <fstream>

#include <bilayer/sdf/grids.h>
#include "demos/shared/shapes.h"
#include "tests/sdf/unsigned_band.h"
#include "tests/support/support.h"

namespace bilayer::threads_test {
TEST_CASE("the bytes do not depend on the number of threads") {
    const Mesh mesh = shapes::torusKnot(2, 3, 1, 0.2f);
    BuildOptions options{.voxelSize = voxelSizeFor(mesh, 150), .threads = 1};
    const LevelSet one = build(mesh, options);
    for (const int threads : {2, 3, 8, 0}) {
        options.threads = threads;
        CAPTURE(threads);
        CHECK(test::sameBytes(*one.grids().distance, *build(mesh, options).grids().distance));
    }
}

TEST_CASE("a build limits its own threads only") {
    const auto allowed = [] { return tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism); };
    const std::size_t before = allowed();
    std::size_t during = 0;
    build(shapes::sphere(1, 2), {.voxelSize = 0.1f, .threads = 1, .progress = [&](double) {
                                     during = allowed();
                                     return true;
                                 }});
    CHECK(during == before);
}

TEST_CASE("many builds on a given number of threads take no more memory than a few") {
    if (test::isSanitized()) return;
    const auto residentBytes = [] {
        std::size_t all = 0, resident = 0;
        std::ifstream("/proc/self/statm") >> all >> resident;
        return double(resident) * double(sysconf(_SC_PAGESIZE));
    };
    const Mesh mesh = shapes::sphere(1, 1);
    const auto buildSome = [&](int count) {
        for (int i = 0; i < count; ++i) build(mesh, {.voxelSize = 0.5f, .threads = 2});
    };
    buildSome(300);
    const double before = residentBytes();
    buildSome(1000);
    CHECK(residentBytes() - before < 3e6);
}
}  // namespace bilayer::threads_test
