// SPDX-License-Identifier: Apache-2.0
#include "tests/support/tiles.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <random>

#include "demos/shared/shapes.h"
#include "tests/support/support.h"

namespace bilayer::tile_cutter_test {
namespace {

std::vector<glm::dvec3> samples(const Tile& tile) {
    std::vector<glm::dvec3> all;
    for (int i = 0; i < tile.rows; ++i)
        for (int j = 0; j <= i; ++j)
            all.push_back(glm::dvec3(tile.base) + glm::dvec3(tile.first) + double(i) * glm::dvec3(tile.down) +
                          double(j) * glm::dvec3(tile.across));
    return all;
}

// Algorithm 1 of the paper, literally.
std::vector<glm::dvec3> algorithm1(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, double epsilon,
                                   int largest) {
    const double area = 0.5 * glm::length(glm::cross(b - a, c - a));
    int n = int(std::ceil(std::sqrt(area / epsilon)));
    if (n > largest) n = largest;
    const glm::dvec3 s1 = (b - a) / double(n), s2 = (c - b) / double(n), s3 = (c - a) / double(n);
    std::vector<glm::dvec3> chosen;
    glm::dvec3 ps = (a + (a + s1) + (a + s3)) / 3.0;
    chosen.push_back(ps);
    int i = 2;
    while (i <= n) {
        ps += s1;
        chosen.push_back(ps);
        glm::dvec3 p = ps;
        int j = 2;
        while (j <= i) {
            p += s2;
            chosen.push_back(p);
            ++j;
        }
        ++i;
    }
    return chosen;
}

Mesh randomTriangle(std::mt19937& random, float size) {
    std::uniform_real_distribution<float> uniform(-size, size);
    const auto point = [&] { return glm::vec3(uniform(random), uniform(random), uniform(random)); };
    return {{point(), point(), point()}, {{0, 1, 2}}};
}

BuildOptions letter(float voxelSize) {
    BuildOptions options{.voxelSize = voxelSize};
    options.doubleLayer.fillGaps = false;
    return options;
}

}  // namespace

TEST_CASE("tiles hold the samples of Algorithm 1 to the letter") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (int trial = 0; trial < 200; ++trial) {
        const Mesh mesh = randomTriangle(random, 0.3f * float(1 + trial % 100));
        BuildOptions options = letter(0.25f);
        options.doubleLayer.epsilon = trial % 2 ? 1.f : 0.3f;
        options.doubleLayer.maxSubdivision = trial % 3 ? 32 : 16;
        const Tiles tiles = makeTiles(mesh, options);
        REQUIRE(tiles.tiles.size() == 1);
        const std::vector<glm::dvec3> ours = samples(tiles.tiles[0]);
        const std::vector<glm::dvec3> paper = algorithm1(
            4.0 * glm::dvec3(mesh.points[0]), 4.0 * glm::dvec3(mesh.points[1]), 4.0 * glm::dvec3(mesh.points[2]),
            double(options.doubleLayer.epsilon), options.doubleLayer.maxSubdivision);
        REQUIRE(ours.size() == paper.size());
        CHECK(std::int64_t(ours.size()) == sampleCount(tiles.tiles[0].rows));
        double worst = 0;
        for (std::size_t i = 0; i < ours.size(); ++i) worst = std::max(worst, glm::distance(ours[i], paper[i]));
        CHECK(worst < 1e-3);
    }
}

TEST_CASE("the layers lie delta to both sides along the outward normal") {
    const Mesh sphere = shapes::sphere(3.f, 3);
    BuildOptions options{.voxelSize = 0.1f};
    options.doubleLayer.delta = 0.75f;
    const Tiles tiles = makeTiles(sphere, options);
    for (const Tile& tile : tiles.tiles) {
        CHECK(glm::length(tile.offset) == Approx(0.75).epsilon(1e-5));
        CHECK(glm::dot(glm::vec3(tile.base) + tile.first, tile.offset) > 0);
    }
}

TEST_CASE("recursive subdivision samples barycentres of parts no larger than epsilon") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (int trial = 0; trial < 50; ++trial) {
        const Mesh mesh = randomTriangle(random, 8.f);
        BuildOptions options = letter(1.f);
        options.doubleLayer.subdivision = Subdivision::recursive;
        const Tiles tiles = makeTiles(mesh, options);
        const glm::dvec3 a(mesh.points[0]), b(mesh.points[1]), c(mesh.points[2]);
        const double area = 0.5 * glm::length(glm::cross(b - a, c - a));
        CHECK(double(tiles.tiles.size()) >= area);
        CHECK(double(tiles.tiles.size()) <= 4 * area + 1);
        // parts of equal area: the mean of their barycentres is the triangle's, with weights of halves and quarters
        for (const Tile& tile : tiles.tiles) {
            REQUIRE(tile.rows == 1);
            CHECK(std::sqrt(test::squaredDistance(samples(tile)[0], a, b, c)) < 1e-4);
        }
    }
    // a right triangle of area 2: two halves, barycentres by hand
    const Mesh right{{{0, 0, 0}, {2, 0, 0}, {0, 2, 0}}, {{0, 1, 2}}};
    BuildOptions options = letter(1.f);
    options.doubleLayer.subdivision = Subdivision::recursive;
    const Tiles tiles = makeTiles(right, options);
    REQUIRE(tiles.tiles.size() == 2);
    CHECK(glm::distance(samples(tiles.tiles[0])[0] + samples(tiles.tiles[1])[0], glm::dvec3(4.0 / 3, 4.0 / 3, 0)) <
          1e-6);
}

