// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/liquid.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <glm/geometric.hpp>
#include <optional>

#include <bilayer/integration/fluid/particles.h>
#include <bilayer/integration/fluid/seed.h>
#include <bilayer/sdf/inspect.h>
#include "demos/scenes/bowl.h"
#include "demos/shared/exact_distance.h"
#include "demos/shared/shapes.h"
#include "demos/shared/surface_of.h"
#include "demos/shared/water.h"
#include "sdf/base/openvdb.h"

namespace bilayer::demo {
namespace {

using openvdb::FloatGrid;

// Dimensions of the tank, relative to its length of one metre; heights and widths are rounded to whole cells.
constexpr float length = 1, width = 0.6f, height = 0.75f, pool = 0.2f;
constexpr float bunnySize = 0.36f, bunnyHeight = 0.55f;  // longest side; height of its centre [m]
constexpr float knotRadius = 0.14f, knotThickness = 0.045f, knotHeight = 0.16f;  // [m]
constexpr float obstacleHalfWidthVoxels = 6;  // half width of the knot's band [voxels]
constexpr float maxCells = 2;                 // max movement of the liquid per step
constexpr float glass = 0.012f;               // thickness of the tank's walls [m]
constexpr float glassGap = 0.002f;            // between the liquid and the displayed walls [m]
constexpr float pictureTime = 0.4f;           // time of the still picture [s]
constexpr double fullAngle = 6.283185307;

constexpr double maxError = 3, maxFinalError = 1;  // of the volume [%]
constexpr double maxDepth = 0.25;                  // of the liquid's surface inside the knot, anywhere [voxels]
constexpr double maxWithin = 0.05;                 // of the liquid inside the knot, averaged over its surface [voxels]
constexpr double maxDivergence = 1e-3;             // per step [parts of a cell]

constexpr Look waterLook{.colour = 0x1b6fa3, .roughness = 0.05f, .opacity = 0.7f, .clear = true};
constexpr Look glassLook{.colour = 0xdfeef2, .roughness = 0.02f, .opacity = 0.06f, .clear = true};
constexpr Look knotLook{.colour = 0xe07a5f, .roughness = 0.4f, .clearcoat = 0.5f};

struct Tank {
    openvdb::Coord cells;
    float voxel;
    openvdb::math::Transform::Ptr transform;

    explicit Tank(int resolution)
        : cells(resolution, int(std::lround(width * float(resolution))), int(std::lround(height * float(resolution)))),
          voxel(length / float(resolution)),
          transform(openvdb::math::Transform::createLinearTransform(double(voxel))) {}

    /// The corner of the first cell, and the opposite corner [m].
    glm::vec3 lower() const { return glm::vec3(-0.5f * voxel); }
    glm::vec3 upper() const { return lower() + voxel * glm::vec3(cells.x(), cells.y(), cells.z()); }
    glm::vec3 at(float x, float y, float z) const { return lower() + glm::vec3(x, y, z); }
};

Mesh boxBetween(const glm::vec3& lower, const glm::vec3& upper) {
    return shapes::moved(shapes::box(0.5f * (upper - lower)), 0.5f * (upper + lower));
}

// Makes four walls and a floor around the liquid.
Mesh glassOf(const Tank& tank) {
    const glm::vec3 a = tank.lower() - glassGap, b = tank.upper() + glassGap, c = a - glass, d = b + glass;
    return shapes::join({boxBetween({c.x, c.y, c.z}, {d.x, d.y, a.z}), boxBetween({c.x, c.y, a.z}, {a.x, d.y, b.z}),
                         boxBetween({b.x, c.y, a.z}, {d.x, d.y, b.z}), boxBetween({a.x, c.y, a.z}, {b.x, a.y, b.z}),
                         boxBetween({a.x, b.y, a.z}, {b.x, d.y, b.z})});
}

FloatGrid::Ptr startOf(const Tank& tank) {
    const FloatGrid::Ptr liquid = openvdb::createLevelSet<FloatGrid>(double(tank.voxel));
    const glm::vec3 beyond(8 * tank.voxel);
    fluid::seed(*liquid, boxBetween(tank.lower() - beyond,
                                    {tank.upper().x + beyond.x, tank.upper().y + beyond.y, tank.lower().z + pool}));
    const Mesh mesh = bunny().mesh;
    const float scale = bunnySize / bounds(mesh).longestSide();
    const glm::vec3 centre = tank.at(0.5f * length, 0.5f * width, bunnyHeight);
    fluid::seed(*liquid, mesh, {Pose{centre - scale * bounds(mesh).centre()}, glm::vec3(scale)});
    return liquid;
}

// The knot, which rotates about the vertical axis.
struct Knot {
    Mesh mesh = shapes::torusKnot(2, 3, knotRadius, knotThickness, 400, 32);
    ExactDistance distance{mesh};
    glm::vec3 centre;
    float turns;  // revolutions per second

