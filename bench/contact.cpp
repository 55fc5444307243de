// SPDX-License-Identifier: Apache-2.0
// Piles of bodies in Bullet: compares fields with the alternatives of its users, by speed, penetration and rest.
#include <BulletCollision/CollisionShapes/btBoxShape.h>
#include <fmt/format.h>
#include <oneapi/tbb/global_control.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <nlohmann/json.hpp>
#include <random>

#include <bilayer/cl/field.h>
#include "bench/measure.h"
#include "bench/pile.h"
#include "bench/program.h"
#include "demos/shared/outcome.h"
#include "demos/shared/plot.h"
#include "demos/shared/shapes.h"

using namespace bilayer;
using namespace bilayer::bench;
using demo::Line;
using demo::writeSvg;

namespace {

constexpr float knotSize = 0.2f;        // [m]
constexpr float spacing = 1;            // between bodies at the start [diagonal of their box]
constexpr int minPile = 20;             // bodies for a pen of two by two knots; its edge grows with the count
constexpr float wall = 0.1f;            // half of a wall's thickness [knots]
constexpr float penHeight = 5;          // [knots], for each knot along the floor
constexpr double sampleSpacing = 0.02;  // distance of the points at which penetration is measured [size of a body]
constexpr float bowlRadius = 0.5f, bowlWall = 0.05f;  // [m]
constexpr float bowlVoxels = 128, boxEdge = 0.1f;     // along the bowl; [m]
constexpr int bowlCells = 32, boxesInBowl = 60;
constexpr const char* oneThread = ", 1 thread";

struct Options {
    PileOptions pile;
    int bodies = 20, hulls = 20;
    float voxels = 64;
    std::vector<int> growBodies{10, 30, 100, 300, 1000};
    std::vector<float> growVoxels{32, 64, 128, 256};
    double growSeconds = 1.5;
    std::string plot, json;
    bool onDevice = false;
};

// With its centre of mass at the origin and its principal axes along x, y and z, as Bullet requires.
Mesh centred(Mesh mesh, float size) {
    const float scale = size / bounds(mesh).longestSide();
    for (glm::vec3& p : mesh.points) p *= scale;
    const MassProperties mass = massProperties(mesh);
    for (glm::vec3& p : mesh.points) p = glm::conjugate(mass.principalAxes) * (p - mass.centre);
    return mesh;
}

Mesh knot() {
    return centred(shapes::torusKnot(2, 3, 1, 0.3f, 180, 16), knotSize);
}

glm::quat anyRotation(std::mt19937& random) {
    std::normal_distribution<float> normal;
    const float x = normal(random), y = normal(random), z = normal(random), w = normal(random);
    return glm::normalize(glm::quat(w, x, y, z));
}

// Adds layers of `along` by `along` bodies, each with a random rotation.
void addLayers(std::vector<Member>& members, const Form& form, float mass, int bodies, int along, float lowest) {
    std::mt19937 random(7);
    const float step = spacing * glm::length(form.box.size());
    for (int i = 0; i < bodies; ++i) {
        const int layer = i / (along * along), place = i % (along * along);
        const auto at = [&](int k) { return step * (float(k) - 0.5f * float(along - 1)); };
        const glm::vec3 position(at(place / along), at(place % along), lowest + step * (float(layer) + 0.6f));
        members.push_back({&form, mass, {position, anyRotation(random)}});
    }
}

// A box as Bullet's shape and as a mesh for measuring.
struct BoxForm {
    explicit BoxForm(const glm::vec3& halfExtents)
        : shape(btVector3(halfExtents.x, halfExtents.y, halfExtents.z)),
          form(shapes::box(halfExtents), shape, sampleSpacing * double(knotSize)) {}
    btBoxShape shape;
    Form form;
};

// Knots in a pen of Bullet's boxes.
class Knots {
  public:
    Knots(const Mesh& mesh, Rival& rival, int bodies) : knot_(mesh, rival.shape(), sampleSpacing * double(knotSize)) {
        const int along = std::max(2, int(std::lround(2 * std::cbrt(float(bodies) / minPile))));
        const float thick = wall * knotSize, inside = 0.5f * spacing * glm::length(knot_.box.size()) * float(along),
                    out = inside + thick, halfHeight = 0.5f * penHeight * knotSize * float(along);
        addWall({0, 0, -thick}, {out + thick, out + thick, thick});
        for (const float side : {-1.f, 1.f}) {
            addWall({side * out, 0, halfHeight}, {thick, out + thick, halfHeight});
            addWall({0, side * out, halfHeight}, {inside, thick, halfHeight});
        }
        addLayers(members, knot_, 1, bodies, along, 0);
    }
    std::vector<Member> members;

