// SPDX-License-Identifier: Apache-2.0
// The pseudonormal method against brute force over all triangles.
#include <oneapi/tbb/global_control.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <map>
#include <mutex>
#include <random>
#include <tuple>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "sdf/base/progress.h"
#include "sdf/fill/pseudonormal.h"
#include "tests/support/support.h"

namespace bilayer::pseudonormal_test {
using namespace bilayer::detail;

namespace {

constexpr double tolerance = 1e-5;    // of distances [voxels]
constexpr double signsMatter = 1e-4;  // signs are checked from this distance of the surface on [voxels]

struct Block {
    std::vector<float> distances;
    std::vector<std::int32_t> triangles;
    bool operator==(const Block&) const = default;
};
using Blocks = std::map<std::tuple<int, int, int>, Block>;

Blocks fill(const Mesh& mesh, float voxelSize, float reach = 3, bool sign = true) {
    Blocks all;
    std::mutex mutex;
    std::size_t taken = 0;
    const std::function<bool(float)> noListener;
    Progress progress(noListener);
    fillPseudonormal({mesh, voxelSize, reach, true, sign,
                      [&](const FilledBlocks& blocks) {
                          const std::lock_guard lock(mutex);
                          taken += blocks.origins.size();
                          for (std::size_t b = 0; b < blocks.origins.size(); ++b) {
                              const glm::ivec3 o = blocks.origins[b];
                              const auto d = blocks.distances.subspan(b * blockVoxels, blockVoxels);
                              const auto t = blocks.triangles.subspan(b * blockVoxels, blockVoxels);
                              all[{o.x, o.y, o.z}] = {{d.begin(), d.end()}, {t.begin(), t.end()}};
                          }
                      },
                      progress});
    REQUIRE(taken == all.size());
    return all;
}

struct Found {
    bool known = false;  // whether the voxel's leaf was filled
    double distance = farAway;
    int triangle = -1;
};

Found at(const Blocks& blocks, const glm::ivec3& v) {
    const auto block = blocks.find({v.x & ~7, v.y & ~7, v.z & ~7});
    if (block == blocks.end()) return {};
    const auto i = std::size_t(((v.x & 7) * blockSide + (v.y & 7)) * blockSide + (v.z & 7));
    return {true, block->second.distances[i], block->second.triangles[i]};
}

struct Errors {
    std::size_t voxels = 0, missing = 0, off = 0, wrongSigns = 0, wrongTriangles = 0;
    double worst = 0;
};

double distanceTo(const Mesh& mesh, int triangle, const glm::dvec3& p) {
    const glm::uvec3 t = mesh.triangles[std::size_t(triangle)];
    return std::sqrt(test::squaredDistance(p, glm::dvec3(mesh.points[t.x]), glm::dvec3(mesh.points[t.y]),
                                           glm::dvec3(mesh.points[t.z])));
}

// Compares one voxel with brute force in double precision and, if signs are checked, the winding number.
void compare(const Mesh& mesh, float voxelSize, float reach, bool sign, const Blocks& blocks, const glm::ivec3& v,
             Errors& errors) {
    const double h = voxelSize;
    const glm::dvec3 p = glm::dvec3(v) * h;
    const double expected = test::distance(mesh, p) / h;
    const Found found = at(blocks, v);
    ++errors.voxels;
    if (std::abs(found.distance) < double(farAway)) {
        const double error = std::abs(std::abs(found.distance) - expected);
        errors.worst = std::max(errors.worst, error);
        errors.off += !(error <= tolerance);
        errors.wrongTriangles +=
            found.triangle < 0 || std::abs(distanceTo(mesh, found.triangle, p) / h - expected) > tolerance;
    } else {
        errors.missing += expected <= double(reach);
        errors.wrongTriangles += found.triangle != -1;
    }
    if (!found.known || expected < signsMatter) return;
    const bool inside = sign && test::windingNumber(mesh, p) > 0.5;
    errors.wrongSigns += (found.distance < 0) != inside;
}

void report(const Errors& errors) {
    CAPTURE(errors.voxels, errors.worst);
    CHECK(errors.voxels > 0);
    CHECK(errors.missing == 0);
    CHECK(errors.off == 0);
    CHECK(errors.wrongSigns == 0);
    CHECK(errors.wrongTriangles == 0);
}

// Compares all voxels around a mesh, or about `most` of them.
void check(const Mesh& mesh, float voxelSize, float reach = 3, bool sign = true, double maxVoxels = 2e4) {
    const unsigned seed = test::seed();
    CAPTURE(seed, voxelSize, reach, mesh.triangles.size());
    std::mt19937 random(seed);
    const Blocks blocks = fill(mesh, voxelSize, reach, sign);
    const Bounds box = bounds(mesh);
    const glm::ivec3 lower(glm::floor(glm::dvec3(box.lower) / double(voxelSize) - double(reach) - 2.0)),
        upper(glm::ceil(glm::dvec3(box.upper) / double(voxelSize) + double(reach) + 2.0));
    Errors errors;
    const glm::dvec3 size = upper - lower + 1;
    const bool all = size.x * size.y * size.z <= maxVoxels;
    if (all) {
        for (int x = lower.x; x <= upper.x; ++x)
            for (int y = lower.y; y <= upper.y; ++y)
                for (int z = lower.z; z <= upper.z; ++z)
                    compare(mesh, voxelSize, reach, sign, blocks, {x, y, z}, errors);
        report(errors);
        return;
    }
    // half of them in filled leaves, half of them anywhere near the surface
    std::uniform_int_distribution<std::size_t> whichTriangle(0, mesh.triangles.size() - 1);
    std::uniform_real_distribution<double> unit(0, 1), offset(-double(reach), double(reach));
    std::vector<std::tuple<int, int, int>> origins;
    for (const auto& entry : blocks) origins.push_back(entry.first);
    std::uniform_int_distribution<std::size_t> whichBlock(0, origins.size() - 1);
    for (std::size_t i = 0; i < std::size_t(maxVoxels); ++i) {
        glm::ivec3 v;
        if (i % 2 == 0) {
            const auto [x, y, z] = origins[whichBlock(random)];
            v = {x + int(random() % 8), y + int(random() % 8), z + int(random() % 8)};
        } else {
            const glm::uvec3 t = mesh.triangles[whichTriangle(random)];
            const double a = unit(random), b = unit(random) * (1 - a);
            const glm::dvec3 p = a * glm::dvec3(mesh.points[t.x]) + b * glm::dvec3(mesh.points[t.y]) +
                                 (1 - a - b) * glm::dvec3(mesh.points[t.z]);
            v = glm::ivec3(
                glm::round(p / double(voxelSize) + glm::dvec3(offset(random), offset(random), offset(random))));
        }
        compare(mesh, voxelSize, reach, sign, blocks, v, errors);
    }
    report(errors);
}

glm::mat4 turned() {
    return glm::rotate(glm::mat4(1), 0.7f, glm::normalize(glm::vec3(1, 2, 3)));
}

// Random separate triangles of all shapes: no closed surface.
Mesh randomTriangles(std::mt19937& random, std::size_t count, float length) {
    std::uniform_real_distribution<float> place(-6, 6), size(-length, length);
    Mesh mesh;
    for (std::size_t i = 0; i < count; ++i) {
        const glm::vec3 a(place(random), place(random), place(random));
        const glm::vec3 ab(size(random), size(random), size(random)), ac(size(random), size(random), size(random));
        const float thin = i % 3 == 0 ? 1e-5f : 1;  // a third of them slivers
        const auto first = unsigned(mesh.points.size());
        mesh.points.insert(mesh.points.end(), {a, a + ab, a + 0.5f * ab + thin * ac});
        mesh.triangles.emplace_back(first, first + 1, first + 2);
    }
    return mesh;
}

// The mesh with separate vertices for every triangle.
Mesh unwelded(const Mesh& mesh) {
    Mesh soup;
    for (const glm::uvec3& t : mesh.triangles) {
        const auto first = unsigned(soup.points.size());
        soup.points.insert(soup.points.end(), {mesh.points[t.x], mesh.points[t.y], mesh.points[t.z]});
        soup.triangles.emplace_back(first, first + 1, first + 2);
    }
    return soup;
}

// A spike: a pyramid over a small base.
Mesh needle(float length, float width, unsigned sides = 3) {
    return shapes::cone(width, length, int(sides));
}

}  // namespace

TEST_CASE("pseudonormal: all voxels of small grids have the right distance, sign and triangle") {
    check(shapes::box({3, 4, 5}), 1.f);
    check(transformed(shapes::box({3, 4, 5}), turned()), 0.83f);
    check(shapes::sphere(4, 2), 0.9f);
    check(shapes::torus(4, 1.3f, 20, 12), 0.7f);
    check(shapes::cone(3, 7, 7), 0.61f);
    check(shapes::join({shapes::box({6, 6, 6}), shapes::flipped(shapes::sphere(3, 2))}), 1.f);
}

TEST_CASE("pseudonormal: random triangles and slivers, without signs") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (const float length : {0.05f, 1.f, 12.f})
        for (const float reach : {1.f, 3.f, 10.f}) check(randomTriangles(random, 60, length), 0.8f, reach, false, 8e3);
}