    Pose poseAt(double time) const {
        return {centre, glm::angleAxis(float(fullAngle * turns * time), glm::vec3(0, 0, 1))};
    }
    fluid::Solid at(double time, const Tank& tank) const {
        return fluid::solid(
            mesh, poseAt(time), *tank.transform,
            {.velocity = {{}, {0, 0, float(fullAngle * turns)}}, .halfWidthVoxels = obstacleHalfWidthVoxels});
    }
    // Returns the distance to the knot, negative inside; far away it is a bound [m].
    double from(const glm::vec3& point, const Pose& pose) const {
        const double away = double(glm::distance(point, centre)) - glm::length(distance.upper());
        return away > 0 ? away : distance(glm::dvec3(pose.toBody(point)));
    }
};

// The max errors over all frames.
struct Faults {
    double depth = 0;   // of the surface in the knot [m]
    double within = 0;  // of the liquid in the knot [parts of the volume]
    double beyond = 0;  // of the surface beyond the tank's walls [m]

    void observe(const FloatGrid& shape, const Mesh& surface, const Knot& knot, const Pose& pose, const Tank& tank) {
        for (const glm::vec3& p : surface.points) {
            depth = worse(depth, -knot.from(p, pose));
            const glm::vec3 out = glm::max(tank.lower() - p, p - tank.upper());
            beyond = worse(beyond, std::max({out.x, out.y, out.z}));
        }
        const std::vector<glm::vec3> drops = fluid::particles(shape, {.perVoxel = 2}).positions;
        const auto inside =
            std::count_if(drops.begin(), drops.end(), [&](const glm::vec3& p) { return knot.from(p, pose) < 0; });
        if (!drops.empty()) within = worse(within, double(inside) / double(drops.size()));
    }
};

class Scene {
  public:
    explicit Scene(const LiquidOptions& options)
        : options_(options),
          tank_(options.resolution),
          knot_{.centre = tank_.at(0.5f * length, 0.5f * width, knotHeight), .turns = options.turns},
          basin_(*tank_.transform, tank_.cells) {
        basin_.place(knot_.at(0, tank_));
        water_.emplace(*startOf(tank_), basin_, WaterOptions{.restoring = options.restoring});
        outcome_.title = "A liquid bunny falls into a tank";
        outcome_.voxelSize = tank_.voxel;
        outcome_.table.columns = {"time_s", "volume_m3", "restored_m3", "cells", "steps"};
        outcome_.recording = Recording(outcome_.title);
        outcome_.recording.addChanging(waterLook);
        outcome_.recording.addBody(outcome_.recording.addMesh(knot_.mesh), knotLook);
        outcome_.recording.addBody(outcome_.recording.addMesh(glassOf(tank_)), glassLook);
    }

    Outcome play() {
        keepFrame();
        for (int frame = 1; double(frame) <= options_.seconds * double(options_.framesPerSecond) + 1e-6; ++frame) {
            while (time_ < double(frame) / options_.framesPerSecond - 1e-9)
                step(double(frame) / options_.framesPerSecond - time_);
            keepFrame();
        }
        return finish();
    }

