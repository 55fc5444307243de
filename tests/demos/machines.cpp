// SPDX-License-Identifier: Apache-2.0
// Machine parts match their standards, and their fits match their clearances.
#include "demos/shared/machines.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <random>
#include <string>

#include <bilayer/sdf/inspect.h>
#include "demos/shared/exact_distance.h"
#include "demos/shared/gears.h"
#include "demos/shared/shapes.h"
#include "demos/shared/threads.h"
#include "tests/support/support.h"

namespace bilayer::machines_test {
using namespace bilayer::shapes;

namespace {

constexpr double pi = glm::pi<double>(), cos30 = 0.8660254037844386;
constexpr double worstShape = 8;   // longest edge by smallest height; an equilateral triangle has 1.15
constexpr double rounding = 1e-8;  // of coordinates in single precision, some centimetres from the origin [m]

struct Part {
    std::string name;
    Mesh mesh;
    int eulerCharacteristic;  // 2 for a ball, 0 for a ring
};

// Parts in their default pose, and others far from it.
std::vector<Part> someParts() {
    const Thread m8{.diameter = 8e-3f, .pitch = 1.25e-3f, .clearance = 0.05e-3f}, m16{.clearance = 0};
    return {{"bolt", bolt(), 2},
            {"bolt M8", bolt({m8, 20e-3f, 0, 13e-3f, 5.3e-3f, 48}), 2},
            {"bolt without clearance", bolt({.thread = m16, .length = 25e-3f, .segments = 144}), 2},
            {"nut", nut(), 0},
            {"nut M8", nut({m8, 13e-3f, 6.8e-3f, 48}), 0},
            {"gear", gear(), 0},
            {"gear of 18", gear({.teeth = 18, .backlash = 0, .bore = 30e-3f}), 0},
            {"gear of 60", gear({.teeth = 60, .toothModule = 1e-3f, .faceWidth = 4e-3f, .edge = 0.5e-3f}), 0},
            {"gear of 9", gear({.teeth = 9, .pressureAngle = 0.5f, .bore = 4e-3f}), 0},
            {"peg", peg(), 2},
            {"peg without chamfer", peg({.chamfer = 0, .segments = 24}), 2},
            {"blind hole", holedBlock(), 2},
            {"hole", holedBlock({.floor = 0}), 0},
            {"hole without chamfer", holedBlock({.floor = 0, .chamfer = 0, .segments = 24}), 0},
            {"pole", pole(), 2}};
}

double worstShapeOf(const Mesh& mesh) {
    double worst = 0;
    for (const auto& t : mesh.triangles) {
        const glm::dvec3 a(mesh.points[t.x]), b(mesh.points[t.y]), c(mesh.points[t.z]);
        const double longest = std::max({glm::distance(a, b), glm::distance(b, c), glm::distance(c, a)});
        worst = std::max(worst, longest * longest / glm::length(glm::cross(b - a, c - a)));
    }
    return worst;
}

double volume(const Mesh& mesh) {
    return inspect(mesh).volume;
}

// Area of a circle of this radius that is approximated by `segments` chords.
double polygonArea(double radius, int segments) {
    return segments / 2.0 * std::sin(2 * pi / segments) * radius * radius;
}

// The minimum distance between two bodies; negative if they overlap [m].
double gap(const demo::Specimen& a, const Pose& poseA, const demo::Specimen& b, const Pose& poseB) {
    return -demo::penetration(a, poseA, b, poseB, -1);
}

double sagitta(double radius, int segments) {
    return radius * (1 - std::cos(pi / segments));
}

Pose turned(const Pose& pose, double angle) {
    return {pose.position, pose.rotation * glm::angleAxis(float(angle), glm::vec3(0, 0, 1))};
}

// M16 by ISO 68-1: the mean squared radius over one pitch, of the profile reduced by a clearance.
double meanSquaredRadius(const Thread& thread) {
    const double P = thread.pitch, H = std::sqrt(3.0) / 2 * P, c = thread.clearance;
    const double crest = thread.diameter / 2 - c, root = crest - 5.0 / 8 * H;
    const double crestFlat = P / 8 - 2 * c / std::sqrt(3.0), rootFlat = P / 4 + 2 * c / std::sqrt(3.0);
    const double flanks = (P - crestFlat - rootFlat) * (crest * crest + crest * root + root * root) / 3;
    return (crestFlat * crest * crest + rootFlat * root * root + flanks) / P;
}

// The heights, in ascending order, at which a line parallel to z intersects a mesh.
std::vector<double> crossings(const Mesh& mesh, const glm::dvec2& at) {
    std::vector<double> heights;
    for (const auto& t : mesh.triangles) {
        const glm::dvec3 a(mesh.points[t.x]), b(mesh.points[t.y]), c(mesh.points[t.z]);
        const auto area = [&](const glm::dvec3& p, const glm::dvec3& q) {
            return (p.x - at.x) * (q.y - at.y) - (p.y - at.y) * (q.x - at.x);
        };
        const double u = area(b, c), v = area(c, a), w = area(a, b);
        if ((u > 0 && v > 0 && w > 0) || (u < 0 && v < 0 && w < 0))
            heights.push_back((u * a.z + v * b.z + w * c.z) / (u + v + w));
    }
    std::sort(heights.begin(), heights.end());
    return heights;
}

// The linking number of two circles of this radius, the centre lines of two links' tubes: Gauss's integral.
double linkingNumber(const Pose& a, const Pose& b, double radius) {
    constexpr int steps = 200;
    const auto at = [&](const Pose& pose, int i) {
        const double angle = 2 * pi * i / steps;
        return glm::dvec3(pose.toWorld(glm::vec3(radius * std::cos(angle), radius * std::sin(angle), 0)));
    };
    double sum = 0;
    for (int i = 0; i < steps; ++i)
        for (int j = 0; j < steps; ++j) {
            const glm::dvec3 da = at(a, i + 1) - at(a, i), db = at(b, j + 1) - at(b, j);
            const glm::dvec3 apart = (at(a, i + 1) + at(a, i) - at(b, j + 1) - at(b, j)) / 2.0;
            sum += glm::dot(apart, glm::cross(da, db)) / std::pow(glm::length(apart), 3);
        }
    return sum / (4 * pi);
}

}  // namespace

TEST_CASE("machine parts are closed, oriented, in one piece, free of self-intersections and slivers") {
    for (const auto& [name, mesh, eulerCharacteristic] : someParts()) {
        CAPTURE(name);
        const MeshReport report = inspect(mesh);
        CHECK(verdict(report) == "closed and oriented");
        CHECK(report.selfIntersections == 0);
        CHECK(report.nonManifoldVertices == 0);
        CHECK(report.components == 1);
        CHECK(report.volume > 0);
        CHECK(long(report.points) - long(report.triangles) / 2 == eulerCharacteristic);
        CHECK(report.points == mesh.points.size());
        CHECK(worstShapeOf(mesh) < worstShape);
    }
}

TEST_CASE("a bolt and a nut have the dimensions of their norms") {
    const Bounds screw = bounds(bolt()), hexagon = bounds(nut());
    CHECK(screw.upper.z == 60e-3f);
    CHECK(screw.lower.z == -10e-3f);
    CHECK(hexagon.size().z == Approx(14.8e-3));
    for (const Bounds& box : {screw, hexagon}) {
        CHECK(box.size().x == Approx(24e-3));                       // across flats
        CHECK(box.size().y == Approx(24e-3 * 2 / std::sqrt(3.0)));  // across corners
    }
}

TEST_CASE("a pitch of thread has the volume of its profile") {
    const double tenPitches = volume(bolt({.length = 60e-3f})) - volume(bolt({.length = 40e-3f}));
    CHECK(tenPitches == Approx(20e-3 * polygonArea(std::sqrt(meanSquaredRadius({})), 96)).epsilon(2e-4));

    const Thread basic{.clearance = 0};
    const double fivePitches = volume(nut({.height = 24.8e-3f})) - volume(nut());
    const double hexagon = std::sqrt(3.0) / 2 * 24e-3 * 24e-3;
    const double hole = polygonArea(std::sqrt(meanSquaredRadius(basic)) / std::cos(pi / 96), 96);
    CHECK(fivePitches == Approx(10e-3 * (hexagon - hole)).epsilon(2e-4));
}

TEST_CASE("rays along a bolt and through a nut meet right-handed crests one pitch apart") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    const Thread thread;
    const Mesh screw = bolt(), hexagon = nut();
    // where the basic profile's teeth and grooves are equally wide
    const double radius = thread.diameter / 2 - 3.0 / 8 * std::sqrt(3.0) / 2 * thread.pitch;
    for (int i = 0; i < 5; ++i) {
        const double turn = std::uniform_real_distribution<double>(0, 1)(random);
        const glm::dvec2 at(radius * std::cos(2 * pi * turn), radius * std::sin(2 * pi * turn));
        int crests = 0;
        const auto check = [&](const std::vector<double>& heights, double low, double high, double turns,
                               double width) {
            for (std::size_t k = 0; k + 1 < heights.size(); k += 2) {  // in, then out
                const double middle = (heights[k] + heights[k + 1]) / 2, advance = middle / thread.pitch - turns;
                if (heights[k] < low || heights[k + 1] > high) continue;
                CHECK(advance == Approx(std::round(advance)).margin(1e-3));
                CHECK(heights[k + 1] - heights[k] == Approx(width).margin(2 * sagitta(radius, 96)));
                ++crests;
            }
        };
        check(crossings(screw, at), 6e-3, 57e-3, turn, thread.pitch / 2 - 4 * thread.clearance / std::sqrt(3.0));
        CHECK(crests >= 24);
        check(crossings(hexagon, at), -5.5e-3, 5.5e-3, turn + 0.5, thread.pitch / 2);
        CHECK(crests >= 24 + 4);
    }
}

