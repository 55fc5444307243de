// SPDX-License-Identifier: Apache-2.0
#include "bench/paper/theorems.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <random>
#include <vector>

namespace bilayer::paper {
namespace {

using glm::dvec2;
using glm::dvec3;

class Dice {
  public:
    explicit Dice(unsigned seed) : random_(seed) {}
    double between(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
    double logarithmic(double low, double high) { return std::exp(between(std::log(low), std::log(high))); }
    dvec3 inCube() { return {between(-1, 1), between(-1, 1), between(-1, 1)}; }

  private:
    std::mt19937 random_;
};

void note(DistanceError& worst, double error, double longest, double delta) {
    worst.over = std::max(worst.over, error / longest);
    worst.under = std::max(worst.under, -error / longest);
    worst.underDelta = std::max(worst.underDelta, -error / delta);
}

// A wedge around the z axis: the solid between two half planes, in cross-section at the angles 0 and `angle`. Its faces
// are divided into isosceles right triangles, each with its barycentre as its sample.
struct Wedge {
    double angle, leg;
    std::vector<dvec3> samples[2];
    dvec2 along[2], outward[2];

    Wedge(double solidAngle, double longest, double extent) : angle(solidAngle), leg(longest / std::sqrt(2.0)) {
        along[0] = {1, 0};
        along[1] = {std::cos(angle), std::sin(angle)};
        outward[0] = {0, -1};
        outward[1] = {-std::sin(angle), std::cos(angle)};
        const int across = int(std::ceil(extent / leg));
        for (int face = 0; face < 2; ++face)
            for (int i = 0; i < across; ++i)
                for (int j = -across; j < across; ++j)
                    for (const double third : {1.0, 2.0}) {
                        const dvec2 p = along[face] * ((i + third / 3) * leg);
                        samples[face].emplace_back(p, (j + third / 3) * leg);
                    }
    }

    // Distance to the surface.
    double distance(const dvec2& p) const {
        double nearest = glm::length(p);
        for (int face = 0; face < 2; ++face)
            if (glm::dot(p, along[face]) > 0) nearest = std::min(nearest, std::abs(glm::dot(p, outward[face])));
        return nearest;
    }

    // Distance by the inner layer (Eq. 3).
    double approximate(const dvec3& p, double delta) const {
        double nearest = 1e9;
        for (int face = 0; face < 2; ++face)
            for (const dvec3& sample : samples[face])
                nearest = std::min(nearest, glm::distance(p, sample - dvec3(delta * outward[face], 0)));
        return std::max(0.0, nearest - delta);
    }
};

}  // namespace

DistanceError overTriangles(unsigned seed, int trials) {
    Dice dice(seed);
    DistanceError worst;
    for (int i = 0; i < trials; ++i) {
        const std::array<dvec3, 3> c{dice.inCube(), dice.inCube(), dice.inCube()};
        const dvec3 cross = glm::cross(c[1] - c[0], c[2] - c[0]);
        if (!(glm::length(cross) > 1e-6)) continue;
        const dvec3 normal = glm::normalize(cross), centre = (c[0] + c[1] + c[2]) / 3.0;
        const double longest =
            std::max({glm::distance(c[0], c[1]), glm::distance(c[1], c[2]), glm::distance(c[2], c[0])});
        double u = dice.between(0, 1), v = dice.between(0, 1);
        if (u + v > 1) u = 1 - u, v = 1 - v;
        const double height = dice.logarithmic(1e-4, 10), delta = dice.logarithmic(0.01, 4);
        const dvec3 point = c[0] + u * (c[1] - c[0]) + v * (c[2] - c[0]) + height * normal;
        note(worst, glm::distance(point, centre - delta * normal) - delta - height, longest, delta);
    }
    return worst;
}

DistanceError overEdges(unsigned seed, int trials) {
    Dice dice(seed);
    DistanceError worst;
    for (int i = 0; i < trials; ++i) {
        const double longest = dice.logarithmic(0.01, 4), foot = dice.between(-longest / 2, longest / 2);
        const double height = dice.logarithmic(1e-4, 10), delta = dice.logarithmic(0.01, 4);
        note(worst, std::hypot(foot, height + delta) - delta - height, longest, delta);
    }
    return worst;
}

DistanceError aroundWedges(unsigned seed, int trials, double minAngle, double maxAngle) {
    constexpr double delta = 0.5, extent = 4, farthest = 2;
    constexpr int points = 20;
    Dice dice(seed);
    DistanceError worst;
    for (int i = 0; i < trials; ++i) {
        const double longest = dice.logarithmic(0.1, 2);
        const Wedge wedge(dice.between(minAngle, maxAngle), longest, extent);
        for (int k = 0; k < points; ++k) {
            const double angle = dice.between(wedge.angle, 2 * pi), radius = dice.between(0.01, farthest);
            const dvec2 at = radius * dvec2(std::cos(angle), std::sin(angle));
            const dvec3 point(at, dice.between(-wedge.leg, wedge.leg));
            note(worst, wedge.approximate(point, delta) - wedge.distance(at), longest, delta);
        }
    }
    return worst;
}

namespace {

// Fig. 6: two edges that meet at the origin, with the solid above them.
struct Bend {
    double theta, l1, l2, delta;
    dvec2 left, right;                                   // along the edges
    dvec2 innerLeft, outerLeft, innerRight, outerRight;  // the four points of the layers