  private:
    // Advances one step, shorter than the time left until the next frame if the liquid is fast.
    void step(double left) {
        const auto start = std::chrono::steady_clock::now();
        const double reach = double(maxCells * tank_.voxel) / std::max(water_->fastest() + 9.81 * left, 1e-6);
        const double seconds = left / std::ceil(left / reach);
        if (options_.turns != 0) basin_.place(knot_.at(time_ + seconds, tank_));
        const Projection projection = water_->step(basin_, float(seconds));
        const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - start;
        time_ += seconds;
        cells_ = projection.cells;
        iterations_ += projection.iterations;
        failed_ += !projection.converged;
        divergence_ = worse(divergence_, projection.divergence * seconds);
        outcome_.stepMs.push_back(took.count());
    }

    void keepFrame() {
        const Mesh surface = surfaceOf(water_->shape());
        const Pose pose = knot_.poseAt(time_);
        faults_.observe(water_->shape(), surface, knot_, pose, tank_);
        outcome_.table.rows.push_back(
            {time_, water_->volume(), water_->restored(), double(cells_), double(outcome_.stepMs.size())});
        outcome_.fingerprint = outcome_.fingerprint * 31 + hash(surface);
        const std::vector<Pose> poses{pose, Pose{}};
        outcome_.recording.frame(time_, poses, std::vector<Mesh>{surface});
    }

    Outcome finish() {
        const auto& rows = outcome_.table.rows;
        const double first = rows.front()[1];
        Line measured{"volume", {}, {}}, restored{"given back, so far", {}, {}};
        double off = 0;
        for (const auto& row : rows) {
            off = worse(off, std::abs(100 * (row[1] / first - 1)));
            for (Line* line : {&measured, &restored}) line->x.push_back(row[0]);
            measured.y.push_back(100 * row[1] / first);
            restored.y.push_back(100 * row[2] / first);
        }
        outcome_.plots = {{fmt::format("{} cells a metre", options_.resolution),
                           "s",
                           "% of the first volume",
                           {},
                           {measured, restored},
                           true}};
        const auto steps = double(outcome_.stepMs.size());
        outcome_.stepsPerSecond = float(steps / std::max(time_, 1e-9));
        outcome_.facts = {
            {"cells of liquid", fmt::format("{} in the end, of {:.1f} mm", cells_, 1e3 * double(tank_.voxel))},
            {"volume", fmt::format("{:.4f} litres at first, {:.4f} in the end", 1e3 * first, 1e3 * rows.back()[1])},
            {"liquid in the knot", fmt::format("{:.3f} % of the volume", 100 * faults_.within)},
            {"volume given back", fmt::format("{:.2f} % in all", 100 * rows.back()[2] / first)},
            {"iterations of the pressure", fmt::format("{:.0f} a step", double(iterations_) / steps)}};
        outcome_.criteria = {
            {"volume off by", off, maxError, "%"},
            {"volume off in the end", std::abs(100 * (rows.back()[1] / first - 1)), maxFinalError, "%"},
            {"surface in the knot", faults_.depth / double(tank_.voxel), maxDepth, "voxels"},
            {"liquid in the knot, in the mean", faults_.within * first / inspect(knot_.mesh).area / double(tank_.voxel),
             maxWithin, "voxels"},
            {"surface behind the walls", faults_.beyond / double(tank_.voxel), maxDepth, "voxels"},
            {"divergence left in a step", divergence_, maxDivergence},
            {"pressures not found", double(failed_), 0}};
        outcome_.recording.view = {.target = tank_.at(0.5f * length, 0.5f * width, 0.3f * height),
                                   .distance = 2.9f,
                                   .azimuth = -1.15f,
                                   .elevation = 0.42f,
                                   .groundHeight = tank_.lower().z - glassGap - glass,
                                   .moment = pictureTime};
        outcome_.recording.note("cells of liquid", std::to_string(cells_));
        outcome_.recording.note("time per step", fmt::format("{:.0f} ms", outcome_.medianStep()));
        return std::move(outcome_);
    }

    LiquidOptions options_;
    Tank tank_;
    Knot knot_;
    Basin basin_;
    std::optional<Water> water_;
    Outcome outcome_{Recording("")};
    Faults faults_;
    double time_ = 0, divergence_ = 0;
    long iterations_ = 0;
    int cells_ = 0, failed_ = 0;
};

}  // namespace

Outcome liquid(const LiquidOptions& options) {
    return Scene(options).play();
}

}  // namespace bilayer::demo