  private:
    void addWall(const glm::vec3& centre, const glm::vec3& halfExtents) {
        walls_.push_back(std::make_unique<BoxForm>(halfExtents));
        members.push_back({&walls_.back()->form, 0, {centre}});
    }
    Form knot_;
    std::vector<std::unique_ptr<BoxForm>> walls_;
};

// Bullet's boxes in a static bowl.
class Boxes {
  public:
    Boxes(const Mesh& bowl, Rival& rival)
        : bowl_(bowl, rival.shape(), sampleSpacing * double(boxEdge)), box_(glm::vec3(boxEdge / 2)) {
        members.push_back({&bowl_});
        addLayers(members, box_.form, 1, boxesInBowl, 4, -0.5f * bowlRadius);
    }
    std::vector<Member> members;

  private:
    Form bowl_;
    BoxForm box_;
};

// The median of the second half of the steps.
double ofLaterSteps(const std::vector<double>& values) {
    return median({values.begin() + std::ptrdiff_t(values.size() / 2), values.end()});
}

// A row of a table.
struct Row {
    std::string name;
    double made;  // [s]
    PileRun run;

    double step() const { return ofLaterSteps(run.stepMs); }
    double part(double StepParts::*which) const {
        std::vector<double> values;
        for (const StepParts& parts : run.parts) values.push_back(parts.*which);
        return ofLaterSteps(values);
    }
    double penetration(double share) const { return 1e3 * demo::percentile(run.penetrations, share); }  // [mm]
    double restEnergy() const {
        const auto& all = run.kineticEnergy;
        return median({all.end() - std::ptrdiff_t((all.size() + 4) / 5), all.end()});
    }
};

void printTable(const std::string& title, const std::vector<Row>& rows) {
    fmt::print("\n## {}\n\n", title);
    fmt::print(
        "| collides by | made in [s] | simulated [s] | a step [ms] | as a multiple | 99 % of steps [ms] | "
        "99 % of penetrations [mm] | deepest [mm] | energy at the end [J] | restless at the end |\n");
    fmt::print("|---|---|---|---|---|---|---|---|---|---|\n");
    for (const Row& row : rows)
        fmt::print("| {} | {:.2f} | {:.1f} | {:.2f} | {:.1f} | {:.1f} | {:.2f} | {:.2f} | {:.1e} | {} |\n", row.name,
                   row.made, row.run.simulated, row.step(), row.step() / rows.front().step(),
                   demo::percentile(row.run.stepMs, 0.99), row.penetration(0.99), row.penetration(1), row.restEnergy(),
                   row.run.awakeBodies);
    std::fflush(stdout);
}

Row onOneThread(const std::function<Row()>& work) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
    Row row = work();
    row.name += oneThread;
    return row;
}

Row playKnots(Rival& rival, const Mesh& mesh, int bodies, const PileOptions& options) {
    const Knots knots(mesh, rival, bodies);
    return {rival.name(), rival.seconds, play(rival, knots.members, options)};
}

std::vector<Row> compareKnots(const Options& options) {
    const Mesh mesh = knot();
    const float voxel = knotSize / options.voxels;
    std::vector<Row> rows;
    const auto field = makeField(mesh, options.voxels);
    const auto ours = [&] { return playKnots(*field, mesh, options.bodies, options.pile); };
    rows.push_back(ours());
    rows.push_back(onOneThread(ours));
    for (const auto& rival : {makeField(mesh, options.voxels, {}, ContactAccuracy::samples),
                              makeField(mesh, options.voxels, {}, ContactAccuracy::exact),
                              makeHulls(mesh, options.hulls, 0.1f * voxel), makeGImpact(mesh, 0.5f * voxel)})
        rows.push_back(playKnots(*rival, mesh, options.bodies, options.pile));
    printTable(fmt::format("{} knots of {} triangles in a pen, {:g} voxels each, {:g} steps a second", options.bodies,
                           mesh.triangles.size(), options.voxels, options.pile.stepsPerSecond),
               rows);
    return rows;
}

std::vector<Row> compareBoxes(const Options& options) {
    const Mesh bowl = shapes::bowl(bowlRadius, bowlWall, 96);
    const float voxel = 2 * bowlRadius / bowlVoxels;
    std::vector<Row> rows;
    for (const auto& rival : {makeField(bowl, bowlVoxels), makeField(bowl, bowlVoxels, {}, ContactAccuracy::samples),
                              makeField(bowl, bowlVoxels, {}, ContactAccuracy::exact),
                              makeTriangles(bowl, 0.5f * voxel), makeBulletSdf(bowl, bowlCells)}) {
        const Boxes boxes(bowl, *rival);
        rows.push_back({rival->name(), rival->seconds, play(*rival, boxes.members, options.pile)});
    }
    printTable(fmt::format("{} of Bullet's boxes in a bowl of {} triangles", boxesInBowl, bowl.triangles.size()), rows);
    return rows;
}

