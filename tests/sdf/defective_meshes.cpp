// SPDX-License-Identifier: Apache-2.0
// Defective meshes: every public mesh gets a valid field, whatever its faults, or a clear error.

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <random>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "sdf/sign/sign_choice.h"
#include "tests/support/support.h"

namespace bilayer::defective_meshes_test {
using namespace bilayer::detail;

namespace {

// Low resolution, so that all meshes together take seconds.
constexpr float resolution = 24;
// Guaranteed accuracy of distances, and the tolerance of the check: sums over two voxels in single precision [voxels].
constexpr double exactness = 1e-4, slack = 1e-3;
// Limit of triangles times voxels for brute force, per mesh.
constexpr std::size_t work = 1'000'000;

struct Built {
    LevelSet field;
    openvdb::FloatGrid::ConstPtr grid;
    std::string sign, reason;

    explicit Built(const Mesh& mesh, float voxels = resolution)
        : field(build(mesh, {.voxelSize = voxelSizeFor(mesh, voxels)})),
          grid(field.grids().distance),
          sign(grid->metaValue<std::string>(metadata::sign)),
          reason(grid->metaValue<std::string>(metadata::signReason)) {}

    double at(const glm::vec3& point) const {
        const openvdb::Vec3d index = grid->worldToIndex(openvdb::Vec3d(point.x, point.y, point.z));
        return double(grid->tree().getValue(openvdb::Coord::round(index)));
    }
};

std::vector<std::string> corpus() {
    std::vector<std::string> names;
    const auto any = test::corpusMesh("SOURCES.md");
    if (!any) return names;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(any->parent_path()))
        if (entry.is_regular_file() && entry.path().extension() != ".md")
            names.push_back(std::filesystem::relative(entry.path(), any->parent_path()).string());
    std::sort(names.begin(), names.end());
    return names;
}

// Counts voxels that are NaN, active outside the band, or inactive with a value other than a width. A distance just
// within the band may round to its width.
std::size_t countOddValues(const Built& built) {
    const float out = built.field.exteriorWidth(), in = -built.field.interiorWidth();
    std::size_t odd = 0;
    for (auto value = built.grid->cbeginValueAll(); value; ++value)
        odd += !std::isfinite(*value) ||
               !(value.isValueOn() ? *value >= in && *value <= out : *value == in || *value == out);
    return odd;
}

// Counts neighbours of different sides whose distances leave no room for the surface between them.
std::size_t countBridges(const Built& built) {
    const double h = built.field.voxelSize();
    auto voxels = built.grid->getConstAccessor();
    std::size_t bridges = 0;
    for (auto leaf = built.grid->tree().cbeginLeaf(); leaf; ++leaf)
        for (auto voxel = leaf->cbeginValueAll(); voxel; ++voxel)
            for (int k = 0; k < 6; ++k) {
                openvdb::Coord next = voxel.getCoord();
                next[k / 2] += k % 2 ? 1 : -1;
                const double here = *voxel, there = voxels.getValue(next);
                bridges += (here < 0) != (there < 0) && std::abs(here) + std::abs(there) > h * (1 + slack);
            }
    return bridges;
}

// Random active voxels, limited by the cost of brute force.
std::vector<openvdb::Coord> someVoxels(const Built& built, std::size_t triangles, std::mt19937& random) {
    std::vector<openvdb::Coord> all;
    for (auto voxel = built.grid->cbeginValueOn(); voxel; ++voxel) all.push_back(voxel.getCoord());
    std::shuffle(all.begin(), all.end(), random);
    all.resize(std::min(all.size(), std::clamp<std::size_t>(work / triangles, 5, 300)));
    return all;
}

glm::dvec3 centre(const Built& built, const openvdb::Coord& voxel) {
    const openvdb::Vec3d world = built.grid->indexToWorld(voxel);
    return {world.x(), world.y(), world.z()};
}

void checkDistances(const Mesh& mesh, const Built& built, const std::vector<openvdb::Coord>& voxels) {
    double worst = 0;
    for (const auto& voxel : voxels)
        worst = std::max(worst, std::abs(std::abs(double(built.grid->tree().getValue(voxel))) -
                                         test::distance(mesh, centre(built, voxel))));
    CHECK(worst <= exactness * double(built.field.voxelSize()));
}

// Compares with the winding numbers of the mesh as built, which may have flipped triangles.
void checkWinding(const Mesh& mesh, const Built& built, const std::vector<openvdb::Coord>& voxels) {
    const SignChoice choice = balanced(mesh) ? chooseSignAfterConflict(mesh) : chooseSign(mesh);
    const Mesh& oriented = choice.repaired ? *choice.repaired : mesh;
    std::size_t wrong = 0;
    for (const auto& voxel : voxels) {
        const double value = built.grid->tree().getValue(voxel);
        const double winding = test::windingNumber(oriented, centre(built, voxel));
        const bool either =
            std::abs(winding - 0.5) < 1e-6 || std::abs(value) < exactness * double(built.field.voxelSize());
        wrong += !either && (value < 0) != (winding > 0.5);
    }
    CHECK(wrong == 0);
}

}  // namespace

