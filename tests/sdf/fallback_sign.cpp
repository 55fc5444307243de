// SPDX-License-Identifier: Apache-2.0
// The fallback sign test of a point, against solid angles summed in double precision.
#include "sdf/sign/fallback_sign.h"

#include <catch2/catch.hpp>
#include <random>

#include "demos/shared/shapes.h"
#include "sdf/base/progress.h"
#include "tests/support/support.h"

namespace bilayer::fallback_sign_test {
using namespace bilayer::detail;

namespace {

// Points on a lattice, where rays meet edges and vertices, and in between.
void checkSides(const Mesh& mesh, unsigned seed) {
    const std::function<bool(float)> noListener;
    Progress progress(noListener);
    std::atomic<std::size_t> asked = 0;
    const MeshJob job{mesh, 0.1f, 3, false, true, [](const FilledBlocks&) {}, progress, {}, &asked};
    FallbackSign fallbackSign(job);
    std::mt19937 random(seed);
    const Bounds box = bounds(mesh);
    std::size_t inside = 0, wrong = 0, count = 0;
    for (int i = 0; i < 400; ++i) {
        glm::dvec3 p;
        for (int axis = 0; axis < 3; ++axis) {
            const double part = double(random() % 4096) / 4096;
            p[axis] = double(box.lower[axis]) + (1.2 * part - 0.1) * double(box.size()[axis]);
            if (i % 2) p[axis] = std::round(p[axis] * 4) / 4;
        }
        if (test::distance(mesh, p) < 1e-6) continue;
        const bool truth = test::windingNumber(mesh, p) > 0.5;
        wrong += fallbackSign.isInside(p) != truth;
        inside += truth;
        ++count;
    }
    CHECK(wrong == 0);
    CHECK(inside > count / 50);
    CHECK(asked == count);
}

}  // namespace

TEST_CASE("the fallback sign test finds the side of every point") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    const Mesh box = shapes::box({1, 1, 1}, 4), knot = shapes::torusKnot(2, 3, 1, 0.3f, 100, 12);
    Mesh moved = box;
    for (glm::vec3& p : moved.points) p += glm::vec3(0.5f, 0.25f, 0.75f);
    SECTION("closed") {
        checkSides(box, seed);
        checkSides(knot, seed);
    }
    SECTION("through itself") {
        checkSides(shapes::join({box, moved, knot}), seed);
    }
    SECTION("open") {
        Mesh open = knot;
        open.triangles.resize(open.triangles.size() - 40);
        checkSides(open, seed);
    }
}
}  // namespace bilayer::fallback_sign_test