    Bend(double angle, double shorter, double longer, double offset)
        : theta(angle),
          l1(shorter),
          l2(longer),
          delta(offset),
          left(-std::cos(theta), std::sin(theta)),
          right(std::cos(theta), std::sin(theta)) {
        const dvec2 upLeft(std::sin(theta), std::cos(theta)), upRight(-std::sin(theta), std::cos(theta));
        innerLeft = l1 * left + delta * upLeft;
        outerLeft = l1 * left - delta * upLeft;
        innerRight = l2 * right + delta * upRight;
        outerRight = l2 * right - delta * upRight;
    }

    // The paper's length of OF.
    double reach() const {
        return (l2 + l1) * (l2 - l1) / (2 * (l2 + l1 + std::sin(2 * theta) * (delta - l2 * std::tan(theta))));
    }
    dvec2 farthest() const { return -reach() * left; }  // F

    // Whether OGF is a triangle.
    bool closed() const { return delta * std::sin(2 * theta) < l2 + l1 * std::cos(2 * theta); }

    bool calledInside(const dvec2& p) const {
        return std::min(glm::distance(p, innerLeft), glm::distance(p, innerRight)) <=
               std::min(glm::distance(p, outerLeft), glm::distance(p, outerRight));
    }
    bool outside(const dvec2& p) const {
        const dvec2 upLeft(std::sin(theta), std::cos(theta)), upRight(-std::sin(theta), std::cos(theta));
        return glm::dot(p, upLeft) < 0 || glm::dot(p, upRight) < 0;
    }
    // Distance to both edges; neighbours beyond their ends are unknown.
    double distance(const dvec2& p) const {
        const auto to = [&](const dvec2& along, double length) {
            return glm::distance(p, std::clamp(glm::dot(p, along), 0.0, length) * along);
        };
        return std::min(to(left, 2 * l1), to(right, 2 * l2));
    }
    // Whether the edges themselves are nearest, not their far ends.
    bool within(const dvec2& p) const { return glm::dot(p, left) < 2 * l1 && glm::dot(p, right) < 2 * l2; }
};

}  // namespace

SignError aroundBends(unsigned seed, int trials, bool closed) {
    constexpr int points = 40;
    constexpr double around = 4;  // radius of the search around O [OF]
    Dice dice(seed);
    SignError worst;
    while (trials > 0) {
        const double l2 = dice.between(0.01, 0.5), l1 = dice.between(0.01, 1) * l2;
        const Bend bend(dice.between(0, pi / 2), l1, l2, dice.logarithmic(0.05, 2));
        if (l2 * std::tan(bend.theta) > bend.delta || bend.closed() != closed) continue;
        --trials;
        const dvec2 f = bend.farthest();
        worst.bound = std::max(worst.bound, bend.reach() / ((l2 - l1) / 2));
        worst.formula =
            std::max(worst.formula, std::abs(glm::distance(f, bend.innerLeft) - glm::distance(f, bend.outerRight)));
        for (int k = 0; k < points; ++k) {
            const dvec2 p = around * bend.reach() * dvec2(dice.between(-1, 1), dice.between(-1, 1));
            if (!bend.outside(p) || !bend.within(p) || !bend.calledInside(p)) continue;
            ++worst.wrong;
            worst.farthest = std::max(worst.farthest, bend.distance(p) / bend.reach());
        }
    }
    return worst;
}

}  // namespace bilayer::paper
