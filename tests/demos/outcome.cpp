// SPDX-License-Identifier: Apache-2.0
// Tests the measures by which scenes are judged.
#include "demos/shared/outcome.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>

#include "demos/scenes/chain.h"
#include "demos/shared/shapes.h"
#include "demos/shared/stage.h"
#include "tests/support/support.h"

namespace bilayer::outcome_test {
TEST_CASE("a criterion is met up to its limit, and never by a NaN") {
    CHECK(demo::Criterion{"at", 1, 1}.met());
    CHECK_FALSE(demo::Criterion{"above", 1.001, 1}.met());
    CHECK_FALSE(demo::Criterion{"nowhere", std::numeric_limits<double>::quiet_NaN(), 1}.met());
    demo::Outcome outcome{demo::Recording("")};
    outcome.criteria = {{"one", 0, 1}, {"two", 2, 1}};
    CHECK_FALSE(outcome.met());
    CHECK(outcome.criterion("two").value == 2);
    CHECK_THROWS_AS(outcome.criterion("three"), std::out_of_range);
}

TEST_CASE("of two values the worse is the greater, and NaN the worst") {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    CHECK(demo::worse(1, 2) == 2);
    CHECK(demo::worse(2, 1) == 2);
    CHECK(std::isnan(demo::worse(nan, 1)));
    CHECK(std::isnan(demo::worse(1, nan)));
}

TEST_CASE("percentiles are of the nearest rank") {
    CHECK(demo::percentile({}, 0.5) == 0);
    CHECK(demo::percentile({3, 1, 2}, 0.5) == 2);
    std::vector<double> hundred;
    for (int i = 100; i > 0; --i) hundred.push_back(i);
    CHECK(demo::percentile(hundred, 0.99) == 99);
    CHECK(demo::percentile(hundred, 1) == 100);
    CHECK(demo::percentile(hundred, 0) == 1);
}

TEST_CASE("energy rises by the most that it climbs above what it once was") {
    CHECK(demo::Energies{{0, 4, 8}, {10, 6, 2}}.rise() == 0);
    CHECK(demo::Energies{{8, 2, 4, 3, 5}, {0, 0, 0, 0, 0}}.rise() == Approx(3.0 / 8));
    CHECK(demo::Energies{{0, 0}, {0, 0}}.rise() == 0);
    CHECK(std::isnan(demo::Energies{{1, std::nan("")}, {0, 0}}.rise()));
}

TEST_CASE("a stage reports what a falling body does, and how deep bodies overlap") {
    const auto ball = demo::makePrototype(shapes::sphere(0.1f, 4), {0.01f});
    const auto play = [&](float offset) {
        demo::Stage stage("fall", {.stepsPerSecond = 100, .stepsPerFrame = 10});
        stage.add(ball, {.mass = 2, .linearDamping = 0, .angularDamping = 0}, {{0, 0, 5}}, {});
        // two bodies that overlap permanently, and a moving one that overlaps one of them
        stage.add(ball, {}, {{0, 0, 0}}, {});
        stage.add(ball, {}, {{0.15f, 0, 0}}, {});
        stage.add(ball, {.mass = 1}, {{3 + offset, 0, 0}}, {});
        stage.run(0.5);
        CHECK(stage.time() == Approx(0.5));
        return stage.finish({});
    };
    const demo::Outcome outcome = play(0);
    CHECK(outcome.bodies == 2);
    CHECK(outcome.stepMs.size() == 50);
    CHECK(outcome.penetrations.empty());
    REQUIRE(outcome.energies.kinetic.size() == 51);
    // v = g t; the second ball's share is 1 of 3 kg, minus the loss by drag
    CHECK(outcome.energies.kinetic.back() == Approx(0.5 * 3 * 4.905 * 4.905).epsilon(0.03));
    CHECK(outcome.energies.potential.front() == Approx(2 * 9.81 * 5).epsilon(1e-5));
    CHECK(outcome.energies.rise() < 1e-6);
    CHECK(play(0).fingerprint == outcome.fingerprint);
    CHECK(play(1e-6f).fingerprint != outcome.fingerprint);

    demo::Stage overlap("overlap", {.stepsPerFrame = 1});
    overlap.add(ball, {}, {}, {});
    overlap.add(ball, {.mass = 1}, {{0.15f, 0, 0}}, {}).setGravity({0, 0, 0});
    overlap.step();
    CHECK(overlap.finish({}).deepest() == Approx(0.05).epsilon(0.03));
}

TEST_CASE("the linking number of circles is that of Gauss") {
    const auto linking = [](const Pose& a, const Pose& b) { return demo::gaussLinkingNumber(a, 1, b, 1); };
    const glm::quat upright = glm::angleAxis(1.5707963f, glm::vec3(1, 0, 0));
    const Pose flat{};
    CHECK(std::abs(linking(flat, {{1, 0, 0}, upright})) == Approx(1).margin(1e-6));
    CHECK(std::abs(linking(flat, {{1.85f, 0, 0}, upright})) == Approx(1).margin(1e-3));
    CHECK(linking(flat, {{2.15f, 0, 0}, upright}) == Approx(0).margin(1e-3));
    CHECK(linking(flat, {{0, 0, 0.5f}}) == Approx(0).margin(1e-6));
    // upside down it runs the other way
    const glm::quat over = glm::angleAxis(-1.5707963f, glm::vec3(1, 0, 0));
    CHECK(linking(flat, {{1, 0, 0}, upright}) == Approx(-linking(flat, {{1, 0, 0}, over})));
}

TEST_CASE("an outcome is written as a recording, a table of energies and fields") {
    demo::Stage stage("a ball");
    const auto ball = demo::makePrototype(shapes::sphere(0.1f, 3), {0.02f});
    stage.add(ball, {.mass = 1}, {}, {});
    stage.run(0.1);
    demo::Outcome outcome = stage.finish({});
    outcome.fields.emplace_back("ball", ball->field);
    const auto folder = test::scratch("outcome");
    demo::write(outcome, "fall", folder);
    CHECK(std::filesystem::file_size(folder / "fall.html") > 500'000);
    CHECK(std::filesystem::file_size(folder / "ball.vdb") > 1000);
    std::ifstream table(folder / "fall.csv");
    int lines = 0;
    for (std::string line; std::getline(table, line);) ++lines;
    CHECK(lines == 1 + 25);
}
}  // namespace bilayer::outcome_test
