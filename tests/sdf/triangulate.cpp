#include "sdf/io/triangulate.h"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <map>
#include <numeric>
#include <random>
#include <set>
#include <span>
#include <utility>

#include <bilayer/sdf/inspect.h>
#include "sdf/sign/sign_choice.h"
#include "tests/support/support.h"

using namespace bilayer;
using namespace bilayer::detail;

namespace {

/// A point of an outline. Coordinates are integers, so that areas and orientation tests are exact.
struct Point {
    std::int64_t x, y;
    auto operator<=>(const Point&) const = default;
};
using Outline = std::vector<Point>;
using Random = std::mt19937;

std::int64_t doubleArea(const Point& a, const Point& b, const Point& c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

std::int64_t doubleArea(const Outline& outline) {
    std::int64_t sum = 0;
    for (std::size_t i = 0; i < outline.size(); ++i) {
        const Point &p = outline[i], &q = outline[(i + 1) % outline.size()];
        sum += p.x * q.y - p.y * q.x;
    }
    return sum;
}

int sideOf(const Point& a, const Point& b, const Point& c) {
    const std::int64_t area = doubleArea(a, b, c);
    return (area > 0) - (area < 0);
}

bool onSegment(const Point& p, const Point& a, const Point& b) {
    return sideOf(a, b, p) == 0 && (p.x - a.x) * (p.x - b.x) + (p.y - a.y) * (p.y - b.y) <= 0;
}

bool touch(const Point& a, const Point& b, const Point& c, const Point& d) {
    if (onSegment(a, c, d) || onSegment(b, c, d) || onSegment(c, a, b) || onSegment(d, a, b)) return true;
    return sideOf(a, b, c) * sideOf(a, b, d) < 0 && sideOf(c, d, a) * sideOf(c, d, b) < 0;
}

// The outline in a plane through integer points, or in one of the coordinate planes.
std::vector<glm::dvec3> inSpace(const Outline& outline, Random& random) {
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

// Checks that there are n - 2 triangles, that they use all corners, and that they contain each outline edge once and
// every other edge once in each direction.
void checkEdges(std::size_t corners, const std::vector<glm::uvec3>& triangles) {
    REQUIRE(triangles.size() == corners - 2);
    std::vector<std::pair<unsigned, unsigned>> edges;
    std::vector<char> used(corners);
    for (const glm::uvec3& t : triangles)
        for (int k = 0; k < 3; ++k) {
            REQUIRE(t[k] < corners);
            used[t[k]] = 1;
            edges.emplace_back(t[k], t[(k + 1) % 3]);
        }
    REQUIRE(std::count(used.begin(), used.end(), 0) == 0);
    std::sort(edges.begin(), edges.end());
    REQUIRE(std::adjacent_find(edges.begin(), edges.end()) == edges.end());
    std::size_t wrong = 0;
    for (const auto& [a, b] : edges) {
        const bool outline = b == (a + 1) % corners;
        wrong += outline == std::binary_search(edges.begin(), edges.end(), std::pair(b, a));
    }
    REQUIRE(wrong == 0);
}

// Returns the count of triangles without area. Checks that none is flipped: then their areas sum to that of the
// outline, and they cover each point as often as the outline winds around it.
std::size_t checkAreas(const Outline& outline, const std::vector<glm::uvec3>& triangles) {
    const std::int64_t whole = doubleArea(outline);
    std::int64_t sum = 0;
    std::size_t folded = 0, flat = 0;
    for (const glm::uvec3& t : triangles) {
        const std::int64_t area = doubleArea(outline[t.x], outline[t.y], outline[t.z]);
        sum += area;
        folded += whole > 0 ? area < 0 : area > 0;
        flat += area == 0;
    }
    REQUIRE(folded == 0);
    REQUIRE(sum == whole);
    return flat;
}

void check(Outline outline, Random& random, std::size_t flat = 0) {
    std::rotate(outline.begin(), outline.begin() + long(random() % outline.size()), outline.end());
    if (random() % 2) std::reverse(outline.begin(), outline.end());
    std::vector<glm::uvec3> triangles;
    const bool right = triangulate(inSpace(outline, random), triangles);
    checkEdges(outline.size(), triangles);
    const std::size_t flatTriangles = checkAreas(outline, triangles);
    REQUIRE(flatTriangles == flat);
    REQUIRE(right);
}

// Checks that an invalid outline is reported; its triangles still close the surface that they belong to.
void checkWrong(const Outline& outline, Random& random) {
    std::vector<glm::uvec3> triangles;
    REQUIRE_FALSE(triangulate(inSpace(outline, random), triangles));
    checkEdges(outline.size(), triangles);
}

// Squares of a grid, some of which are joined. If the joined ones form a tree, their outline is one closed walk around
// them, with both directions of each edge between squares that are not joined.
class Squares {
  public:
    using Square = std::pair<int, int>;

    // Joins all neighbours or, for a maze, only each square to the one from which it was added.
    Squares(int count, bool maze, Random& random) {
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
    Outline outline(double straight, Random& random) const {
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
Outline star(std::size_t count, int size, Random& random, Point centre = {0, 0}) {
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
Outline grown(std::size_t count, int size, Random& random) {
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
void bridge(Outline& outline, std::span<const Outline> holes) {
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
    for (const Bridge& way : bridges) {
        const std::size_t n = outline.size();
        const Point &a = outline[way.from], &b = hole[way.to];
        const Point &before = outline[(way.from + n - 1) % n], &after = outline[(way.from + 1) % n];
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
        for (std::size_t j = 0; j <= hole.size(); ++j) walk.push_back(hole[(way.to + j) % hole.size()]);
        walk.push_back(a);
        outline.insert(outline.begin() + long(way.from) + 1, walk.begin(), walk.end());
        return;
    }
    FAIL("no bridge to the hole");
}

Outline comb(int teeth, int length) {
    Outline outline{{0, -1}, {2 * teeth - 1, -1}};
    for (int i = teeth; i-- > 0;)
        for (const auto& [x, y] : {std::pair(1, 0), std::pair(1, 1), std::pair(0, 1), std::pair(0, 0)})
            outline.push_back({2 * i + x, y * length});
    outline.pop_back();
    outline.push_back({0, 0});
    return outline;
}

// A spiral band of width one.
Outline spiral(int turns) {
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

// Adds corners at random places of the edges with integer coordinates.
Outline withStraightCorners(const Outline& outline, Random& random) {
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

Mesh prism(const Outline& outline) {
    const std::size_t n = outline.size();
    Mesh mesh;
    std::vector<std::vector<unsigned>> faces(2);
    for (unsigned i = 0; i < n; ++i) {
        mesh.points.push_back({float(outline[i].x), float(outline[i].y), 0});
        mesh.points.push_back({float(outline[i].x), float(outline[i].y), 1});
        faces[0].push_back(2 * unsigned(n - 1 - i));
        faces[1].push_back(2 * i + 1);
        const unsigned next = (i + 1) % unsigned(n);
        faces.push_back({2 * i, 2 * next, 2 * next + 1, 2 * i + 1});
    }
    for (const auto& face : faces) {
        std::vector<glm::dvec3> corners;
        for (const unsigned corner : face) corners.emplace_back(mesh.points[corner]);
        std::vector<glm::uvec3> triangles;
        REQUIRE(triangulate(corners, triangles));
        for (const glm::uvec3& t : triangles) mesh.triangles.push_back({face[t.x], face[t.y], face[t.z]});
    }
    return mesh;
}

}  // namespace

TEST_CASE("outlines of squares, with and without corners on straight edges, are cut exactly") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int i = 0; i < 1500; ++i) {
        CAPTURE(i);
        const double straight = i % 3 * 0.5;
        check(Squares(2 + int(random() % 60), false, random).outline(straight, random), random);
    }
}

TEST_CASE("mazes whose walls have no thickness are cut exactly") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int i = 0; i < 1500; ++i) {
        CAPTURE(i);
        const double straight = i % 3 * 0.5;
        check(Squares(2 + int(random() % 60), true, random).outline(straight, random), random);
    }
}

TEST_CASE("stars are cut exactly, with corners on straight edges too") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int i = 0; i < 2000; ++i) {
        CAPTURE(i);
        const Outline outline = star(4 + random() % 60, i % 2 ? 6 : 10000, random);
        check(outline, random);
        if (outline.size() > 3 || i % 2) check(withStraightCorners(outline, random), random);
    }
}

TEST_CASE("outlines that grew at random are cut exactly") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int i = 0; i < 1500; ++i) {
        CAPTURE(i);
        const Outline outline = grown(4 + random() % 40, i % 2 ? 12 : 1000, random);
        check(outline, random);
        check(withStraightCorners(outline, random), random);
    }
}

TEST_CASE("holes that are joined by edges both ways are cut out exactly") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int i = 0; i < 400; ++i) {
        CAPTURE(i);
        const int size = i % 2 ? 4 : 100, across = 1 + int(random() % 4);
        const std::int64_t side = std::int64_t(across) * 2 * size;
        Outline outline{{-1, -1}, {side + 1, -1}, {side + 1, side + 1}, {-1, side + 1}};
        if (random() % 2) outline = withStraightCorners(outline, random);
        std::vector<Outline> holes;
        for (int x = 0; x < across; ++x)
            for (int y = 0; y < across; ++y) {
                holes.push_back(star(5 + random() % 8, size - 1, random, {(2 * x + 1) * size, (2 * y + 1) * size}));
                std::reverse(holes.back().begin(), holes.back().end());
            }
        for (std::size_t k = 0; k < holes.size(); ++k) bridge(outline, std::span(holes).subspan(k));
        check(outline, random);
    }
}

