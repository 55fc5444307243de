// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/enright.h"

#include <fmt/format.h>
#include <openvdb/tools/Diagnostics.h>
#include <openvdb/tools/LevelSetAdvect.h>
#include <openvdb/tools/LevelSetMeasure.h>
#include <openvdb/tools/LevelSetSphere.h>
#include <openvdb/tools/MeshToVolume.h>

#include <chrono>
#include <cmath>

#include <bilayer/integration/fluid/seed.h>
#include "demos/scenes/bowl.h"
#include "demos/shared/shapes.h"
#include "demos/shared/surface_of.h"
#include "sdf/base/openvdb.h"

namespace bilayer::demo {
namespace {

using openvdb::FloatGrid;

constexpr float radius = 0.15f;     // of the sphere; half of the bunny's longest side
constexpr glm::vec3 centre{0.35f};  // of both
constexpr double period = 3;        // until all bodies should be restored [s]
constexpr double pi = 3.14159265358979;
constexpr int sphereLevels = 6;      // the triangles are smaller than the voxels
constexpr float adaptivity = 0.02f;  // of the recorded surfaces
constexpr float cubeSpacing = 1.1f;  // between the two displayed cubes
constexpr double noise = 0.5;        // between the losses of two seeds [% of the volume]
constexpr float pictureTime = 0.9f;  // time of the still picture [s]

constexpr Look sphereLook{.colour = 0x3d87b8, .roughness = 0.25f, .clearcoat = 0.6f};
constexpr Look bunnyLook{.colour = 0xe07a5f, .roughness = 0.25f, .clearcoat = 0.6f};

using Field = openvdb::tools::DiscreteField<openvdb::Vec3SGrid>;
using Advection = openvdb::tools::LevelSetAdvection<FloatGrid, Field>;

// Returns the deformation flow at time zero, at each voxel of the unit cube.
openvdb::Vec3SGrid::Ptr deformationFlow(int resolution) {
    const auto grid = openvdb::Vec3SGrid::create(openvdb::Vec3f(0));
    grid->setTransform(openvdb::math::Transform::createLinearTransform(1.0 / resolution));
    const openvdb::tools::EnrightField<float> field;
    auto values = grid->getAccessor();
    for (const openvdb::Coord& at : openvdb::CoordBBox(openvdb::Coord(0), openvdb::Coord(resolution)))
        values.setValue(at, field(grid->indexToWorld(at), 0.f));
    return grid;
}

// The flow at time t is the initial flow times cos(pi t / period). Bodies are therefore where the initial flow alone
// moves them in the integral of that factor.
float flowIntegral(double time) {
    return float(period / pi * std::sin(pi * time / period));
}

// A seeded body that the flow deforms.
struct Advected {
    std::string name;
    FloatGrid::Ptr grid;
    std::unique_ptr<Advection> advection{};
    std::vector<double> volumes{};