TEST_CASE("a nut that follows the thread is as far from its bolt as the clearance says") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (const auto& [clearance, segments] : {std::pair(20e-6f, 96), std::pair(50e-6f, 72), std::pair(150e-6f, 48)}) {
        const Thread thread{.clearance = clearance};
        const demo::Specimen screw(bolt({.thread = thread, .length = 40e-3f, .segments = segments}), 0.5e-3);
        const demo::Specimen hexagon(nut({.thread = thread, .segments = segments}), 0.5e-3);
        // from where the thread is complete to where half of the nut is over the end
        std::uniform_real_distribution<float> height(6e-3f + 7.4e-3f, 40e-3f);
        for (int i = 0; i < 6; ++i) {
            const float at = height(random);
            CAPTURE(clearance, at);
            const double found = gap(screw, {}, hexagon, onThread(thread, at));
            CHECK(found > clearance * 0.999 - rounding);  // the lead angle reduces it by 0.1 %
            CHECK(found < clearance + sagitta(8e-3, segments));
        }
    }
}

TEST_CASE("a nut does not leave its thread by a straight pull or a rotation without advance") {
    const Thread thread{.clearance = 0.1e-3f};
    const demo::Specimen screw(bolt({.thread = thread, .length = 40e-3f}), 0.5e-3);
    const demo::Specimen hexagon(nut({.thread = thread}), 0.5e-3);
    const double play = thread.clearance / cos30, facets = 2 * sagitta(8e-3, 96), P = thread.pitch;
    const Pose middle = onThread(thread, 20e-3f);
    // penetration depth of the nut after an axial pull [m]
    const auto depth = [&](double pull, double turn) {
        Pose pose = turned(middle, 2 * pi * turn);
        pose.position.z += float(pull);
        return demo::penetration(screw, {}, hexagon, pose);
    };
    for (const double sign : {-1.0, 1.0}) {
        CAPTURE(sign);
        CHECK(depth(sign * 0.95 * play, 0) == 0);
        CHECK(depth(sign * 0.9 * play, sign) == 0);
        // the flanks overlap by the pull beyond the play
        for (const double beyond : {0.05e-3, 0.1e-3, 0.3e-3}) {
            const double expected = beyond * cos30;
            CHECK(depth(sign * (play + beyond), 0) == Approx(expected).margin(facets));
            CHECK(depth(0, sign * (play + beyond) / P) == Approx(expected).margin(facets));
        }
        for (double pull = play + 0.1e-3; pull < P - play - 0.1e-3; pull += 0.2e-3)
            CHECK(depth(sign * pull, 0) > 0.05e-3);
        CHECK(depth(sign * P, 0) == 0);
        CHECK(depth(sign * P / 3, sign / 3) == 0);
        CHECK(depth(sign * P / 3, -sign / 3) > 0.3e-3);  // a left-handed nut does not fit
    }
}