TEST_CASE("combs and spirals of many corners are cut exactly") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const int n : {1, 2, 3, 10, 200, 5000}) {
        CAPTURE(n);
        check(comb(n, 1 + n), random);
        check(spiral(n), random);
    }
    check(Squares(30000, true, random).outline(0.5, random), random);
    check(Squares(30000, false, random).outline(1, random), random);
    check(star(100000, 1 << 20, random), random);
}

TEST_CASE("repeated corners and edges out and back cost a triangle without area each") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int i = 0; i < 500; ++i) {
        CAPTURE(i);
        Outline outline = star(4 + random() % 20, 50, random);
        std::size_t flat = 1 + random() % 4;
        for (std::size_t k = 0; k < flat; ++k) {
            const std::size_t at = random() % outline.size();
            outline.insert(outline.begin() + long(at), outline[at]);
        }
        check(outline, random, flat);
    }
    // an outward spike takes two, an inward one none
    check({{0, 0}, {4, 0}, {4, 4}, {6, 6}, {4, 4}, {0, 4}}, random, 2);
    check({{0, 0}, {4, 0}, {4, 4}, {3, 3}, {4, 4}, {0, 4}}, random, 0);
    check({{0, 0}, {4, 0}, {4, 2}, {2, 2}, {4, 2}, {6, 2}, {4, 2}, {4, 4}, {0, 4}}, random, 2);
}

