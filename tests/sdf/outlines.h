// SPDX-License-Identifier: Apache-2.0
// Outlines of polygons at random: simple ones of many kinds, with integer coordinates.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <numeric>
#include <random>
#include <set>
#include <span>
#include <utility>
#include <vector>

namespace bilayer::test {

/// A point of an outline. Coordinates are integers, so that areas and orientation tests are exact.
struct Point {
    std::int64_t x, y;
    auto operator<=>(const Point&) const = default;
};
using Outline = std::vector<Point>;

inline std::int64_t doubleArea(const Point& a, const Point& b, const Point& c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

inline std::int64_t doubleArea(const Outline& outline) {
    std::int64_t sum = 0;
    for (std::size_t i = 0; i < outline.size(); ++i) {
        const Point &p = outline[i], &q = outline[(i + 1) % outline.size()];
        sum += p.x * q.y - p.y * q.x;
    }
    return sum;
}

inline int sideOf(const Point& a, const Point& b, const Point& c) {
    const std::int64_t area = doubleArea(a, b, c);
    return (area > 0) - (area < 0);
}

inline bool onSegment(const Point& p, const Point& a, const Point& b) {
    return sideOf(a, b, p) == 0 && (p.x - a.x) * (p.x - b.x) + (p.y - a.y) * (p.y - b.y) <= 0;
}

inline bool touch(const Point& a, const Point& b, const Point& c, const Point& d) {
    if (onSegment(a, c, d) || onSegment(b, c, d) || onSegment(c, a, b) || onSegment(d, a, b)) return true;
    return sideOf(a, b, c) * sideOf(a, b, d) < 0 && sideOf(c, d, a) * sideOf(c, d, b) < 0;
}

// The outline in a plane through integer points, or in one of the coordinate planes.
inline std::vector<glm::dvec3> inSpace(const Outline& outline, std::mt19937& random) {
    std::uniform_int_distribution<int> axis(0, 2), slope(-9, 9), shift(-1000, 1000);
    glm::dvec3 u(0), v(0), origin(shift(random), shift(random), shift(random));
    if (random() % 2) {
        const int k = axis(random);
        u[k] = random() % 2 ? 1 : -1;
        v[(k + 1 + random() % 2) % 3] = 1;
    } else {
        do {
            for (int k = 0; k < 3; ++k) {
                u[k] = slope(random);
                v[k] = slope(random);
            }
        } while (glm::cross(u, v) == glm::dvec3(0));
    }
    std::vector<glm::dvec3> points;
    for (const Point& p : outline) points.push_back(origin + double(p.x) * u + double(p.y) * v);
    return points;
}

// Squares of a grid, some of which are joined. If the joined ones form a tree, their outline is one closed walk around
// them, with both directions of each edge between squares that are not joined.
class Squares {
  public:
    using Square = std::pair<int, int>;

    // Joins all neighbours or, for a maze, only each square to the one from which it was added.
    Squares(int count, bool maze, std::mt19937& random) {
        std::vector<Square> list{{0, 0}};
        squares_.insert(list[0]);
        while (int(squares_.size()) < count) {
            const std::size_t i = random() % 3 ? list.size() - 1 - random() % std::min<std::size_t>(list.size(), 8)
                                               : random() % list.size();
            const Square from = list[i];
            const int side = int(random() % 4);
            const Square to = beyond(from, side);
            if (!squares_.insert(to).second) continue;
            list.push_back(to);
            if (maze) {
                joined_.insert({from, side});
                joined_.insert({to, (side + 2) % 4});
            }
        }
        if (maze) return;
        for (const Square& square : squares_)
            for (int side = 0; side < 4; ++side)
                if (squares_.count(beyond(square, side))) joined_.insert({square, side});
    }

    // Counter-clockwise around all of them, without their holes unless it is a maze. Corners on straight edges are kept
    // with a probability.
    Outline outline(double straight, std::mt19937& random) const {
        Square square = *squares_.begin();  // the left side of the first square is on the outer border
        int side = 3;
        const std::pair<Square, int> first(square, side);
        Outline corners;
        do {
            int next = (side + 1) % 4;
            Square to = square;
            while (joined_.count({to, next})) {
                to = beyond(to, next);
                next = (next + 3) % 4;
            }
            if (next != side || std::uniform_real_distribution<double>(0, 1)(random) < straight)
                corners.push_back(endOf(square, side));
            square = to;
            side = next;
        } while (std::pair(square, side) != first);
        return corners;
    }

  private:
    static Square beyond(const Square& s, int side) {
        constexpr std::array<Square, 4> step{{{0, -1}, {1, 0}, {0, 1}, {-1, 0}}};
        return {s.first + step[std::size_t(side)].first, s.second + step[std::size_t(side)].second};
    }
    static Point endOf(const Square& s, int side) {
        constexpr std::array<Square, 4> corner{{{1, 0}, {1, 1}, {0, 1}, {0, 0}}};
        return {s.first + corner[std::size_t(side)].first, s.second + corner[std::size_t(side)].second};
    }

    std::set<Square> squares_;
    std::set<std::pair<Square, int>> joined_;
};

// Corners around a centre from which all are visible.
inline Outline star(std::size_t count, int size, std::mt19937& random, Point centre = {0, 0}) {
    std::uniform_int_distribution<int> coordinate(-size, size);
    const auto half = [](const Point& p) { return p.y > 0 || (p.y == 0 && p.x > 0) ? 0 : 1; };
    for (;;) {
        Outline points;
        for (std::size_t i = 0; i < count; ++i) {
            const Point p{coordinate(random), coordinate(random)};
            if (p != Point{0, 0}) points.push_back(p);
        }
        const Point o{0, 0};
        std::sort(points.begin(), points.end(), [&](const Point& p, const Point& q) {
            return half(p) != half(q) ? half(p) < half(q) : sideOf(o, p, q) > 0;
        });
        const auto same = [&](const Point& p, const Point& q) { return half(p) == half(q) && sideOf(o, p, q) == 0; };
        points.erase(std::unique(points.begin(), points.end(), same), points.end());
        bool sees = points.size() >= 3;
        for (std::size_t i = 0; i < points.size(); ++i)
            sees = sees && sideOf(o, points[i], points[(i + 1) % points.size()]) > 0;
        if (!sees) continue;
        for (Point& p : points) p = {p.x + centre.x, p.y + centre.y};
        return points;
    }
}

// Adds corner by corner, each in place of an edge, while the outline stays simple.
inline Outline grown(std::size_t count, int size, std::mt19937& random) {
    std::uniform_int_distribution<int> coordinate(0, size);
    Outline outline{{0, 0}, {size, 0}, {size / 2, size}};
    for (int tries = 0; outline.size() < count && tries < 2000; ++tries) {
        const Point p{coordinate(random), coordinate(random)};
        const std::size_t n = outline.size(), edge = random() % n;
        const Point a = outline[edge], b = outline[(edge + 1) % n];
        bool free = true;
        for (std::size_t i = 0; i < n && free; ++i) {
            const Point c = outline[i], d = outline[(i + 1) % n];
            free = !onSegment(p, c, d) || i == edge;
            if (i == edge) continue;
            free = free && (c == b ? !onSegment(d, p, b) : d == b || !touch(p, b, c, d));
            free = free && (d == a ? !onSegment(c, a, p) : c == a || !touch(a, p, c, d));
            free = free && (c != b || !touch(a, p, c, d)) && (d != a || !touch(p, b, c, d));
        }
        if (free && p != a && p != b) outline.insert(outline.begin() + long(edge) + 1, p);
    }
    return outline;
}

// Connects the first of some clockwise holes to the outline by an edge in both directions: the shortest one without an
// intersection.
inline void bridge(Outline& outline, std::span<const Outline> holes) {
    const Outline& hole = holes[0];
    struct Bridge {
        std::int64_t length;
        std::size_t from, to;
    };
    std::vector<Bridge> bridges;
    for (std::size_t i = 0; i < outline.size(); ++i)
        for (std::size_t j = 0; j < hole.size(); ++j) {
            const std::int64_t x = outline[i].x - hole[j].x, y = outline[i].y - hole[j].y;
            bridges.push_back({x * x + y * y, i, j});
        }
    std::sort(bridges.begin(), bridges.end(), [](auto& a, auto& b) { return a.length < b.length; });
    for (const Bridge& joint : bridges) {
        const std::size_t n = outline.size();
        const Point &a = outline[joint.from], &b = hole[joint.to];
        const Point &before = outline[(joint.from + n - 1) % n], &after = outline[(joint.from + 1) % n];
        const bool convex = sideOf(before, a, after) > 0;
        const bool left = sideOf(before, a, b) > 0, right = sideOf(a, after, b) > 0;
        if (!(convex ? left && right : left || right)) continue;
        const auto meets = [&](const Outline& edges) {
            for (std::size_t i = 0; i < edges.size(); ++i) {
                const Point &c = edges[i], &d = edges[(i + 1) % edges.size()];
                const bool atEnd = c == a || d == a || c == b || d == b;
                const Point& other = c == a || c == b ? d : c;
                if (atEnd ? onSegment(other, a, b) : touch(a, b, c, d)) return true;
            }
            return false;
        };
        if (meets(outline) || std::any_of(holes.begin(), holes.end(), meets)) continue;
        Outline walk;
        for (std::size_t j = 0; j <= hole.size(); ++j) walk.push_back(hole[(joint.to + j) % hole.size()]);
        walk.push_back(a);
        outline.insert(outline.begin() + long(joint.from) + 1, walk.begin(), walk.end());
        return;
    }
    FAIL("no bridge to the hole");
}

inline Outline comb(int teeth, int length) {
    Outline outline{{0, -1}, {2 * teeth - 1, -1}};
    for (int i = teeth; i-- > 0;)
        for (const auto& [x, y] : {std::pair(1, 0), std::pair(1, 1), std::pair(0, 1), std::pair(0, 0)})
            outline.push_back({2 * i + x, y * length});
    outline.pop_back();
    outline.push_back({0, 0});
    return outline;
}

// A spiral band of width one.
inline Outline spiral(int turns) {
    Outline inner, outer;
    for (int i = 0; i < 4 * turns; ++i) {
        const int r = i / 4 * 2 + 2;
        constexpr std::array<Point, 4> corner{{{1, -1}, {1, 1}, {-1, 1}, {-1, -1}}};
        const Point c = corner[std::size_t(i % 4)];
        const std::int64_t grow = i % 4 == 3 ? 2 : 0;  // the last corner of a turn leads into the next one
        inner.push_back({c.x * r, c.y * r + c.y * grow});
        outer.push_back({c.x * (r + 1), c.y * (r + 1) + c.y * grow});
    }
    std::reverse(outer.begin(), outer.end());
    inner.insert(inner.end(), outer.begin(), outer.end());
    if (doubleArea(inner) < 0) std::reverse(inner.begin(), inner.end());
    return inner;
}

// Two squares that are joined by a zigzag edge both ways.
inline Outline corridor(int corners, bool mirrored) {
    Outline way, outline;
    for (int i = 0; i < corners; ++i) way.push_back({i, i % 2});
    const int last = corners - 1, y = last % 2;
    outline.insert(outline.end(), way.begin(), way.end());
    outline.insert(outline.end(), {{last + 4, y - 2}, {last + 8, y}, {last + 4, y + 2}});
    outline.insert(outline.end(), way.rbegin(), way.rend());
    outline.insert(outline.end(), {{-4, 2}, {-8, 0}, {-4, -2}});
    if (mirrored) {
        for (Point& point : outline) point.x = -point.x;
        std::reverse(outline.begin(), outline.end());
    }
    return outline;
}

// A square with a slit without thickness that winds from its corner to its centre.
inline Outline slit(int corners) {
    Outline way{{0, 0}};
    for (int i = 1; i < corners; ++i) {
        const int length = (i + 1) / 2;
        const Point& last = way.back();
        way.push_back(i % 2 ? Point{last.x + (i % 4 == 1 ? length : -length), last.y}
                            : Point{last.x, last.y + (i % 4 == 2 ? length : -length)});
    }
    Outline outline{
        {-corners, -corners}, {corners, -corners}, {corners, corners}, {-corners, corners}, {-corners, -corners}};
    outline.insert(outline.end(), way.rbegin(), way.rend());
    outline.insert(outline.end(), way.begin() + 1, way.end());
    return outline;
}

// Adds corners at random places of the edges with integer coordinates.
inline Outline withStraightCorners(const Outline& outline, std::mt19937& random) {
    Outline result;
    for (std::size_t i = 0; i < outline.size(); ++i) {
        const Point &p = outline[i], &q = outline[(i + 1) % outline.size()];
        const std::int64_t steps = std::gcd(q.x - p.x, q.y - p.y);
        for (std::int64_t k = 0; k < steps; ++k)
            if (k == 0 || random() % 4 == 0)
                result.push_back({p.x + k * ((q.x - p.x) / steps), p.y + k * ((q.y - p.y) / steps)});
    }
    return result;
}

// Removes some of the corners where an outline goes straight on.
inline Outline withoutStraightCorners(const Outline& outline, double kept, std::mt19937& random) {
    Outline result;
    for (std::size_t i = 0; i < outline.size(); ++i) {
        const std::size_t n = outline.size();
        const Point &p = result.empty() ? outline[n - 1] : result.back(), &q = outline[i], &r = outline[(i + 1) % n];
        const bool straight = sideOf(p, q, r) == 0 && (p.x - q.x) * (r.x - q.x) + (p.y - q.y) * (r.y - q.y) < 0;
        if (!straight || std::uniform_real_distribution<double>(0, 1)(random) < kept) result.push_back(q);
    }
    return result;
}

}  // namespace bilayer::test
