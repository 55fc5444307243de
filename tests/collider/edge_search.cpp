// SPDX-License-Identifier: Apache-2.0
// The deepest point of an edge.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <optional>
#include <random>

#include "collider/contact/search/edge_search.h"
#include "tests/support/support.h"

namespace bilayer::edge_search_test {
using namespace bilayer::detail;
using namespace bilayer::test;

TEST_CASE("The minimum between two points is found at kinks and on parabolas") {
    const float lowest = GENERATE(0.13f, 0.5f, 0.91f);
    const auto kink = [&](float x) {
        return x < lowest ? ValueAndSlope{x, 0.7f * (lowest - x), -0.7f} : ValueAndSlope{x, x - lowest, 1};
    };
    const auto parabola = [&](float x) { return ValueAndSlope{x, (x - lowest) * (x - lowest), 2 * (x - lowest)}; };
    int asked = 0;
    const auto search = [&](auto&& function) {
        asked = 0;
        const auto at = [&](float x) { return ++asked, std::optional(function(x)); };
        return minimumBetween(function(0), function(1), 1e-4f, at);
    };
    const auto atKink = search(kink);
    REQUIRE(atKink);
    CHECK(atKink->place == Approx(lowest).margin(1e-3));
    CHECK(asked <= 2);
    const auto onParabola = search(parabola);
    REQUIRE(onParabola);
    CHECK(onParabola->place == Approx(lowest).margin(6e-3));
    CHECK(asked <= 3);
    CHECK_FALSE(minimumBetween(kink(0), kink(1), 1e-4f, [](float) { return std::optional<ValueAndSlope>(); }));
}

TEST_CASE("An edge below two faces has the depth of the minimum translation over the ridge between them") {
    const unsigned start = seed();
    CAPTURE(start);
    std::mt19937 random(start);
    std::normal_distribution<float> normal;
    const auto direction = [&] { return glm::normalize(glm::vec3(normal(random), normal(random), normal(random))); };
    int tried = 0;
    while (tried < 1000) {
        const glm::vec3 along = direction(), before = direction(), after = direction();
        const float fall = -glm::dot(before, along), rise = glm::dot(after, along);
        if (fall < 0.1f || rise < 0.1f || fall > 0.9f || rise > 0.9f || glm::dot(before, after) < -0.9f) continue;
        ++tried;
        const auto found = acrossEdge(along, {-1, before}, SurfaceSample{-1, before}, SurfaceSample{-1, after});
        REQUIRE(found);
        // reference by sampling: depenetration directions all around the edge. Displaced by s, the edge's line leaves
        // either face where it meets the other
        const glm::vec3 lateral = glm::normalize(glm::cross(along, before)), up = glm::cross(lateral, along);
        float least = 100;
        for (int k = 0; k < 3600; ++k) {
            const float angle = glm::two_pi<float>() * float(k) / 3600;
            const glm::vec3 push = std::cos(angle) * up + std::sin(angle) * lateral;
            // before * (s push + t along) = after * (s push + t along) = 1
            const float s = (fall + rise) / (glm::dot(before, push) * rise + glm::dot(after, push) * fall);
            if (s > 0) least = std::min(least, s);
        }
        CHECK(-found->distance == Approx(std::min(least, 1.5f)).epsilon(1e-4));
        CHECK(glm::dot(found->normal, along) == Approx(0).margin(1e-5));
    }
}
}  // namespace bilayer::edge_search_test