TEST_CASE("gears mesh over a whole pitch with the backlash that was asked for") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> anyAngle(-3, 3);
    for (const auto& [teeth, mateTeeth] : {std::pair(24, 36), std::pair(18, 18), std::pair(18, 60)})
        for (const float backlash : {0.02e-3f, 0.1e-3f}) {
            const Gear wheel{.teeth = teeth, .backlash = backlash, .faceWidth = 1e-3f};
            const Gear mate{.teeth = mateTeeth, .backlash = backlash, .faceWidth = 1e-3f};
            const demo::Specimen one(gear(wheel), 0.3e-3), other(gear(mate), 0.3e-3);
            const float start = anyAngle(random), direction = anyAngle(random);
            const float distance = (wheel.pitchDiameter() + mate.pitchDiameter()) / 2;
            const Pose place{distance * glm::vec3(std::cos(direction), std::sin(direction), 0)};
            const double along = backlash / 2 * std::cos(double(wheel.pressureAngle));  // the line of action
            CAPTURE(teeth, mateTeeth, backlash, start, direction);

            constexpr int steps = 8;
            for (int i = 0; i < steps; ++i) {
                const float angle = start + 2 * glm::pi<float>() / float(teeth) * float(i) / steps;
                const Pose self = turned({}, angle), mesh = turned(place, meshingAngle(mate, angle, wheel, direction));
                CAPTURE(i);
                const double found = gap(one, self, other, mesh);
                CHECK(found > along - rounding);
                CHECK(found < along + 4e-6);  // error of the involutes' chords
                // the teeth lock when the mate is rotated by half the backlash, either way
                const double half = backlash / mate.pitchDiameter();
                for (const double sign : {-1.0, 1.0}) {
                    CHECK(demo::penetration(one, self, other, turned(mesh, sign * 0.95 * half)) == 0);
                    CHECK(demo::penetration(one, self, other, turned(mesh, sign * (half + 1e-3))) > 5e-6);
                }
            }
        }
}

