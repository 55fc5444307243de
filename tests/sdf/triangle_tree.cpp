// SPDX-License-Identifier: Apache-2.0
#include "sdf/bvh/triangle_tree.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <set>
#include <utility>
#include <vector>

#include "demos/shared/shapes.h"
#include "sdf/bvh/close_pairs.h"
#include "sdf/mesh/topology.h"
#include "sdf/mesh/wall_thickness.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::triangle_tree_test {
using namespace bilayer::detail;

namespace {

// Triangles of all sizes, some of which share vertices.
Mesh soup(std::size_t triangles, float offset, test::Random& random) {
    Mesh mesh;
    for (std::size_t i = 0; i < triangles; ++i) {
        const glm::vec3 centre = random.point(1);
        const float size = float(std::exp2(random(-8, 0)));
        const unsigned first = unsigned(mesh.points.size());
        for (int k = 0; k < 3; ++k) mesh.points.push_back(offset + centre + random.point(size));
        mesh.triangles.emplace_back(first, first + 1, i % 3 ? first + 2 : unsigned(first / 2));
    }
    return weld(mesh);
}

bool meet(const Bounds& a, const Bounds& b) {
    bool all = true;
    for (int k = 0; k < 3; ++k) all &= a.lower[k] <= b.upper[k] && b.lower[k] <= a.upper[k];
    return all;
}

int shared(const glm::uvec3& a, const glm::uvec3& b) {
    int count = 0;
    for (int i = 0; i < 3; ++i)
        for (int k = 0; k < 3; ++k) count += a[i] == b[k];
    return count;
}

using Wide = glm::vec<3, long double>;

// Whether an edge of one triangle certainly passes through the inside of another one. This holds for one of two
// triangles that have a segment in common, unless corners or edges touch.
bool edgePierces(const Mesh& mesh, const glm::uvec3& t, const glm::uvec3& through) {
    const auto sign = [](const Wide& a, const Wide& b, const Wide& c) {
        const long double volume = glm::dot(glm::cross(a, b), c);
        const long double rounding = 1e-15L * glm::length(a) * glm::length(b) * glm::length(c);
        return volume > rounding ? 1 : volume < -rounding ? -1 : 0;
    };
    for (int k = 0; k < 3; ++k) {
        const Wide from(mesh.points[t[k]]), along = Wide(mesh.points[t[(k + 1) % 3]]) - from;
        const Wide a = Wide(mesh.points[through.x]) - from, b = Wide(mesh.points[through.y]) - from,
                   c = Wide(mesh.points[through.z]) - from;
        const int side = sign(along, a, b);
        const bool isInside = side != 0 && sign(along, b, c) == side && sign(along, c, a) == side;
        const int start = sign(a, b, c), end = sign(a - along, b - along, c - along);
        if (isInside && start * end < 0) return true;
    }
    return false;
}

// A fan around a point, and a strip of long triangles, in about one plane. Some of them run through each other, since
// their corners are rounded.
Mesh nearlyFlat(unsigned corners, test::Random& random) {
    const glm::vec3 x = random.direction(), y = glm::normalize(glm::cross(x, random.direction()));
    Mesh mesh;
    mesh.points.push_back(random.point(1));
    for (unsigned i = 0; i < corners; ++i) {
        const float angle = 6.2f * float(i) / float(corners), radius = i % 2 ? 1.f : 0.7f;
        mesh.points.push_back(mesh.points[0] + radius * (std::cos(angle) * x + std::sin(angle) * y));
        if (i > 0) mesh.triangles.emplace_back(0, i, i + 1);
    }
    const glm::vec3 start = mesh.points[0] - 3.f * x - 3.f * y;
    for (unsigned i = 0; i < corners; ++i) {
        const unsigned next = unsigned(mesh.points.size());
        mesh.points.push_back(start + (0.1f * float(i) / float(corners)) * x + float(i % 2) * (x + y));
        if (i > 1) mesh.triangles.push_back({next - 2, i % 2 ? next : next - 1, i % 2 ? next - 1 : next});
    }
    return weld(mesh);
}

// Slivers in all directions that share one corner. Some run through each other.
Mesh star(unsigned triangles, float offset, test::Random& random) {
    Mesh mesh;
    mesh.points.push_back(glm::vec3(offset));
    for (unsigned i = 0; i < triangles; ++i) {
        const glm::vec3 tip = random.direction() * float(random(0.1, 1));
        for (const glm::vec3& p : {tip, tip + random.point(0.1)}) mesh.points.push_back(offset + p);
        mesh.triangles.emplace_back(2 * i + 1, i % 2 ? 0 : 2 * i + 2, i % 2 ? 2 * i + 2 : 0);
    }
    return weld(mesh);
}

// Shells in each other, close together and turned, so that some run through each other.
Mesh shells(std::size_t count, test::Random& random) {
    std::vector<Mesh> all;
    for (std::size_t i = 0; i < count; ++i) {
        all.push_back(shapes::sphere(1 + 0.002f * float(i), 1));
        const glm::vec3 by = random.point(0.002);
        for (glm::vec3& p : all.back().points) p = glm::vec3(p.x - 0.5f * p.y, p.y + 0.5f * p.x, p.z) + by;
    }
    return weld(shapes::join(all));
}

std::set<std::pair<unsigned, unsigned>> allClosePairs(const Mesh& mesh, const TriangleTree& tree) {
    std::set<std::pair<unsigned, unsigned>> close;
    std::vector<std::pair<unsigned, unsigned>> pairs;
    for (std::uint32_t leaf = 0; leaf < tree.boxes().leafCount; ++leaf) {
        findClosePairs(mesh, tree, leaf, pairs);
        for (const auto& [a, b] : pairs) CHECK(close.insert(std::minmax(a, b)).second);
    }
    return close;
}

// As wallThickness(), by brute force over all triangles in double precision.
std::vector<float> wallsByBruteForce(const Mesh& mesh) {
    std::vector<float> all;
    for (const glm::uvec3& t : mesh.triangles) {
        const glm::vec3 a = mesh.points[t.x], b = mesh.points[t.y], c = mesh.points[t.z];
        const glm::vec3 normal(0.5 * glm::cross(glm::dvec3(b) - glm::dvec3(a), glm::dvec3(c) - glm::dvec3(a)));
        const glm::dvec3 origin((a + b + c) / 3.f), direction(-normal / glm::length(normal));
        double nearest = std::numeric_limits<double>::infinity();
        for (const glm::uvec3& o : mesh.triangles) {
            const glm::dvec3 p(mesh.points[o.x]), u = glm::dvec3(mesh.points[o.y]) - p,
                                                  v = glm::dvec3(mesh.points[o.z]) - p;
            const glm::dvec3 n = glm::cross(u, v);
            const double facing = glm::dot(n, direction);
            if (facing <= double(0.2f) * glm::length(n)) continue;
            const glm::dvec3 side = glm::cross(direction, origin - p);
            const double x = glm::dot(v, side) / facing, y = -glm::dot(u, side) / facing;
            const double along = -glm::dot(n, origin - p) / facing;
            if (x >= 0 && y >= 0 && x + y <= 1 && along > 0) nearest = std::min(nearest, along);
        }
        all.push_back(float(nearest));
    }
    return all;
}

}  // namespace

