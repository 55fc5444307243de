// SPDX-License-Identifier: Apache-2.0
// The distance of two triangles, one by one and in SIMD lanes, against brute force.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tests/collider/triangle_distance.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <span>
#include <vector>

#include "collider/contact/distance/triangle_distance.h"
#include "collider/contact/distance/triangle_distance_lanes.h"
#include "tests/collider/surface_distance.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace {

// The squared distances of a triangle to others, all in the same lanes as the search uses.
std::vector<double> distances2(const TriangleCorners& one, std::span<const TriangleCorners> others) {
    using D = hn::CappedTag<double, 8>;
    const D tag;
    const CornerLanes<D> same(sameInAll(tag, one[0]), sameInAll(tag, one[1]), sameInAll(tag, one[2]));
    std::vector<double> found;
    for (std::size_t i = 0; i < others.size(); i += hn::Lanes(tag)) {
        alignas(64) double lanes[3][3][8], answers[8];
        const std::size_t used = std::min(hn::Lanes(tag), others.size() - i);
        for (std::size_t lane = 0; lane < hn::Lanes(tag); ++lane)
            for (std::size_t k = 0; k < 3; ++k)
                for (int axis = 0; axis < 3; ++axis)
                    lanes[k][axis][lane] = others[i + std::min(lane, used - 1)][k][axis];
        const CornerLanes<D> all(loadLanes(tag, lanes[0], 0), loadLanes(tag, lanes[1], 0), loadLanes(tag, lanes[2], 0));
        hn::Store(triangleDistance2(tag, same, all), tag, answers);
        found.insert(found.end(), answers, answers + used);
    }
    return found;
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
using namespace bilayer::detail;
using namespace bilayer::test;

namespace bilayer::detail {
HWY_EXPORT(distances2);
}

namespace {

// Largest error of a squared distance of triangles in a cube of side 2: some hundred roundings of its squared diagonal.
constexpr double rounding = 1e-13;

glm::dvec3 pointOf(Random& random) {
    return glm::dvec3(random.point(1));
}

TriangleCorners anyTriangle(Random& random) {
    return {pointOf(random), pointOf(random), pointOf(random)};
}

// A triangle whose first edge makes a small angle with that of another one.
TriangleCorners nearlyParallel(const TriangleCorners& other, double angle, Random& random) {
    const glm::dvec3 from = pointOf(random), edge = random(-1, 1) * (other[1] - other[0]);
    return {from, from + edge + angle * pointOf(random), pointOf(random)};
}

// A triangle whose first edge passes over that of another one at a small angle: both are closest in their middles.
TriangleCorners crossingAbove(const TriangleCorners& other, double angle, Random& random) {
    const glm::dvec3 edge = other[1] - other[0], middle = 0.5 * (other[0] + other[1]);
    const glm::dvec3 up = glm::normalize(glm::cross(edge, pointOf(random))),
                     half = 0.5 * edge + angle * glm::cross(up, edge), over = middle + 0.1 * up;
    return {over - half, over + half, over + up + pointOf(random)};
}

// A triangle that shares a corner, an edge, or a point within its face with another one.
TriangleCorners touching(const TriangleCorners& other, int kind, Random& random) {
    TriangleCorners made = anyTriangle(random);
    made[0] = other[0];
    if (kind == 1) made[1] = other[1];
    if (kind == 2) made[0] = 0.25 * other[0] + 0.5 * other[1] + 0.25 * other[2];
    return made;
}

// A segment or a point as a triangle, with corners in any order.
TriangleCorners degenerate(Random& random, int kind) {
    const glm::dvec3 a = pointOf(random), b = kind == 0 ? a : pointOf(random);
    if (kind == 1) return {a, b, b};
    if (kind == 2) return {b, a, b};
    return {a, b, a + 0.375 * (b - a)};
}

// A triangle on a coarse lattice, to the bit in one plane with others of the same plane.
TriangleCorners onLattice(Random& random, double height) {
    const auto corner = [&] {
        return glm::dvec3(std::round(random(-4, 4)) / 4, std::round(random(-4, 4)) / 4, height);
    };
    return {corner(), corner(), corner()};
}

// A triangle with one corner next to the opposite edge, or two corners next to each other.
TriangleCorners sliver(Random& random, double width) {
    const glm::dvec3 a = pointOf(random), b = pointOf(random);
    const double part = random(0, 1) < 0.5 ? 1 : random(0, 1);
    return {a, b, a + part * (b - a) + width * pointOf(random)};
}

void checkPoints(const TrianglePair& pair, const TriangleCorners& a, const TriangleCorners& b) {
    const glm::dvec3 between = pair.a.position - pair.b.position;
    REQUIRE(std::abs(glm::dot(between, between) - pair.distance2) <= rounding);
    REQUIRE(squaredDistance(pair.a.position, a[0], a[1], a[2]) <= rounding);
    REQUIRE(squaredDistance(pair.b.position, b[0], b[1], b[2]) <= rounding);
}

// Compares both with brute force, for one triangle and others. Returns how many of the distances are zero.
int check(const TriangleCorners& one, const std::vector<TriangleCorners>& others) {
    const std::vector<double> inLanes = HWY_DYNAMIC_DISPATCH(distances2)(one, others);
    int zeros = 0;
    for (std::size_t i = 0; i < others.size(); ++i) {
        const double truth = triangleDistance2(one, others[i]);
        CAPTURE(i, truth);
        const TrianglePair pair = closestPoints(one, others[i]);
        REQUIRE(std::abs(pair.distance2 - truth) <= rounding);
        REQUIRE(std::abs(inLanes[i] - pair.distance2) <= rounding);
        checkPoints(pair, one, others[i]);
        zeros += truth <= rounding;
    }
    return zeros;
}

}  // namespace

TEST_CASE("Distances of random triangles are those of brute force, one by one and in lanes") {
    const unsigned start = seed();
    CAPTURE(start);
    Random random(start);
    int crossing = 0;
    for (int round = 0; round < 300; ++round) {
        std::vector<TriangleCorners> others(13);
        for (TriangleCorners& other : others) other = anyTriangle(random);
        crossing += check(anyTriangle(random), others);
    }
    CHECK(crossing > 100);
}

TEST_CASE("Triangles that touch have the distance zero") {
    const unsigned start = seed();
    CAPTURE(start);
    Random random(start);
    for (int round = 0; round < 300; ++round) {
        const TriangleCorners one = anyTriangle(random);
        std::vector<TriangleCorners> others;
        for (int i = 0; i < 9; ++i) others.push_back(touching(one, i % 3, random));
        REQUIRE(check(one, others) == 9);
    }
}

TEST_CASE("Edges that are parallel, or off by any small angle, have the distance of brute force") {
    const unsigned start = seed();
    CAPTURE(start);
    Random random(start);
    for (int round = 0; round < 300; ++round) {
        const TriangleCorners one = anyTriangle(random);
        std::vector<TriangleCorners> others;
        for (const double angle : {0.0, 1e-15, 1e-12, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-4}) {
            others.push_back(nearlyParallel(one, angle, random));
            others.push_back(crossingAbove(one, angle, random));
        }
        const glm::dvec3 shift = pointOf(random);
        others.push_back({one[0] + shift, one[1] + shift, one[2] + shift});
        check(one, others);
    }
}

TEST_CASE("Triangles in one plane, or in parallel ones, have the distance of brute force") {
    const unsigned start = seed();
    CAPTURE(start);
    Random random(start);
    for (int round = 0; round < 300; ++round) {
        std::vector<TriangleCorners> others;
        for (int i = 0; i < 13; ++i) others.push_back(onLattice(random, i % 2 == 0 ? 0 : 0.25));
        check(onLattice(random, 0), others);
    }
}

TEST_CASE("Slivers of any width have the distance of brute force") {
    const unsigned start = seed();
    CAPTURE(start);
    Random random(start);
    for (int round = 0; round < 300; ++round) {
        std::vector<TriangleCorners> others;
        for (const double width : {1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14, 1e-16}) {
            others.push_back(sliver(random, width));
            const glm::dvec3 toOther = 0.5 * pointOf(random);
            others.push_back({others.back()[0] + toOther, others.back()[1] + toOther, others.back()[2] - toOther});
        }
        check(anyTriangle(random), others);
        check(sliver(random, std::pow(10, random(-16, -2))), others);
    }
}

TEST_CASE("Triangles without area are segments and points") {
    const unsigned start = seed();
    CAPTURE(start);
    Random random(start);
    for (int round = 0; round < 300; ++round) {
        std::vector<TriangleCorners> others;
        for (int i = 0; i < 8; ++i) others.push_back(degenerate(random, i % 4));
        check(anyTriangle(random), others);
        check(degenerate(random, round % 4), others);
        // two segments that are parallel: the ends decide
        const TriangleCorners segment = degenerate(random, 1);
        const glm::dvec3 away = pointOf(random);
        check(segment, {{segment[1] + away, segment[0] + away, segment[0] + away}});
    }
}
#endif  // HWY_ONCE
