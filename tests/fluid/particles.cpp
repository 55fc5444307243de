// SPDX-License-Identifier: Apache-2.0
#include <bilayer/integration/fluid/particles.h>

#include <openvdb/points/AttributeArray.h>
#include <openvdb/points/PointCount.h>
#include <openvdb/tools/LevelSetSphere.h>
#include <tbb/global_control.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <limits>
#include <set>

#include <bilayer/sdf/build.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"

namespace bilayer::particles_test {
using openvdb::FloatGrid;
using openvdb::math::Transform;

namespace {

// Large enough to have interior tiles.
FloatGrid::Ptr sphere() {
    return openvdb::tools::createLevelSetSphere<FloatGrid>(1.0f, openvdb::Vec3f(0.3f, -0.2f, 0.1f), 0.03f, 3);
}

const glm::vec3 centre(0.3f, -0.2f, 0.1f);

double ball(double radius) {
    return 4 * glm::pi<double>() / 3 * radius * radius * radius;
}

// A ball's outermost layer, a third of a particle voxel thick.
constexpr float outer = 0.5f, inner = 0.467f, wideVoxel = 0.1f;

Field shell() {
    const Mesh mesh = shapes::join({shapes::sphere(outer, 5), shapes::flipped(shapes::sphere(inner, 5))});
    return Field(build(mesh, {.voxelSize = 0.02f}), mesh);
}

}  // namespace

TEST_CASE("particles lie inside, and as many as the volume asks for") {
    const auto liquid = sphere();
    const int perVoxel = GENERATE(1, 8);
    const auto found = fluid::particles(*liquid, {.perVoxel = perVoxel});
    CHECK(found.velocities.empty());
    float farthest = 0;
    glm::dvec3 mean(0);
    for (const glm::vec3& p : found.positions) {
        farthest = std::max(farthest, glm::length(p - centre));
        mean += glm::dvec3(p);
    }
    CHECK(farthest < 1.0f + 0.002f);
    CHECK(farthest > 0.97f);
    CHECK(double(found.positions.size()) == Approx(perVoxel * ball(1) / (0.03 * 0.03 * 0.03)).epsilon(0.01));
    CHECK(glm::length(mean / double(found.positions.size()) - glm::dvec3(centre)) < 0.01);
}

TEST_CASE("particles of a body stay on their side of walls thinner than a voxel") {
    const Field body = shell();
    const auto voxels = Transform::createLinearTransform(wideVoxel);
    const glm::vec3 scale = GENERATE(glm::vec3(1), glm::vec3(1, 0.7f, 1.4f));
    const fluid::Placement placement({centre, glm::angleAxis(0.7f, glm::normalize(glm::vec3(1, 2, -1)))}, scale);
    const auto found = fluid::particles(body, placement, *voxels, {.perVoxel = 100});
    int outside = 0;
    for (const glm::vec3& p : found.positions) {
        const float r = glm::length(glm::conjugate(placement.pose.rotation) * (p - centre) / scale);
        // chords of the sphere's triangles lie below it by 1e-3 of its radius
        outside += !(r < outer + 1e-5f && r > inner - 1e-3f);
    }
    CHECK(outside == 0);
    const double volume = (ball(outer) - ball(inner)) * double(scale.x * scale.y * scale.z);
    CHECK(double(found.positions.size()) == Approx(100 * volume / std::pow(double(wideVoxel), 3)).epsilon(0.03));
}

TEST_CASE("particles of a film that the field's voxels hardly know") {
    // 0.3 voxels thin, between two layers of voxels, and with solver voxels of a quarter of the size
    const float h = 0.04f, half = 0.15f * h, solver = h / 4;
    Mesh film = shapes::box({0.4f, 0.4f, half});
    for (glm::vec3& p : film.points) p.z += h / 2;
    const Field body(build(film, {.voxelSize = h}), film);
    const auto found = fluid::particles(body, {}, *Transform::createLinearTransform(solver), {.perVoxel = 8});
    const double volume = 0.8 * 0.8 * 2 * double(half);
    CHECK(double(found.positions.size()) == Approx(8 * volume / std::pow(double(solver), 3)).epsilon(0.03));
}

TEST_CASE("particles are inside as they are rounded") {
    const double far = 1e5;  // floats are 0.25 voxels apart there
    const auto liquid = sphere();
    liquid->transform().postTranslate({far, 0, 0});
    int outside = 0;
    for (const glm::vec3& p : fluid::particles(*liquid, {.perVoxel = 2}).positions) {
        const openvdb::Vec3d index = liquid->worldToIndex({p.x, p.y, p.z});
        outside += !(openvdb::tools::BoxSampler::sample(liquid->tree(), index) < 0);
    }
    CHECK(outside == 0);
    const Mesh mesh = shapes::sphere(0.5f, 4);
    const Field body(build(mesh, {.voxelSize = 0.05f}), mesh);
    const Pose pose{glm::vec3(float(far), 0, 0)};
    const auto found = fluid::particles(body, pose, liquid->transform(), {.perVoxel = 2}).positions;
    CHECK(found.size() > 10000);
    for (const glm::vec3& p : found) outside += !body.inside(p - pose.position);
    CHECK(outside == 0);
}

TEST_CASE("the same seed gives the same particles for any number of threads") {
    const auto liquid = sphere();
    const Field body = shell();
    const auto voxels = Transform::createLinearTransform(wideVoxel);
    const auto all = fluid::particles(*liquid, {.perVoxel = 2, .seed = 5}).positions;
    const auto ofBody = fluid::particles(body, {}, *voxels).positions;
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    CHECK(fluid::particles(*liquid, {.perVoxel = 2, .seed = 5}).positions == all);
    CHECK(fluid::particles(*liquid, {.perVoxel = 2, .seed = 6}).positions != all);
    CHECK(fluid::particles(body, {}, *voxels).positions == ofBody);
    std::set<std::tuple<float, float, float>> different;
    for (const glm::vec3& p : all) different.emplace(p.x, p.y, p.z);
    CHECK(different.size() > all.size() * 999 / 1000);
}

TEST_CASE("the points grid holds all particles, each with its velocity") {
    const auto liquid = sphere();
    const auto turning = [](const glm::vec3& p) { return glm::vec3(-p.y, p.x, 2); };
    const auto found = fluid::particles(*liquid, {.perVoxel = 2, .velocity = turning});
    REQUIRE(found.velocities.size() == found.positions.size());
    const auto grid = fluid::particleGrid(found, liquid->transform());
    CHECK(grid->getName() == "particles");
    CHECK(openvdb::points::pointCount(grid->tree()) == found.positions.size());
    CHECK(grid->transform() == liquid->transform());
    float farthest = 0;
    for (auto leaf = grid->tree().cbeginLeaf(); leaf; ++leaf) {
        const openvdb::points::AttributeHandle<openvdb::Vec3f> places(leaf->constAttributeArray("P")),
            velocities(leaf->constAttributeArray("v"));
        for (auto i = leaf->beginIndexOn(); i; ++i) {
            const openvdb::Vec3d p = grid->indexToWorld(i.getCoord().asVec3d() + places.get(*i));
            const openvdb::Vec3f v = velocities.get(*i);
            const glm::vec3 expected = turning({float(p.x()), float(p.y()), float(p.z())});
            farthest = std::max(farthest, glm::distance(expected, {v.x(), v.y(), v.z()}));
        }
    }
    CHECK(farthest < 1e-5f);
    CHECK_FALSE(
        fluid::particleGrid({found.positions, {}}, liquid->transform())->tree().cbeginLeaf()->hasAttribute("v"));
}

TEST_CASE("no liquid, no particles; no level set, an error") {
    CHECK(fluid::particles(*openvdb::createLevelSet<FloatGrid>(0.1f, 3)).positions.empty());
    CHECK_THROWS_AS(fluid::particles(*sphere(), {.perVoxel = 0}), std::invalid_argument);
    CHECK_THROWS_AS(fluid::particles(*sphere(), {.perVoxel = 1001}), std::invalid_argument);
    auto fog = sphere();
    fog->setGridClass(openvdb::GRID_FOG_VOLUME);
    CHECK_THROWS_AS(fluid::particles(*fog), std::invalid_argument);
    const Field body = shell();
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const auto voxels = Transform::createLinearTransform(wideVoxel), tiny = Transform::createLinearTransform(1e-4);
    CHECK_THROWS_AS(fluid::particles(body, Pose{glm::vec3(nan)}, *voxels), std::invalid_argument);
    CHECK_THROWS_AS(fluid::particles(body, {{}, {1, -1, 1}}, *voxels), std::invalid_argument);
    CHECK_THROWS_AS(fluid::particles(body, {{}, glm::vec3(100)}, *tiny), std::invalid_argument);
}
}  // namespace bilayer::particles_test