TEST_CASE("pseudonormal: needles and sharp edges have the right sign") {
    for (const float width : {1.f, 0.1f, 0.01f}) {
        check(needle(17, width), 1.f);
        check(transformed(needle(17, width, 5), turned()), 0.57f);
        check(transformed(shapes::box({6, 4, width}), turned()), 1.f);
    }
    // tips on voxels
    check(needle(16, 0.25f, 4), 0.5f);
}

TEST_CASE("pseudonormal: walls far thinner than a voxel keep their sides") {
    for (const float wall : {0.3f, 0.01f, 1e-3f}) {
        CAPTURE(wall);
        check(transformed(shapes::box({5, 5, wall}), turned()), 1.f);
        check(shapes::bowl(6, wall, 24), 1.f);
    }
}

TEST_CASE("pseudonormal: huge triangles are exact everywhere") {
    check(transformed(shapes::box({500, 300, 0.7f}), turned()), 1.f, 3, true, 3e4);
    check(transformed(shapes::box({250, 0.02f, 0.02f}), turned()), 0.5f, 3, true, 3e4);
    check(transformed(needle(1000, 2), turned()), 1.f, 3, true, 3e4);
}

TEST_CASE("pseudonormal: small parts far apart keep their precision") {
    std::vector<Mesh> parts;
    for (int i = 0; i < 5; ++i)
        parts.push_back(
            transformed(shapes::box({0.3f, 0.4f, 0.5f}),
                        glm::translate(glm::mat4(1), glm::vec3(3001.3f, 999.9f, 77.7f) * float(i)) * turned()));
    check(shapes::join(parts), 1.f);
}