struct Growth {
    Line bodies{"bilayer", {}, {}}, voxels{"bilayer", {}, {}};  // milliseconds per step
};

Growth grow(const Options& options) {
    const Mesh mesh = knot();
    PileOptions pile = options.pile;
    pile.seconds = options.growSeconds;
    Growth growth;
    fmt::print("\n## How the cost grows: {:g} s of knots\n\n", pile.seconds);
    fmt::print(
        "| bodies | voxels | a step [ms] | a step and body [ms] | broad phase [ms] | contacts [ms] | solver [ms] | "
        "contact points a body | 99 % of penetrations [voxels] |\n");
    fmt::print("|---|---|---|---|---|---|---|---|---|\n");
    const auto measure = [&](int bodies, float voxels) {
        const auto field = makeField(mesh, voxels);
        PileOptions how = pile;
        if (bodies > 100) how.measuredFrames = 4;  // a thousand bodies have thousands of pairs
        const Row row = playKnots(*field, mesh, bodies, how);
        const double deep = 1e-3 * row.penetration(0.99) * double(voxels) / double(knotSize);
        fmt::print("| {} | {:g} | {:.2f} | {:.3f} | {:.2f} | {:.2f} | {:.2f} | {:.1f} | {:.3f} |\n", bodies, voxels,
                   row.step(), row.step() / bodies, row.part(&StepParts::broadPhase), row.part(&StepParts::contacts),
                   row.part(&StepParts::solver), row.part(&StepParts::points) / bodies, deep);
        std::fflush(stdout);
        return row.step();
    };
    for (const int bodies : options.growBodies) {
        growth.bodies.x.push_back(bodies);
        growth.bodies.y.push_back(measure(bodies, options.voxels));
    }
    for (const float voxels : options.growVoxels) {
        growth.voxels.x.push_back(voxels);
        growth.voxels.y.push_back(measure(options.bodies, voxels));
    }
    return growth;
}

// Contact search on the device. The motion of the bodies is bitwise the same, so the steps are comparable.
void compareDevice(const Options& options) {
    const Mesh mesh = knot();
    PileOptions pile = options.pile;
    pile.seconds = options.growSeconds;
    pile.measuredFrames = 1;
    const Device device = openDevice();
    const PointSampler sampler = openclPointSampler(device, {.profile = true});
    const auto processor = makeField(mesh, options.voxels);
    const auto sampled = makeField(mesh, options.voxels, sampler);
    fmt::print("\n## Points sampled by {}: {:g} s of knots, {:g} voxels each\n\n", device.info().name, pile.seconds,
               options.voxels);
    fmt::print(
        "| bodies | a step, processor [ms] | a step, device [ms] | its kernels [ms] | transfers [ms] | energies "
        "that differ |\n|---|---|---|---|---|---|\n");
    for (const int bodies : options.growBodies) {
        const Row ours = playKnots(*processor, mesh, bodies, pile);
        const Row theirs = playKnots(*sampled, mesh, bodies, pile);
        const DeviceTimes& device = theirs.run.device;
        // a run that reaches its time limit has fewer steps
        const auto steps = std::min(ours.run.kineticEnergy.size(), theirs.run.kineticEnergy.size());
        const auto usual = [&](const Row& row) {
            const auto begin = row.run.stepMs.begin();
            return median({begin + std::ptrdiff_t(steps / 2), begin + std::ptrdiff_t(steps)});
        };
        int differing = 0;
        for (std::size_t i = 0; i < steps; ++i) differing += ours.run.kineticEnergy[i] != theirs.run.kineticEnergy[i];
        const double each = 1e3 / double(theirs.run.stepMs.size());
        fmt::print("| {} | {:.2f} | {:.2f} | {:.2f} | {:.2f} | {} |\n", bodies, usual(ours), usual(theirs),
                   each * device.kernels, each * (device.upload + device.download), differing);
        std::fflush(stdout);
    }
}

Line energyOf(const Row& row, double stepsPerSecond) {
    Line line{row.name, {}, {}};
    for (std::size_t i = 0; i < row.run.kineticEnergy.size(); i += 4)
        if (row.run.kineticEnergy[i] > 0) {
            line.x.push_back(double(i + 1) / stepsPerSecond);
            line.y.push_back(row.run.kineticEnergy[i]);
        }
    return line;
}