    Advected(std::string name, FloatGrid::Ptr seeded, const openvdb::Vec3SGrid& velocity)
        : name(std::move(name)), grid(std::move(seeded)) {
        advection = std::make_unique<Advection>(*grid, Field(velocity));
        advection->setSpatialScheme(openvdb::math::HJWENO5_BIAS);
        advection->setTemporalScheme(openvdb::math::TVD_RK3);
        advection->setTrackerSpatialScheme(openvdb::math::HJWENO5_BIAS);
        advection->setTrackerTemporalScheme(openvdb::math::TVD_RK3);
        measure();
    }
    void measure() { volumes.push_back(grid->activeVoxelCount() ? openvdb::tools::levelSetVolume(*grid) : 0); }
    double lost() const { return 100 * (1 - volumes.back() / volumes.front()); }
};

FloatGrid::Ptr ours(const Mesh& mesh, float voxel) {
    const FloatGrid::Ptr grid = openvdb::createLevelSet<FloatGrid>(double(voxel));
    fluid::seed(*grid, mesh);
    return grid;
}

FloatGrid::Ptr openVdbs(const Mesh& mesh, float voxel) {
    std::vector<openvdb::Vec3s> points;
    std::vector<openvdb::Vec3I> triangles;
    for (const glm::vec3& p : mesh.points) points.emplace_back(p.x, p.y, p.z);
    for (const glm::uvec3& t : mesh.triangles) triangles.emplace_back(t.x, t.y, t.z);
    return openvdb::tools::meshToLevelSet<FloatGrid>(*openvdb::math::Transform::createLinearTransform(double(voxel)),
                                                     points, triangles);
}

Mesh moved(Mesh mesh, float scale, const glm::vec3& to) {
    const glm::vec3 from = bounds(mesh).centre();
    for (glm::vec3& p : mesh.points) p = scale * (p - from) + to;
    return mesh;
}

std::vector<Advected> seeded(const openvdb::Vec3SGrid& velocity) {
    const auto voxel = float(velocity.voxelSize()[0]);
    const Mesh mesh = bunny().mesh, ball = moved(shapes::sphere(radius, sphereLevels), 1, centre),
               scaledBunny = moved(mesh, 2 * radius / bounds(mesh).longestSide(), centre);
    std::vector<Advected> bodies;
    bodies.emplace_back("sphere", ours(ball, voxel), velocity);
    bodies.emplace_back("sphere by OpenVDB",
                        openvdb::tools::createLevelSetSphere<FloatGrid>(radius, {centre.x, centre.y, centre.z}, voxel),
                        velocity);
    bodies.emplace_back("bunny", ours(scaledBunny, voxel), velocity);
    bodies.emplace_back("bunny by OpenVDB", openVdbs(scaledBunny, voxel), velocity);
    return bodies;
}

// Whether OpenVDB's checkLevelSet() finds no fault, except for gradients.
bool isLevelSet(const FloatGrid& grid) {
    openvdb::tools::CheckLevelSet<FloatGrid> check(grid);
    return grid.getGridClass() == openvdb::GRID_LEVEL_SET &&
           (check.checkTiles() + check.checkFinite() + check.checkRange() + check.checkInactiveValues()).empty();
}

void keepFrame(Outcome& outcome, std::vector<Advected>& bodies, double time) {
    std::vector<double> row{time};
    for (Advected& body : bodies) row.push_back(body.volumes.back());
    outcome.table.rows.push_back(std::move(row));
    // both as seeded by us, side by side
    std::vector<Mesh> surfaces{surfaceOf(*bodies[0].grid, adaptivity), surfaceOf(*bodies[2].grid, adaptivity)};
    for (glm::vec3& p : surfaces[1].points) p.x += cubeSpacing;
    for (const Mesh& surface : surfaces) outcome.fingerprint = outcome.fingerprint * 31 + hash(surface);
    outcome.recording.frame(time, {}, surfaces);
}

void judge(Outcome& outcome, const std::vector<Advected>& bodies) {
    Panel panel{"volume", "s", "% of the first", {}, {}, true};
    int broken = 0;
    for (const Advected& body : bodies) {
        Line line{body.name, {}, {}};
        for (std::size_t i = 0; i < body.volumes.size(); ++i) {
            line.x.push_back(outcome.table.rows[i][0]);
            line.y.push_back(100 * body.volumes[i] / body.volumes[0]);
        }
        panel.lines.push_back(std::move(line));
        outcome.facts.emplace_back(
            body.name, fmt::format("{:.2f} % lost in the end, {} voxels", body.lost(), body.grid->activeVoxelCount()));
        broken += !isLevelSet(*body.grid);
    }
    outcome.plots = {std::move(panel)};
    outcome.facts.emplace_back("D. Enright et al. 2002, 100 voxels", "80 % by a level set alone, 2.6 % with particles");
    outcome.criteria = {{"sphere loses more than OpenVDB's", bodies[0].lost() - bodies[1].lost(), noise, "%"},
                        {"bunny loses more than OpenVDB's", bodies[2].lost() - bodies[3].lost(), noise, "%"},
                        {"results that are no level sets", double(broken), 0}};
}

}  // namespace

Outcome enright(const EnrightOptions& options) {
    const openvdb::Vec3SGrid::Ptr velocity = deformationFlow(options.resolution);
    Outcome outcome{Recording("A sphere and a bunny in Enright's deformation flow")};
    outcome.title = "A sphere and a bunny in Enright's deformation flow";
    outcome.voxelSize = 1.0 / options.resolution;
    outcome.table.columns = {"time_s", "sphere", "sphere_by_openvdb", "bunny", "bunny_by_openvdb"};
    outcome.recording.addChanging(sphereLook);
    outcome.recording.addChanging(bunnyLook);
    outcome.recording.view = {
        .target = {0.5f * (1 + cubeSpacing), 0.5f, 0.45f}, .distance = 3.2f, .elevation = 0.35f, .moment = pictureTime};

    std::vector<Advected> bodies = seeded(*velocity);
    keepFrame(outcome, bodies, 0);
    const int frames = int(std::lround(period * options.framesPerSecond));
    outcome.stepsPerSecond = float(options.framesPerSecond);
    for (int frame = 1; frame <= frames; ++frame) {
        const double before = double(frame - 1) / options.framesPerSecond,
                     after = double(frame) / options.framesPerSecond;
        const auto start = std::chrono::steady_clock::now();
        for (Advected& body : bodies) {
            body.advection->advect(flowIntegral(before), flowIntegral(after));
            body.measure();
        }
        const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - start;
        outcome.stepMs.push_back(took.count());
        keepFrame(outcome, bodies, after);
    }
    judge(outcome, bodies);
    return outcome;
}

}  // namespace bilayer::demo
