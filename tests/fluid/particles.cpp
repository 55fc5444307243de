#include "integration/fluid/particles.h"

#include <openvdb/points/PointCount.h>
#include <openvdb/tools/LevelSetSphere.h>
#include <tbb/global_control.h>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>
#include <set>

using namespace bilayer;
using openvdb::FloatGrid;

namespace {

// Large enough to have interior tiles.
FloatGrid::Ptr sphere() {
    return openvdb::tools::createLevelSetSphere<FloatGrid>(1.0f, openvdb::Vec3f(0.3f, -0.2f, 0.1f), 0.03f, 3);
}

const glm::vec3 centre(0.3f, -0.2f, 0.1f);

}  // namespace

TEST_CASE("particles lie inside, and as many as the volume asks for") {
    const auto liquid = sphere();
    const int perVoxel = GENERATE(1, 8);
    const auto found = fluid::particles(*liquid, {.perVoxel = perVoxel});
    float farthest = 0;
    glm::dvec3 mean(0);
    for (const glm::vec3& p : found) {
        farthest = std::max(farthest, glm::length(p - centre));
        mean += glm::dvec3(p);
    }
    CHECK(farthest < 1.0f + 0.002f);
    CHECK(farthest > 0.97f);
    const double expected = perVoxel * 4.0 / 3.0 * 3.14159265 / (0.03 * 0.03 * 0.03);
    CHECK(double(found.size()) == Approx(expected).epsilon(0.01));
    CHECK(glm::length(mean / double(found.size()) - glm::dvec3(centre)) < 0.01);
}

TEST_CASE("the same seed gives the same particles for any number of threads") {
    const auto liquid = sphere();
    const auto all = fluid::particles(*liquid, {.perVoxel = 2, .seed = 5});
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    CHECK(fluid::particles(*liquid, {.perVoxel = 2, .seed = 5}) == all);
    CHECK(fluid::particles(*liquid, {.perVoxel = 2, .seed = 6}) != all);
    std::set<std::tuple<float, float, float>> different;
    for (const glm::vec3& p : all) different.emplace(p.x, p.y, p.z);
    CHECK(different.size() > all.size() * 999 / 1000);
}

TEST_CASE("the points grid holds all particles") {
    const auto liquid = sphere();
    const auto grid = fluid::particleGrid(*liquid, {.perVoxel = 2});
    CHECK(grid->getName() == "particles");
    CHECK(openvdb::points::pointCount(grid->tree()) == fluid::particles(*liquid, {.perVoxel = 2}).size());
    CHECK(grid->transform() == liquid->transform());
}

TEST_CASE("no liquid, no particles; no level set, an error") {
    CHECK(fluid::particles(*openvdb::createLevelSet<FloatGrid>(0.1f, 3)).empty());
    CHECK_THROWS_AS(fluid::particles(*sphere(), {.perVoxel = 0}), std::invalid_argument);
    CHECK_THROWS_AS(fluid::particles(*sphere(), {.perVoxel = 1001}), std::invalid_argument);
    auto fog = sphere();
    fog->setGridClass(openvdb::GRID_FOG_VOLUME);
    CHECK_THROWS_AS(fluid::particles(*fog), std::invalid_argument);
}