TEST_CASE("every public mesh has a sensible field or is refused by name") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    const std::vector<std::string> refused = {"formats/empty.obj", "formats/ply_empty_bin.ply",
                                              "formats/stl_empty_bin.stl"};
    const std::vector<std::string> names = corpus();
    if (names.empty()) return;
    CHECK(names.size() == 107);
    for (const std::string& name : names) {
        CAPTURE(name);
        const auto path = *test::corpusMesh(name);
        if (std::find(refused.begin(), refused.end(), name) != refused.end()) {
            CHECK_THROWS_WITH(readMesh(path), Catch::Contains(path.filename().string()));
            continue;
        }
        const Mesh mesh = readMesh(path);
        const Built built(mesh);
        CAPTURE(built.sign, built.reason);
        CHECK_FALSE(built.reason.empty());
        CHECK(countOddValues(built) == 0);
        CHECK(built.at(bounds(mesh).lower - 0.5f * bounds(mesh).size()) == double(built.field.exteriorWidth()));
        // sides change only at the surface, except for lids over holes
        if (built.sign == "normals") CHECK(countBridges(built) == 0);
        const auto voxels = someVoxels(built, mesh.triangles.size(), random);
        checkDistances(mesh, built, voxels);
        if (built.sign == "winding") checkWinding(mesh, built, voxels);
    }
}

TEST_CASE("public meshes get their signs in the way that suits them") {
    struct Case {
        const char *name, *sign, *reason;
        float voxels = 48;
    };
    const char *closed = "closed and oriented", *meets = "intersects itself", *open = "boundary edge";
    for (const Case& c :
         {Case{"fandisk.obj", "normals", closed}, Case{"cgal-cheese.off", "normals", closed},
          Case{"casting_inverted.off", "normals", "flipped"}, Case{"cgal-cube-shuffled.off", "normals", "flipped"},
          Case{"cgal-blobby-shuffled.off", "normals", "flipped"}, Case{"cow.obj", "winding", meets, 128},
          Case{"cgal-bones.off", "winding", meets, 128}, Case{"bunny_5k_open.obj", "winding", open},
          Case{"cgal-elephant-with-holes.off", "winding", open}, Case{"suzanne.obj", "winding", open},
          Case{"teapot.obj", "winding", open}, Case{"cgal-three_knives.off", "winding", "unbalanced"},
          // so coarse that only voxels within leaves contradict each other
          Case{"cow.obj", "winding", meets, 24}, Case{"cgal-bones.off", "winding", meets, 40},
          Case{"self_intersectA.obj", "winding", meets, 40}, Case{"moebius.obj", "flood", "one side only"},
          Case{"soup.stl", "flood", "only"}, Case{"mp_chair.off", "flood", "only"},
          Case{"leoTest1.obj", "flood", "only"}, Case{"many_small_holes.ply", "flood", "only"}}) {
        const auto path = test::corpusMesh(c.name);
        if (!path) return;
        const Built built(readMesh(*path), c.voxels);
        CAPTURE(c.name, built.reason);
        CHECK(built.sign == c.sign);
        CHECK_THAT(built.reason, Catch::Contains(c.reason));
    }
}