TEST_CASE("a triangle tree finds the triangles whose boxes meet a box") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    test::Random random(seed);
    for (const std::size_t triangles : {1, 7, 8, 9, 600}) {
        const Mesh mesh = soup(triangles, 0, random);
        const TriangleTree tree(mesh);
        for (int trial = 0; trial < 50; ++trial) {
            Bounds box;
            box.add(random.point(1.5f));
            box.add(random.point(1.5f));
            std::multiset<unsigned> found, expected;
            tree.descend([&](const Bounds& other) { return meet(box, other); }, [&](unsigned i) { found.insert(i); });
            for (unsigned i = 0; i < mesh.triangles.size(); ++i)
                if (meet(box, tree.boxOf(i))) expected.insert(i);
            CHECK(found == expected);
        }
    }
    const Mesh none;
    TriangleTree(none).descend([](const Bounds&) { return true; }, [](unsigned i) { FAIL(i); });
}

TEST_CASE("pairs of triangles that are left out can not run through each other") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    test::Random random(seed);
    const std::vector<Mesh> meshes{
        soup(700, 0, random),    soup(700, 1000, random),
        nearlyFlat(300, random), shapes::join({nearlyFlat(200, random), soup(300, 0, random)}),
        star(1000, 0, random),   star(1000, 100, random),
        shells(30, random)};
    for (const Mesh& mesh : meshes) {
        CAPTURE(mesh.triangles.size());
        const TriangleTree tree(mesh);
        const auto close = allClosePairs(mesh, tree);
        std::size_t apart = 0;
        for (unsigned a = 0; a < mesh.triangles.size(); ++a)
            for (unsigned b = a + 1; b < mesh.triangles.size(); ++b) {
                const glm::uvec3 &s = mesh.triangles[a], &t = mesh.triangles[b];
                if (close.count({a, b}) || !meet(tree.boxOf(a), tree.boxOf(b)) || shared(s, t) > 1) continue;
                ++apart;
                if (edgePierces(mesh, s, t) || edgePierces(mesh, t, s)) FAIL_CHECK("triangles " << a << " and " << b);
            }
        // the quick rejection is effective
        CHECK(apart > close.size());
    }
}