TEST_CASE("a gear has the volume of its involutes") {
    const Gear part;
    const double m = part.toothModule, z = part.teeth, r = z * m / 2, alpha = pi / 9, base = r * std::cos(alpha);
    const double root = r - 1.25 * m, tip = r + m;
    const auto involute = [](double angle) { return std::tan(angle) - angle; };
    const auto halfAngle = [&](double radius) {
        const double atRadius = radius > base ? std::acos(base / radius) : 0;
        return (pi * m / 2 - part.backlash / 2) / (2 * r) + involute(alpha) - involute(atRadius);
    };
    double tooth = 0;
    constexpr int steps = 100000;
    for (int i = 0; i < steps; ++i) {
        const double radius = root + (tip - root) * (i + 0.5) / steps;
        tooth += 2 * halfAngle(radius) * radius * (tip - root) / steps;
    }
    const double area = pi * root * root + z * tooth - pi * part.bore * part.bore / 4;
    CHECK(volume(gear(part)) == Approx(area * part.faceWidth).epsilon(1e-3));
    CHECK(bounds(gear(part)).upper.x == Approx(tip).epsilon(1e-3));
}

TEST_CASE("a peg has its clearance in the hole, and stands on its floor") {
    const float clearance = 0.05e-3f;
    const demo::Specimen pin(peg({.clearance = clearance}), 0.5e-3), block(holedBlock(), 0.5e-3);
    const float floor = -12.5e-3f + 5e-3f, onFloor = floor + 25e-3f;
    for (const double angle : {0.0, 0.01, pi / 96, 1.0}) {
        const double found = gap(pin, turned({{0, 0, onFloor + 1e-3f}}, angle), block, {});
        CHECK(found > clearance / 2 - rounding);
        CHECK(found < clearance / 2 + sagitta(4e-3, 96));
        CHECK(gap(pin, turned({{0, 0, onFloor}}, angle), block, {}) == Approx(0).margin(rounding));
    }
    CHECK(demo::penetration(pin, {{0.03e-3f, 0, onFloor}}, block, {}) > 0);
}