// Step time: medians of 0.1 s each.
Line stepTimeOf(const Row& row, double stepsPerSecond) {
    Line line{row.name, {}, {}};
    const auto steps = std::max<std::ptrdiff_t>(1, std::ptrdiff_t(stepsPerSecond / 10));
    const auto& all = row.run.stepMs;
    for (auto from = all.begin(); from != all.end();) {
        const auto to = from + std::min(steps, all.end() - from);
        line.x.push_back(double(to - all.begin()) / stepsPerSecond);
        line.y.push_back(median({from, to}));
        from = to;
    }
    return line;
}

void draw(const std::string& file, const std::vector<Row>& knots, const Growth& growth, const Options& options) {
    std::vector<Line> steps, energies, depths;
    for (const Row& row : knots) {
        if (row.name.ends_with(oneThread)) continue;  // energies and penetrations are bitwise the same
        steps.push_back(stepTimeOf(row, double(options.pile.stepsPerSecond)));
        energies.push_back(energyOf(row, double(options.pile.stepsPerSecond)));
        Line depth{row.name, {}, {}};
        for (const double share : {0.5, 0.75, 0.9, 0.95, 0.99, 1.}) {
            depth.x.push_back(100 * share);
            depth.y.push_back(std::max(1e-3, row.penetration(share)));
        }
        depths.push_back(depth);
    }
    // last, so that equal names have equal colours in all plots
    for (const Row& row : knots)
        if (row.name.ends_with(oneThread)) steps.push_back(stepTimeOf(row, double(options.pile.stepsPerSecond)));
    std::vector<double> bodies(options.growBodies.begin(), options.growBodies.end()),
        voxels(options.growVoxels.begin(), options.growVoxels.end());
    writeSvg(file,
             {{"a step", "s", "ms", {}, steps},
              {"kinetic energy", "s", "J", {}, energies},
              {"so many of 100 penetrations are below", "of 100", "mm", {50, 75, 100}, depths},
              {fmt::format("a step, {:g} voxels a body", options.voxels), "bodies", "ms", bodies, {growth.bodies}},
              {fmt::format("a step, {} bodies", options.bodies), "voxels a body", "ms", voxels, {growth.voxels}}});
}

nlohmann::json jsonOf(const std::vector<Row>& rows) {
    nlohmann::json all = nlohmann::json::array();
    for (const Row& row : rows)
        all.push_back({{"name", row.name},
                       {"madeSeconds", row.made},
                       {"simulatedSeconds", row.run.simulated},
                       {"stepMs", row.run.stepMs},
                       {"kineticEnergy", row.run.kineticEnergy},
                       {"penetrations", row.run.penetrations},
                       {"restless", row.run.awakeBodies}});
    return all;
}

int run(int argc, char** argv) {
    CLI::App app(
        "Piles of bodies in Bullet: fields compared with GImpact, convex hulls, triangles and Bullet's own SDF shape.");
    Options options;
    app.add_option("--bodies", options.bodies, "count of knots in the pen")
        ->capture_default_str()
        ->check(CLI::PositiveNumber);
    app.add_option("--voxels", options.voxels, "voxels along a knot")
        ->capture_default_str()
        ->check(CLI::Range(8., 1024.));
    app.add_option("--hulls", options.hulls, "count of hulls of the convex decomposition")
        ->capture_default_str()
        ->check(CLI::PositiveNumber);
    app.add_option("--seconds", options.pile.seconds, "simulated time of a pile [s]")
        ->capture_default_str()
        ->check(CLI::PositiveNumber);
    app.add_option("--steps-per-second", options.pile.stepsPerSecond, "steps per second")
        ->capture_default_str()
        ->check(CLI::PositiveNumber);
    app.add_option("--patience", options.pile.timeLimit, "maximum wall-clock time of a run [s]")->capture_default_str();
    app.add_option("--grow-bodies", options.growBodies, "counts of knots to try; 0: none")->capture_default_str();
    app.add_option("--grow-voxels", options.growVoxels, "voxels along a knot to try; 0: none")->capture_default_str();
    app.add_flag("--on-device", options.onDevice,
                 "only compare the knots of --grow-bodies with the same knots sampled by OpenCL");
    app.add_option("--plot", options.plot, "draws speed, energy and penetration into this SVG file");
    app.add_option("--json", options.json, "also write all numbers to this file");
    CLI11_PARSE(app, argc, argv);
    std::erase(options.growBodies, 0);
    std::erase(options.growVoxels, 0.f);

    if (options.onDevice) {
        compareDevice(options);
        return 0;
    }
    const std::vector<Row> knots = compareKnots(options), boxes = compareBoxes(options);
    const Growth growth = grow(options);
    if (!options.plot.empty()) draw(options.plot, knots, growth, options);
    if (!options.json.empty())
        std::ofstream(options.json) << nlohmann::json{{"knots", jsonOf(knots)}, {"boxes", jsonOf(boxes)}}.dump(1);
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    return program("contact", run, argc, argv);
}