TEST_CASE("few slivers that meet in one corner are paired, and few triangles of shells in each other") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    test::Random random(seed);
    Mesh fan = star(4000, 0, random);
    for (unsigned i = 1; i < fan.points.size(); i += 2) fan.points[i + 1] = fan.points[i] + 0.001f * random.direction();
    CHECK(allClosePairs(fan, TriangleTree(fan)).size() < fan.triangles.size());
    std::vector<Mesh> nest;
    for (int i = 0; i < 200; ++i) nest.push_back(shapes::sphere(1 + 0.005f * float(i), 1));
    const Mesh mesh = weld(shapes::join(nest));
    CHECK(allClosePairs(mesh, TriangleTree(mesh)).size() < mesh.triangles.size());
}

TEST_CASE("next to each other in about one plane, few triangles are paired") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    test::Random random(seed);
    for (int i = 0; i < 5; ++i) {
        const Mesh mesh = nearlyFlat(1000, random);
        CHECK(allClosePairs(mesh, TriangleTree(mesh)).size() < 3 * mesh.triangles.size());
    }
    // in a plane across an axis, no triangles are paired, also where they overlap
    for (int axis = 0; axis < 3; ++axis) {
        Mesh flat = soup(500, 0, random);
        for (glm::vec3& p : flat.points) p[axis] = 0.7f;
        CHECK(allClosePairs(flat, TriangleTree(flat)).empty());
    }
}

TEST_CASE("walls are as thick as by brute force") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    test::Random random(seed);
    // rays along axes, through edges and corners, in the planes of boxes and next to them
    const Mesh box = shapes::box({0.5f, 0.25f, 0.125f}, 5);
    const std::vector<Mesh> meshes{box,
                                   weld(shapes::moved(box, {100, -200, 300})),
                                   shapes::sphere(1, 3),
                                   shapes::torus(2, 0.5, 20, 10),
                                   soup(500, 0, random),
                                   soup(500, 1000, random),
                                   star(500, 0, random),
                                   shells(20, random)};
    for (std::size_t i = 0; i < meshes.size(); ++i) {
        CAPTURE(i);
        const TriangleTree tree(meshes[i]);
        std::vector<float> walls = wallsByBruteForce(meshes[i]);
        CHECK(wallThickness(tree) == walls);
        const float limit = walls[walls.size() / 2];
        for (float& wall : walls)
            if (wall >= limit) wall = std::numeric_limits<float>::infinity();
        CHECK(wallThickness(tree, {limit}) == walls);
    }
}

TEST_CASE("sets that threads share are those of one thread") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    test::Random random(seed);
    constexpr unsigned count = 100'000;
    const auto number = [&] { return std::min(unsigned(random(0, count)), count - 1); };
    for (const std::size_t joins : {1000, 50'000, 300'000}) {
        std::vector<std::pair<unsigned, unsigned>> pairs;
        for (std::size_t i = 0; i < joins; ++i) pairs.emplace_back(number(), number());
        DisjointSets sets(count);
        for (const auto& [a, b] : pairs) sets.join(a, b);
        ConcurrentDisjointSets shared(count);
        std::atomic<std::size_t> joined = 0;
        tbb::parallel_for(std::size_t(0), joins,
                          [&](std::size_t i) { joined += shared.join(pairs[i].first, pairs[i].second); });
        std::size_t roots = 0, different = 0;
        for (unsigned i = 0; i < count; ++i) {
            different += shared.root(i) != sets.root(i);
            roots += shared.root(i) == i;
        }
        CHECK(different == 0);
        CHECK(roots == count - joined);
    }
}
}  // namespace bilayer::triangle_tree_test
