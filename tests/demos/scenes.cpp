// SPDX-License-Identifier: Apache-2.0
// Each scene at small size. Criteria that the library does not meet yet are listed by name, with their value at the
// time of writing. A listed criterion that is met fails the test, so that it is removed from the list.
#include <catch2/catch.hpp>
#include <functional>
#include <set>
#include <string>

#include "demos/scenes/bowl.h"
#include "demos/scenes/chain.h"
#include "demos/scenes/enright.h"
#include "demos/scenes/gears.h"
#include "demos/scenes/incline.h"
#include "demos/scenes/liquid.h"
#include "demos/scenes/nuts.h"
#include "demos/scenes/pairs.h"
#include "demos/scenes/pegs.h"
#include "demos/scenes/plates.h"
#include "demos/scenes/rings.h"
#include "demos/scenes/spin.h"
#include "demos/scenes/terrain.h"
#include "demos/shared/shapes.h"
#include "demos/shared/stage.h"
#include "tests/support/support.h"

namespace bilayer::scenes_test {
using demo::Outcome;

namespace {

// Checks every criterion of a scene. Other tests cover its thread count and determinism.
void judgeOnce(const Outcome& outcome) {
    for (const demo::Criterion& criterion : outcome.criteria) {
        CAPTURE(outcome.title, criterion.name, criterion.value, criterion.limit, criterion.unit);
        CHECK(criterion.met());
    }
}

// Checks every criterion except the known failures, and that the result is bitwise the same for any count of threads.
void judge(const std::function<Outcome()>& scene, const std::set<std::string>& missed = {}) {
    Outcome outcome = scene();
    outcome.criteria.push_back(demo::sameBits(outcome, scene));
    std::set<std::string> unmet;
    for (const demo::Criterion& criterion : outcome.criteria) {
        CAPTURE(criterion.name, criterion.value, criterion.limit, criterion.unit);
        if (!missed.contains(criterion.name)) {
            CHECK(criterion.met());
        } else if (criterion.met()) {
            FAIL_CHECK("met: remove it from the list of those known as missed");
        } else {
            WARN(outcome.title << ": " << criterion.name << " " << criterion.value << " " << criterion.unit
                               << ", at most " << criterion.limit);
        }
    }
    for (const std::string& name : missed) CHECK_NOTHROW(outcome.criterion(name));
}

}  // namespace

TEST_CASE("blocks stick and slide on an incline as friction says") {
    demo::InclineOptions options;
    options.slopes = {40};
    options.frictions = {0, 0.25f, 0.975f, 1.025f};
    options.seconds = 1.25f;  // by then the fastest move more than a voxel per step
    judge([&] { return demo::incline(options); });
}

TEST_CASE("blocks and nuts for which theory makes no prediction meet no criterion") {
    demo::InclineOptions blocks;
    blocks.slopes = {20};
    blocks.frictions = {1};
    blocks.seconds = 0.2f;
    CHECK_FALSE(demo::incline(blocks).criteria.front().met());
    demo::NutsOptions pair;
    pair.pairs = 1;
    pair.frictions = {0.035f};
    pair.seconds = 0.2f;
    pair.stepsPerSecond = 240;
    pair.voxelSize = 0.4e-3f;
    CHECK_FALSE(demo::nuts(pair).criteria.front().met());
}

TEST_CASE("bodies keep their speed over waves of triangles") {
    demo::TerrainOptions options;
    options.seconds = 1.5f;
    options.heightField = GENERATE(false, true);
    SECTION("low waves, where edges are least seen") {
        options.height = GENERATE(0.003f, 0.01f);
        options.stepsPerSecond = GENERATE(60.f, 240.f);
        judgeOnce(demo::terrain(options));
    }
    SECTION("high waves of small triangles") {
        options.height = 0.03f;
        options.cell = 0.1f;
        judgeOnce(demo::terrain(options));
    }
    SECTION("high waves of large triangles") {
        options.height = 0.1f;
        options.cell = GENERATE(0.3f, 0.6f);
        judgeOnce(demo::terrain(options));
    }
    SECTION("bodies that roll") {
        options.rolls = true;
        options.height = GENERATE(0.f, 0.01f, 0.1f);
        judgeOnce(demo::terrain(options));
    }
    SECTION("large triangles") {
        options.height = 0.02f;
        options.cell = 2.4f;
        judge([&] { return demo::terrain(options); });
    }
}

TEST_CASE("rings stay on their pole and come to rest") {
    demo::RingsOptions options;
    options.rows = 1;
    options.ringsPerPole = 4;
    options.seconds = 4;
    options.voxelSize = 0.01f;
    judge([&] { return demo::rings(options); });
}

TEST_CASE("a chain keeps its links and its length") {
    demo::ChainOptions options;
    options.links = 6;
    options.seconds = 1;
    judge([&] { return demo::chain(options); });
}

TEST_CASE("knots in a bowl come to rest") {
    demo::BowlOptions options;
    options.kinds = {{"knot", shapes::torusKnot(2, 3, 0.06f, 0.02f, 150, 16)}};
    options.bodies = 4;
    options.resolution = 32;
    options.seconds = 6;
    options.hold = 2;
    judge([&] { return demo::bowl(options); });
}

TEST_CASE("however many bodies fall into a bowl, none starts in another") {
    demo::BowlOptions options;
    // it rotates about its centre, wherever its origin is
    const Mesh cube = shapes::moved(shapes::box({0.1f, 0.1f, 0.1f}), {0.3f, 0, 0});
    options.kinds = {{"knot", shapes::torusKnot(2, 3, 0.06f, 0.02f, 60, 8)}};
    if (GENERATE(false, true)) options.kinds.push_back({"cube", cube});
    options.bodies = GENERATE(30, 50, 200, 500);
    options.resolution = 16;
    options.seconds = 0.01f;
    CAPTURE(options.bodies);
    const demo::Outcome outcome = demo::bowl(options);
    CHECK(outcome.bodies == options.bodies);
    CHECK(outcome.deepest() < outcome.voxelSize);
}

TEST_CASE("needles in a bowl gain no energy where nothing but continuous collision holds them") {
    demo::BowlOptions options;
    options.kinds = {{"needle", shapes::cone(0.02f, 0.2f, 12)}};
    options.bodies = 8;
    options.resolution = 48;
    options.seconds = 3;
    options.seed = GENERATE(7u, 8u);
    const demo::Outcome outcome = demo::bowl(options);
    CHECK(outcome.energies.rise() < 0.01);
    CHECK(outcome.criterion("bodies that left the bowl").met());
}

TEST_CASE("balls stay in front of thin plates") {
    demo::PlatesOptions options;
    options.phases = 2;
    judge([&] { return demo::plates(options); });
}

TEST_CASE("a free body keeps its angular momentum and turns over") {
    demo::SpinOptions options;
    options.seconds = 20;
    judge([&] { return demo::spin(options); });
}

TEST_CASE("nuts run down their bolts by their pitch, or are held by friction") {
    demo::NutsOptions options;
    options.pairs = 2;
    options.frictions = {0, 0.05f};
    options.turns = 1;
    options.stepsPerSecond = 240;
    options.voxelSize = 0.4e-3f;
    judge([&] { return demo::nuts(options); });
}

TEST_CASE("nuts under ten times their weight run and stay as they should") {
    demo::NutsOptions options;
    options.pairs = 2;
    options.frictions = {0.01f, 0.05f};
    options.turns = 1;
    options.stepsPerSecond = 600;
    options.voxelSize = 0.4e-3f;
    const Outcome slow = demo::nuts(options);
    options.weights = 10;
    const Outcome outcome = demo::nuts(options);
    CHECK(outcome.stepMs.size() < slow.stepMs.size() / 2);
    // they hop within their play, which changes the advance of a rotation by as much
    for (const char* name :
         {"nuts that should run and stuck", "unevenness of angular speed", "rotation of nuts that should stay",
          "displacement of nuts that should stay", "deepest penetration"}) {
        CAPTURE(name, outcome.criterion(name).value);
        CHECK(outcome.criterion(name).met());
    }
}

TEST_CASE("the nut of Factory runs down its bolt by its pitch, or is held by friction") {
    const auto path = test::corpusMesh("factory_bolt_m16_loose.obj");
    if (!path) return;
    demo::NutsOptions options;
    options.pairs = 2;
    options.frictions = {0, 0.1f};
    options.turns = 1;
    options.voxelSize = 0.4e-3f;
    options.factory = path->parent_path();
    REQUIRE(demo::hasFactoryThread(options.factory));
    CHECK(!demo::hasFactoryThread(options.factory / "formats"));
    judgeOnce(demo::nuts(options));
}

TEST_CASE("the gears of Factory keep their ratio") {
    const auto path = test::corpusMesh("factory_gear_medium.ply");
    if (!path) return;
    demo::GearsOptions options;
    options.turns = 0.25f;
    options.stepsPerSecond = 240;
    options.voxelSize = 0.4e-3f;
    options.factory = path->parent_path();
    judgeOnce(demo::gears(options));
}

TEST_CASE("the peg of Factory goes through its plate") {
    const auto path = test::corpusMesh("factory_round_peg_8mm_tight.obj");
    if (!path) return;
    demo::PegsOptions options;
    options.clearances = {};
    options.seconds = 0.4f;
    options.voxelSize = 0.4e-3f;
    options.factory = path->parent_path();
    judgeOnce(demo::pegs(options));
}

TEST_CASE("gears keep their ratio") {
    demo::GearsOptions options;
    options.teeth = {18, 24};
    options.turns = 0.5f;
    options.stepsPerSecond = 240;
    judge([&] { return demo::gears(options); });
}

TEST_CASE("pegs find their way into narrow holes") {
    demo::PegsOptions options;
    options.clearances = {0.1e-3f};
    options.seconds = 0.5f;
    options.voxelSize = 0.4e-3f;
    judge([&] { return demo::pegs(options); });
}

TEST_CASE("bodies lie on each other at their height, at any scale") {
    demo::PairsOptions options;
    options.scale = GENERATE(0.01f, 100.f);
    options.every = 41;
    options.seconds = options.scale > 1 ? 2.f : 0.5f;  // from 0.2 voxels
    CAPTURE(options.scale);
    judge([&] { return demo::pairs(options); });
}

TEST_CASE("a liquid bunny keeps its volume and stays out of the knot") {
    demo::LiquidOptions options;
    options.resolution = 32;
    options.seconds = 0.7f;  // it has hit the knot, and the volume lost by that is restored
    options.turns = 1;
    options.framesPerSecond = 10;
    const Outcome outcome = demo::liquid(options);
    judgeOnce(outcome);
    CHECK(outcome.table.rows.size() == 8);
    // without restoration the loss is measurable
    options.restoring = 0;
    CHECK_FALSE(demo::liquid(options).criterion("volume off in the end").met());
}

TEST_CASE("bodies in Enright's deformation flow lose no more volume than OpenVDB's own") {
    demo::EnrightOptions options;
    options.resolution = 32;
    options.framesPerSecond = 4;
    const Outcome outcome = demo::enright(options);
    judgeOnce(outcome);
    const std::vector<double>&start = outcome.table.rows[0], &stretched = outcome.table.rows[2];  // after half a second
    for (const std::size_t body : {1, 3}) {
        const double ours = stretched[body] / start[body], theirs = stretched[body + 1] / start[body + 1];
        CAPTURE(body);
        CHECK(ours == Approx(theirs).margin(0.03));
        if (body == 3 && demo::bunny().name != "bunny") {
            WARN("skipped: the bunny of Debian's package glmark2-data; at 32 voxels nothing is left of a knot");
            continue;
        }
        CHECK(ours > 0.15);  // the sphere has 0.80 by then, the bunny 0.21
        CHECK(ours < 0.9);
    }
}
}  // namespace bilayer::scenes_test