TEST_CASE("solids that overlap inside one block are noticed") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    const auto any = [&](float low, float high) { return std::uniform_real_distribution<float>(low, high)(random); };
    for (int round = 0; round < 50; ++round) {
        // one solid protrudes 2.5 voxels from the other: room for sign propagation between voxels over the faces of
        // both
        const Mesh solid = shapes::box({1, 2.4f, 2.4f});
        const Mesh other = shapes::moved(shapes::box({1.75f, any(1.9f, 2.1f), any(1.9f, 2.1f)}), {1.75f, 0, 0});
        const glm::vec3 block(8 * int(random() % 9), 8 * int(random() % 9), 8 * int(random() % 9));
        const glm::vec3 middle = block + glm::vec3(any(2.2f, 2.8f), any(3.2f, 3.8f), any(3.2f, 3.8f));
        const Mesh mesh = shapes::moved(shapes::join({solid, other}), middle);
        for (const Method method : {Method::exact, Method::pseudonormal}) {
            CAPTURE(round, middle.x, middle.y, middle.z, method);
            CHECK(build(mesh, {.voxelSize = 1, .method = method, .sign = Sign::normals}).signConflicts() > 0);
            CHECK(build(mesh, {.voxelSize = 1, .method = method}).sign() == "winding");
        }
    }
}

TEST_CASE("A mesh inside out is flipped at any position") {
    const Mesh ball = shapes::sphere(1, 3);
    // at the origin its field spreads over eight of the tree's largest nodes, elsewhere over one
    for (const glm::vec3 by : {glm::vec3(0), glm::vec3(5, 6, 7), glm::vec3(0, 40, 0), glm::vec3(-9, 3, -4)}) {
        const Built built(shapes::flipped(shapes::moved(ball, by)));
        CAPTURE(by.x, by.y, by.z, built.reason);
        CHECK(built.sign == "normals");
        CHECK(built.at(by) < 0);
        CHECK(built.at(by + glm::vec3(3, 0, 0)) > 0);
        CHECK(built.at(by + glm::vec3(0, 0.95f, 0)) < 0);
        CHECK(built.at(by + glm::vec3(0, 0, -1.05f)) > 0);
    }
}

TEST_CASE("The double layer method reports where faces lie back to back") {
    Mesh mesh = shapes::sphere(1, 3);
    const auto undecided = [&] {
        const LevelSet field = build(mesh, {.voxelSize = 0.1f, .method = Method::doubleLayer});
        const auto voxels = field.grids().distance->metaValue<std::int64_t>(metadata::signUndecided);
        return double(voxels) / double(field.activeVoxels());
    };
    CHECK(undecided() < 0.01);
    const std::vector<glm::uvec3> front = mesh.triangles;
    for (const glm::uvec3& t : front) mesh.triangles.push_back({t.x, t.z, t.y});
    CHECK(undecided() > 0.5);
}

TEST_CASE("Of two components, only the one inside out is flipped") {
    const Mesh ball = shapes::sphere(1, 3);
    for (const glm::vec3 axis : {glm::vec3(1, 0, 0), glm::vec3(0, 1, 0), glm::vec3(0, 0, 1)})
        for (const float apart : {1.5f, 8.f}) {
            const glm::vec3 by = apart * axis + glm::vec3(2, 2, 2) * (glm::vec3(1) - axis);
            const Mesh pair =
                shapes::join({shapes::moved(ball, by), shapes::flipped(shapes::moved(ball, by - 2 * apart * axis))});
            const Built built(pair, 100);
            CAPTURE(axis.x, axis.y, axis.z, apart, built.reason);
            CHECK(built.sign == "normals");
            CHECK(built.at(by) < 0);
            CHECK(built.at(by - 2 * apart * axis) < 0);
            CHECK(built.at(by - apart * axis) > 0);
        }
}
}  // namespace bilayer::defective_meshes_test
