// SPDX-License-Identifier: Apache-2.0
// The comparison of fields with the ground truth itself: it accepts exact fields, and notices each fault.
#include <oneapi/tbb/global_control.h>
#include <algorithm>
#include <catch2/catch.hpp>

#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "tests/support/support.h"
#include "tests/support/truth.h"
#include "tests/support/verdict.h"

namespace bilayer::verdict_test {
TEST_CASE("a field of true distances is judged exact, and each fault is detected") {
    const Mesh mesh = shapes::sphere(1, 2);
    const test::Truth truth(mesh);
    const float h = 0.1f;
    const auto grid = openvdb::FloatGrid::create(3 * h);
    grid->setTransform(openvdb::math::Transform::createLinearTransform(h));
    std::vector<openvdb::Coord> all = test::chooseVoxels(*grid, mesh, {3, 2}, 1000000, 1);
    const auto voxels = test::trueVoxels(truth, all, grid->voxelSize()[0]);
    auto values = grid->getAccessor();
    const auto inBand = [](double d) { return d < 3 && d > -2; };
    const auto valueOf = [&](double d) { return d >= 3 ? 3 * h : d <= -2 ? -2 * h : float(d) * h; };
    for (const auto& v : voxels) {
        if (inBand(v.distance))
            values.setValueOn(v.at, valueOf(v.distance));
        else
            values.setValueOff(v.at, valueOf(v.distance));
    }
    CHECK(test::judge(*grid, {3, 2}, voxels).exact());
    CHECK(test::judge(*grid, {3, 2}, voxels).checked == all.size());

    const auto faults = [&](double low, double high, auto spoil) {
        const auto found = std::find_if(voxels.begin(), voxels.end(), [&](const test::TrueVoxel& v) {
            return v.distance > low && v.distance < high;
        });
        REQUIRE(found != voxels.end());
        spoil(found->at, values.getValue(found->at));
        const test::Verdict verdict = test::judge(*grid, {3, 2}, voxels);
        CHECK_FALSE(verdict.exact());
        CHECK(verdict.witnesses.front().at == found->at);
        values.setValue(found->at, valueOf(found->distance));
        values.setActiveState(found->at, inBand(found->distance));
        return verdict;
    };
    const auto flip = [&](const openvdb::Coord& at, float value) { values.setValueOnly(at, -value); };
    CHECK(faults(1, 2, [&](auto at, float value) { values.setValue(at, value + 2e-4f * h); }).inexact == 1);
    CHECK(faults(-1, -0.5, flip).wrongFar == 1);
    CHECK(faults(0.001, 0.09, flip).wrong == 1);
    CHECK(faults(-4, -3, flip).wrongBackground == 1);
    CHECK(faults(2.5, 2.999, [&](auto at, float) { values.setActiveState(at, false); }).missing == 1);
    CHECK(faults(-2.5, -2.001, [&](auto at, float) { values.setActiveState(at, true); }).extra == 1);
}
}  // namespace bilayer::verdict_test