TEST_CASE("outlines that cross themselves or enclose nothing are told") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    checkWrong({{0, 0}, {1, 1}, {2, 2}}, random);
    checkWrong({{0, 0}, {1, 1}, {2, 2}, {1, 1}}, random);
    checkWrong({{3, 1}, {3, 1}, {3, 1}, {3, 1}, {3, 1}}, random);
    checkWrong({{0, 0}, {4, 4}, {4, 0}, {0, 4}}, random);
    checkWrong({{0, 0}, {4, 4}, {4, 0}, {0, 5}}, random);
    checkWrong({{0, 0}, {2, 2}, {4, 4}, {4, 0}, {2, 2}, {0, 5}}, random);
    checkWrong({{0, 10}, {6, -8}, {-9, 3}, {9, 3}, {-6, -8}}, random);  // a pentagram
    // a band whose ends overlap: its total rotation is one turn to the left, like that of a simple outline
    checkWrong({{0, 0}, {10, 0}, {10, 10}, {4, 10}, {4, -4}, {6, -4}, {6, 8}, {8, 8}, {8, 2}, {0, 2}}, random);
    int wrong = 0;
    for (int i = 0; i < 300; ++i) {
        CAPTURE(i);
        const std::size_t n = 4 + random() % 60;
        std::uniform_int_distribution<int> coordinate(-1000, 1000);
        Outline outline;
        for (std::size_t k = 0; k < n; ++k) outline.push_back({coordinate(random), coordinate(random)});
        bool crosses = false;
        for (std::size_t k = 0; k < n; ++k)
            for (std::size_t l = k + 2; l < n; ++l)
                if ((l + 1) % n != k)
                    crosses = crosses || touch(outline[k], outline[k + 1], outline[l], outline[(l + 1) % n]);
        wrong += crosses;
        if (crosses)
            checkWrong(outline, random);
        else
            check(outline, random);
    }
    CHECK(wrong > 100);
    Outline outline;
    for (int k = 0; k < 20000; ++k) outline.push_back({int(random() % 100000), int(random() % 100000)});
    checkWrong(outline, random);
}

