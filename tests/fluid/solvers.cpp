// SPDX-License-Identifier: Apache-2.0
// OpenVDB's own level set tools accept a seeded liquid unchanged: they measure its volume, keep it in place, and advect
// it.
#include <openvdb/tools/Diagnostics.h>
#include <openvdb/tools/LevelSetAdvect.h>
#include <openvdb/tools/LevelSetMeasure.h>
#include <openvdb/tools/LevelSetTracker.h>

#include <catch2/catch.hpp>
#include <cmath>

#include <bilayer/collider/mass.h>
#include <bilayer/integration/fluid/seed.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "tests/support/truth.h"

namespace bilayer::solvers_test {
using openvdb::FloatGrid;

namespace {

constexpr float h = 0.02f, fine = 0.008f;  // voxel sizes [m]

const fluid::Placement rotated(Pose{{0.11f, -0.07f, 0.23f},
                                    glm::angleAxis(0.8f, glm::normalize(glm::vec3(1, -2, 0.5f)))});

Mesh placed(Mesh mesh, const fluid::Placement& placement) {
    for (glm::vec3& p : mesh.points) p = glm::vec3(placement.toWorld(p));
    return mesh;
}

FloatGrid::Ptr seeded(const Mesh& mesh, float voxelSize = h) {
    const auto liquid = openvdb::createLevelSet<FloatGrid>(voxelSize, 3);
    fluid::seed(*liquid, mesh, rotated);
    return liquid;
}

// Mean and maximum distance from a liquid's surface to a mesh, by the voxels next to it [voxels].
struct Distance {
    double mean = 0, largest = 0;
};

Distance distance(const FloatGrid& liquid, const Mesh& mesh) {
    const test::Truth truth(mesh);
    Distance result;
    int count = 0;
    for (auto v = liquid.cbeginValueOn(); v; ++v) {
        if (!(std::abs(*v) < h)) continue;
        const openvdb::Vec3d p = liquid.indexToWorld(v.getCoord());
        const double error = std::abs(double(*v) - truth.signedDistance({p.x(), p.y(), p.z()})) / double(h);
        result.mean += error;
        result.largest = std::max(result.largest, error);
        ++count;
    }
    result.mean /= count;
    return result;
}

// A uniform velocity field.
struct Stream {
    using VectorType = openvdb::Vec3f;
    openvdb::Vec3f velocity;
    const openvdb::math::Transform& transform() const { return transform_; }
    openvdb::Vec3f operator()(const openvdb::Vec3d&, float) const { return velocity; }
    openvdb::Vec3f operator()(const openvdb::Coord&, float) const { return velocity; }
    openvdb::math::Transform transform_{};
};

}  // namespace

TEST_CASE("LevelSetMeasure finds volume and area of a seeded body") {
    const Mesh mesh = shapes::torus(0.5f, 0.2f, 120, 60);
    const auto liquid = seeded(mesh, fine);  // its own error is of second order: 0.2 % for a ring of ten voxels' radius
    openvdb::tools::LevelSetMeasure<FloatGrid> measure(*liquid);
    CHECK(measure.volume() == Approx(massProperties(mesh).volume).epsilon(1e-3));
    double area = 0;
    for (const glm::uvec3& t : mesh.triangles)
        area +=
            0.5 *
            double(glm::length(glm::cross(mesh.points[t.y] - mesh.points[t.x], mesh.points[t.z] - mesh.points[t.x])));
    CHECK(measure.area() == Approx(area).epsilon(1e-3));
}

TEST_CASE("LevelSetTracker has nothing to repair") {
    const Mesh mesh = shapes::torus(0.5f, 0.2f, 120, 60);
    const auto liquid = seeded(mesh);
    const openvdb::Index64 voxels = liquid->activeVoxelCount();
    openvdb::tools::LevelSetTracker<FloatGrid> tracker(*liquid);
    tracker.track();
    const Distance after = distance(*liquid, placed(mesh, rotated));
    CHECK(after.mean < 0.01);
    CHECK(after.largest < 0.05);
    CHECK(double(liquid->activeVoxelCount()) == Approx(double(voxels)).epsilon(0.03));
    CHECK(openvdb::tools::checkLevelSet(*liquid) == "");
}

TEST_CASE("LevelSetAdvection carries a seeded body away as it is") {
    const Mesh mesh = shapes::torus(0.5f, 0.2f, 120, 60);
    const auto liquid = seeded(mesh);
    const double volume = openvdb::tools::levelSetVolume(*liquid);
    const Stream stream{{0.31f, 0.17f, -0.23f}};
    openvdb::tools::LevelSetAdvection<FloatGrid, Stream> advection(*liquid, stream);
    advection.setTemporalScheme(openvdb::math::TVD_RK3);
    advection.advect(0, 1);  // 21 voxels
    fluid::Placement arrived = rotated;
    arrived.pose.position += glm::vec3(0.31f, 0.17f, -0.23f);
    const Distance after = distance(*liquid, placed(mesh, arrived));
    CHECK(after.mean < 0.02);
    CHECK(after.largest < 0.2);
    CHECK(openvdb::tools::levelSetVolume(*liquid) == Approx(volume).epsilon(2e-3));
    CHECK(openvdb::tools::checkLevelSet(*liquid) == "");
}
}  // namespace bilayer::solvers_test
