// SPDX-License-Identifier: Apache-2.0
// A plot draws each point at the place of its values.
#include "demos/shared/plot.h"

#include <fmt/format.h>

#include <catch2/catch.hpp>
#include <fstream>
#include <iterator>
#include <regex>

#include "tests/support/support.h"

namespace bilayer::plot_test {
namespace {

std::vector<std::pair<double, double>> circles(const std::string& svg) {
    static const std::regex pattern(R"re(<circle cx="([0-9.]+)" cy="([0-9.]+)")re");
    std::vector<std::pair<double, double>> found;
    for (auto it = std::sregex_iterator(svg.begin(), svg.end(), pattern); it != std::sregex_iterator(); ++it)
        found.push_back({std::stod((*it)[1]), std::stod((*it)[2])});
    return found;
}

}  // namespace

TEST_CASE("equal ratios are equal distances in a plot") {
    const demo::Panel panel{"title", "x", "y", {}, {{"line, slope 1", {10, 100, 1000}, {0.02, 0.2, 2}}}};
    const std::string svg = demo::svg({panel, panel});
    const auto at = circles(svg);
    REQUIRE(at.size() == 6);
    CHECK(at[1].first - at[0].first == Approx(at[2].first - at[1].first).margin(0.11));
    CHECK(at[0].second - at[1].second == Approx(at[1].second - at[2].second).margin(0.11));
    CHECK(at[0].first < at[1].first);
    CHECK(at[0].second > at[1].second);  // pixels count downward
    for (const char* words : {">title<", ">line<", ">slope 1<", ">0.1<", ">100<"})
        CHECK(svg.find(words) != std::string::npos);
}

TEST_CASE("panels of a plot stand below each other") {
    const demo::Panel panel{"t", "x", "y", {}, {{"a", {1, 10}, {1, 10}}}};
    const std::string svg = demo::svg({panel, panel, panel});
    CHECK(svg.find("viewBox=\"0 0 620 1200\"") != std::string::npos);
    CHECK(svg.find("translate(0 400)") != std::string::npos);
    CHECK(svg.find("translate(0 800)") != std::string::npos);
}

TEST_CASE("a plot is written to a file, or the file is named") {
    const std::vector<demo::Panel> panels{{"t", "x", "y", {64, 128}, {{"a", {64, 128}, {1, 4}}}}};
    const auto path = test::scratch("plot.svg");
    demo::writeSvg(path, panels);
    CHECK(test::contentsOf(path) == demo::svg(panels));
    CHECK_THROWS_WITH(demo::writeSvg("/nonexistent/plot.svg", panels), Catch::Contains("/nonexistent/plot.svg"));
    CHECK_THROWS_AS(demo::svg({{"t", "x", "y", {}, {}}}), std::invalid_argument);
    CHECK_THROWS_AS(demo::svg({}), std::invalid_argument);
}

TEST_CASE("equal differences are equal distances in a linear plot, which starts at 0") {
    const demo::Panel panel{"t", "x", "y", {}, {{"a", {0, 1, 2}, {40, 60, 80}}}, true};
    const std::string svg = demo::svg({panel});
    const auto at = circles(svg);
    REQUIRE(at.size() == 3);
    CHECK(at[1].first - at[0].first == Approx(at[2].first - at[1].first).margin(0.11));
    CHECK(at[0].second - at[1].second == Approx(at[1].second - at[2].second).margin(0.11));
    // 0 is as far below 40 as 80 is above it
    CHECK(svg.find(fmt::format("y1=\"{:.1f}\"", 2 * at[0].second - at[2].second)) != std::string::npos);
    for (const char* tick : {">0<", ">20<", ">80<", ">0.5<"}) CHECK(svg.find(tick) != std::string::npos);
}
}  // namespace bilayer::plot_test