TEST_CASE("no gap is left on large triangles and slivers") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(0, 1);
    const Mesh sliver{{{0, 0, 0}, {60, 0, 0}, {30, 0.05f, 0}}, {{0, 1, 2}}};
    const Mesh needle{{{0, 0, 0}, {90, 1, 0}, {90, 1.5f, 0}}, {{0, 1, 2}}};
    const Mesh large{{{-50, 0, 3}, {70, 20, 0}, {30, 110, 9}}, {{0, 1, 2}}};
    for (const Subdivision subdivision : {Subdivision::rows, Subdivision::recursive})
        for (const Mesh& mesh : {sliver, needle, large}) {
            BuildOptions options{.voxelSize = 1.f};
            options.doubleLayer.subdivision = subdivision;
            const Tiles tiles = makeTiles(mesh, options);
            std::vector<glm::dvec3> all;
            for (const Tile& tile : tiles.tiles) {
                CHECK(tile.rows <= options.doubleLayer.maxSubdivision);
                const auto some = samples(tile);
                all.insert(all.end(), some.begin(), some.end());
            }
            double worst = 0;
            for (int i = 0; i < 300; ++i) {
                double u = uniform(random), v = uniform(random);
                if (u + v > 1) u = 1 - u, v = 1 - v;
                const glm::dvec3 p = glm::dvec3(mesh.points[0]) * (1 - u - v) + glm::dvec3(mesh.points[1]) * u +
                                     glm::dvec3(mesh.points[2]) * v;
                double nearest = 1e30;
                for (const auto& sample : all) nearest = std::min(nearest, glm::distance(sample, p));
                worst = std::max(worst, nearest);
            }
            CAPTURE(all.size());
            CHECK(worst < 2.0);
        }
}

// Table 5 of the paper: its parallel program took 7.6 times as long for the same surface with uneven areas.
TEST_CASE("samples are as many whatever the triangles of a surface are like") {
    const auto count = [](const Mesh& mesh) {
        const Tiles tiles = makeTiles(mesh, {.voxelSize = voxelSizeFor(mesh, 251)});
        std::int64_t samples = 0;
        for (const Tile& tile : tiles.tiles) samples += sampleCount(tile.rows);
        return double(samples);
    };
    const double even = count(shapes::unevenSphere(0.0013f));
    CHECK(count(shapes::unevenSphere(0.0052f)) < 1.02 * even);
    CHECK(count(shapes::unevenSphere(0.0098f)) < 1.02 * even);
    // needles 0.1 voxels wide: one sample per 1.6 voxels of their length
    const Mesh needles = shapes::cylinder(1, 2, 8000);
    double lengths = 0;
    for (const auto& t : needles.triangles) {
        const glm::vec3 &a = needles.points[t.x], &b = needles.points[t.y], &c = needles.points[t.z];
        lengths += std::max({glm::distance(a, b), glm::distance(b, c), glm::distance(c, a)}) / 2 * 251;
    }
    CHECK(count(needles) <= lengths / 1.6 + double(needles.triangles.size()));
}

TEST_CASE("triangles without area give no tile, the others keep their order") {
    Mesh mesh = shapes::box({10, 10, 10});
    mesh.points.push_back({5, 5, 10});
    mesh.points.push_back({6, 6, 10});
    mesh.triangles.insert(mesh.triangles.begin() + 3, glm::uvec3(0, 0, 1));
    const Tiles tiles = makeTiles(mesh, {.voxelSize = 1.f});
    CHECK(std::is_sorted(tiles.triangles.begin(), tiles.triangles.end()));
    CHECK(std::find(tiles.triangles.begin(), tiles.triangles.end(), 3) == tiles.triangles.end());
    CHECK(tiles.triangles.back() == 12);
}

TEST_CASE("a mesh far from the origin gives the same tiles, moved") {
    const Mesh near = shapes::sphere(1.f, 2);
    Mesh far = near;
    for (auto& p : far.points) p = glm::round(p * 64.f) / 64.f;  // so that the shift below is exact
    Mesh shifted = far;
    for (auto& p : shifted.points) p += glm::vec3(4096, -8192, 1024);
    const Tiles a = makeTiles(far, {.voxelSize = 0.125f}), b = makeTiles(shifted, {.voxelSize = 0.125f});
    REQUIRE(a.tiles.size() == b.tiles.size());
    for (std::size_t i = 0; i < a.tiles.size(); ++i) {
        CHECK(b.tiles[i].base - a.tiles[i].base == glm::ivec3(32768, -65536, 8192));
        CHECK(a.tiles[i].first == b.tiles[i].first);
        CHECK(a.tiles[i].offset == b.tiles[i].offset);
    }
}
}  // namespace bilayer::tile_cutter_test