TEST_CASE("pseudonormal: far from the origin nothing is lost") {
    // the vertices are rounded there; the reference uses the rounded ones
    const glm::vec3 far(1e4f, -1e4f, 5e3f);
    check(shapes::moved(shapes::sphere(0.08f, 2), far), 0.01f);
    check(shapes::moved(shapes::box({0.06f, 0.05f, 0.04f}), far), 0.01f);
}

TEST_CASE("pseudonormal: a mesh smaller than a voxel") {
    check(shapes::moved(shapes::sphere(0.2f, 1), glm::vec3(0.4f, 0.3f, 0.2f)), 1.f);
    check(shapes::moved(shapes::box({1e-3f, 1e-3f, 1e-3f}), glm::vec3(0.01f, 0, 0)), 1.f);
}

TEST_CASE("pseudonormal: unwelded vertices, duplicate and zero-area faces change nothing") {
    const Mesh cone = transformed(shapes::cone(4, 9, 9), turned());
    Mesh dirty = unwelded(cone);
    for (std::size_t i = 0; i < cone.triangles.size(); i += 3)  // duplicates that begin with another vertex
        dirty.triangles.push_back({cone.triangles[i].y, cone.triangles[i].z, cone.triangles[i].x});
    const auto soupPoints = unsigned(dirty.points.size());
    dirty.points.insert(dirty.points.end(), cone.points.begin(), cone.points.end());
    for (std::size_t i = unwelded(cone).triangles.size(); i < dirty.triangles.size(); ++i)
        dirty.triangles[i] += soupPoints;
    const glm::uvec3 t = dirty.triangles.front();
    dirty.triangles.insert(dirty.triangles.end(), {{t.x, t.y, t.y}, {t.x, t.x, t.x}, {t.y, t.x, t.y}});

    const Blocks clean = fill(cone, 0.5f), same = fill(dirty, 0.5f);
    REQUIRE(clean.size() == same.size());
    std::size_t different = 0;
    for (const auto& [origin, block] : clean)
        for (std::size_t i = 0; i < blockVoxels; ++i) {
            const float a = block.distances[i], b = same.at(origin).distances[i];
            different += std::signbit(a) != std::signbit(b) || !(std::abs(a - b) <= 1e-5f);
        }
    CHECK(different == 0);
}

TEST_CASE("pseudonormal: meshes of the corpus") {
    std::size_t met = 0;
    for (const char* name : {"screwdriver_7k.off", "fandisk.obj", "spot.obj", "rocker-arm.obj", "sliver_tet.ply"}) {
        const auto path = test::corpusMesh(name);
        if (!path) continue;
        ++met;
        INFO(name);
        const Mesh mesh = readMesh(*path);
        for (const float resolution : {20.f, 110.f}) check(mesh, voxelSizeFor(mesh, resolution), 3, true, 600);
    }
    if (met == 0) WARN("skipped: no corpus");
}

TEST_CASE("pseudonormal: open meshes and soup have distances, and signs from the faces") {
    Mesh open = shapes::sphere(4, 2);
    open.triangles.resize(open.triangles.size() / 2);
    check(open, 0.8f, 3, false);
    Mesh one;
    one.points = {{0, 0, 0}, {9, 0, 0}, {0, 9, 0}};
    one.triangles = {{0, 1, 2}};
    const Blocks blocks = fill(one, 1.f);
    CHECK(at(blocks, {2, 2, 2}).distance == 2);
    CHECK(at(blocks, {2, 2, -2}).distance == -2);
}

TEST_CASE("pseudonormal: the bytes do not depend on the number of threads") {
    const Mesh mesh = shapes::join({shapes::torusKnot(2, 3, 10, 2, 200, 12), shapes::box({30, 1, 0.05f})});
    const Blocks blocks = fill(mesh, 0.4f);
    for (const std::size_t threads : {1, 2, 5}) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        CHECK(fill(mesh, 0.4f) == blocks);
    }
}

TEST_CASE("pseudonormal: an exception of the sink ends the work") {
    const Mesh mesh = shapes::sphere(20, 3);
    const std::function<bool(float)> noListener;
    Progress progress(noListener);
    const auto broken = [](const FilledBlocks&) { throw Cancelled(); };
    CHECK_THROWS_AS(fillPseudonormal({mesh, 0.3f, 3, false, true, broken, progress}), Cancelled);
}
}  // namespace bilayer::pseudonormal_test