TEST_CASE("pegs, holes and poles have the volumes of their formulas") {
    const auto frustum = [](double r, double R, double h) {
        return h / 3 * (polygonArea(r, 96) + polygonArea(std::sqrt(r * R), 96) + polygonArea(R, 96));
    };
    const double r = 3.95e-3, c = 0.5e-3, hole = 4e-3 / std::cos(pi / 96), mouth = 4.5e-3 / std::cos(pi / 96);
    CHECK(volume(peg()) == Approx(polygonArea(r, 96) * 49e-3 + 2 * frustum(r - c, r, c)));
    const double cube = 25e-3 * 25e-3 * 25e-3;
    CHECK(volume(holedBlock()) == Approx(cube - polygonArea(hole, 96) * 19.5e-3 - frustum(hole, mouth, c)));
    CHECK(volume(holedBlock({.floor = 0})) ==
          Approx(cube - polygonArea(hole, 96) * 24e-3 - 2 * frustum(hole, mouth, c)));
    const double stick = pi * 20e-3 * 20e-3, foot = pi * 80e-3 * 80e-3;
    CHECK(volume(pole()) == Approx(foot * 10e-3 + stick * (370e-3 + 20e-3 * 2 / 3)).epsilon(5e-3));
}

TEST_CASE("the links of a chain go through their neighbours, and only these, at the slack asked for") {
    const float major = 10e-3f, minor = 2e-3f;
    const demo::Specimen link(torus(major, minor, 96, 48), 0.5e-3);
    for (const float slack : {0.f, 1e-3f}) {
        const auto poses = chain(4, major, minor, slack);
        REQUIRE(poses.size() == 4);
        for (std::size_t i = 0; i + 1 < poses.size(); ++i) {
            CHECK(std::abs(linkingNumber(poses[i], poses[i + 1], major)) == Approx(1).epsilon(0.01));
            CHECK(gap(link, poses[i], link, poses[i + 1]) == Approx(slack).margin(sagitta(major - minor, 96)));
        }
        CHECK(linkingNumber(poses[0], poses[2], major) == Approx(0).margin(0.01));
        CHECK(poses[3].position.z == Approx(-3 * (16e-3 - slack)));
    }
}

TEST_CASE("impossible parts are rejected") {
    CHECK_THROWS_AS(bolt({.segments = 50}), std::invalid_argument);
    CHECK_THROWS_AS(bolt({.thread = {.clearance = 0.3e-3f}}), std::invalid_argument);
    CHECK_THROWS_AS(bolt({.thread = {.pitch = 0}}), std::invalid_argument);
    CHECK_THROWS_AS(bolt({.length = 7e-3f}), std::invalid_argument);
    CHECK_THROWS_AS(bolt({.acrossFlats = 15e-3f}), std::invalid_argument);
    CHECK_THROWS_AS(nut({.acrossFlats = 16e-3f}), std::invalid_argument);
    CHECK_THROWS_AS(nut({.height = 2e-3f}), std::invalid_argument);
    CHECK_THROWS_AS(gear({.teeth = 17}), std::invalid_argument);
    CHECK_THROWS_AS(gear({.bore = 50e-3f}), std::invalid_argument);
    CHECK_THROWS_AS(gear({.faceWidth = 0}), std::invalid_argument);
    CHECK_THROWS_AS(peg({.length = 0.5e-3f}), std::invalid_argument);
    CHECK_THROWS_AS(holedBlock({.diameter = 25e-3f}), std::invalid_argument);
    CHECK_THROWS_AS(holedBlock({.floor = 25e-3f}), std::invalid_argument);
    CHECK_THROWS_AS(pole({.footRadius = 10e-3f}), std::invalid_argument);
    CHECK_THROWS_AS(chain(3, 5e-3f, 3e-3f), std::invalid_argument);
    CHECK_THROWS_AS(chain(3, 10e-3f, 1e-3f, 9e-3f), std::invalid_argument);
}
}  // namespace bilayer::machines_test