TEST_CASE("a quadrangle is cut along the diagonal that lies within") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int i = 0; i < 2000; ++i) {
        CAPTURE(i);
        Outline outline = star(4, i % 2 ? 3 : 1000, random);
        if (outline.size() == 4) check(outline, random);
    }
    std::vector<glm::uvec3> triangles;
    CHECK(triangulate(std::vector<glm::dvec3>{{0, 0, 0}, {1, 0, 0.2}, {1, 1, 0}, {0, 1, 0.2}}, triangles));
    CHECK(triangles == std::vector<glm::uvec3>{{0, 1, 2}, {0, 2, 3}});
    CHECK_FALSE(triangulate(std::vector<glm::dvec3>{{0, 0, 0}, {1, 0, 0}}, triangles));
    CHECK(triangles.size() == 2);
}

TEST_CASE("places near the rounding of their coordinates are told apart") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int i = 0; i < 300; ++i) {
        CAPTURE(i);
        const Outline outline = grown(6 + random() % 20, 12, random);
        // exact: the shift is a power of two, and coordinates are its last bits
        std::vector<glm::dvec3> points;
        for (const Point& p : outline)
            points.emplace_back(0x1p40 + double(p.x) * 0x1p-12, 7, -0x1p40 + double(p.y) * 0x1p-12);
        std::vector<glm::uvec3> triangles;
        REQUIRE(triangulate(points, triangles));
        checkEdges(outline.size(), triangles);
        CHECK(checkAreas(outline, triangles) == 0);
    }
}

TEST_CASE("prisms on any outline are closed and have its area for a volume") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    // a corner of the caps lies on the diagonal between two others
    const Outline angle{{0, 0}, {2, 0}, {2, 2}, {1, 2}, {1, 4}, {0, 4}};
    for (int i = 0; i < 60; ++i) {
        CAPTURE(i);
        const Outline outline = i == 0   ? angle
                                : i < 30 ? withStraightCorners(grown(20, 12, random), random)
                                         : Squares(30, false, random).outline(0.3, random);
        const Mesh mesh = prism(outline);
        CHECK(balanced(mesh));
        CHECK(inspect(mesh).volume == Approx(0.5 * double(doubleArea(outline))));
    }
}
