// SPDX-License-Identifier: Apache-2.0
// A block slides without friction over wavy triangles: by its field, and by Bullet's own shapes.
#include <BulletCollision/CollisionDispatch/btInternalEdgeUtility.h>
#include <BulletCollision/CollisionShapes/btBoxShape.h>
#include <BulletCollision/CollisionShapes/btBvhTriangleMeshShape.h>
#include <BulletCollision/CollisionShapes/btTriangleInfoMap.h>
#include <BulletCollision/Gimpact/btGImpactCollisionAlgorithm.h>
#include <BulletCollision/Gimpact/btGImpactShape.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "bench/measure.h"
#include "bench/program.h"
#include "demos/shared/shapes.h"
#include "demos/shared/stage.h"
#include "demos/shared/triangle_shape.h"
#include "demos/shared/waves.h"
#include "demos/shared/world.h"

using namespace bilayer;
using namespace bilayer::bench;

namespace {

constexpr glm::vec3 halfBlock{0.3f, 0.3f, 0.15f};  // [m]
constexpr float startX = -5, startY = 0.13f;       // [m]
constexpr float settled = 0.25f;                   // speeds are measured from this time on [s]
constexpr float gravity = 9.81f;                   // [m/s^2]

struct Options {
    std::vector<float> heights{0, 0.001f, 0.003f, 0.01f, 0.03f};
    float cell = 0.25f, speed = 2, seconds = 3, stepsPerSecond = 240, voxelSize = 0.0125f;
};

/// Collision shapes of block and ground.
struct Rival {
    std::string name;
    std::shared_ptr<btCollisionShape> block;
    bool adjustsEdges = false;  ///< by btInternalEdgeUtility
};

std::vector<Rival> rivals(const Options& options) {
    const Mesh mesh = shapes::box(halfBlock);
    const btVector3 half(halfBlock.x, halfBlock.y, halfBlock.z);
    std::vector<Rival> all;
    for (const auto& [name, accuracy] : {std::pair{"bilayer", ContactAccuracy::exactNearFeatures},
                                         {"bilayer, by samples", ContactAccuracy::samples},
                                         {"bilayer, by triangles", ContactAccuracy::exact}})
        all.push_back({name, demo::makePrototype(mesh, {.voxelSize = options.voxelSize, .accuracy = accuracy})->shape});
    all.push_back({"btBoxShape", std::make_shared<btBoxShape>(half)});
    all.push_back({"btBoxShape, btInternalEdgeUtility", std::make_shared<btBoxShape>(half), true});
    struct GImpact {
        explicit GImpact(const Mesh& mesh) : triangles(mesh), shape(&triangles.triangles) { shape.updateBound(); }
        demo::TriangleShape triangles;
        btGImpactMeshShape shape;
    };
    const auto gImpact = std::make_shared<GImpact>(mesh);
    all.push_back({"GImpact", {gImpact, &gImpact->shape}});
    return all;
}

bool adjustEdges(btManifoldPoint& point, const btCollisionObjectWrapper* a, int partA, int indexA,
                 const btCollisionObjectWrapper* b, int partB, int indexB) {
    if (a->getCollisionObject()->isStaticObject())
        btAdjustInternalEdgeContacts(point, a, b, partA, indexA);
    else
        btAdjustInternalEdgeContacts(point, b, a, partB, indexB);
    return true;
}

struct Slide {
    double kept;  ///< speed relative to that of a frictionless point [%]
    double step;  ///< [ms]
};

Slide slide(const Rival& rival, const Options& options, float height) {
    const demo::Waves waves({height, options.cell});
    demo::World world;
    btGImpactCollisionAlgorithm::registerAlgorithm(static_cast<btCollisionDispatcher*>(world.bullet().getDispatcher()));
    world.bullet().getSolverInfo().m_splitImpulsePenetrationThreshold = -options.voxelSize;
    btRigidBody& ground = world.add(waves.shape(), {.friction = 0}, {});
    btTriangleInfoMap edges;
    if (rival.adjustsEdges) {
        btGenerateInternalEdgeInfo(static_cast<btBvhTriangleMeshShape*>(waves.shape().get()), &edges);
        ground.setCollisionFlags(ground.getCollisionFlags() | btCollisionObject::CF_CUSTOM_MATERIAL_CALLBACK);
        gContactAddedCallback = adjustEdges;
    }
    const float z = waves.highestAround(startX, startY, halfBlock.x) + halfBlock.z;
    const demo::Matter matter{.mass = 1, .friction = 0, .linearDamping = 0, .angularDamping = 0};
    btRigidBody& body = world.add(rival.block, matter, {{startX, startY, z}});
    body.setActivationState(DISABLE_DEACTIVATION);
    body.setLinearVelocity({options.speed, 0, 0});
    body.setLinearFactor({1, 0, 1});
    const auto potential = [&] { return gravity * body.getCenterOfMassPosition().z(); };
    float energy = 0;
    std::vector<double> steps;
    for (int i = 0; float(i) < options.seconds * options.stepsPerSecond; ++i) {
        const Stopwatch watch;
        world.step(1 / options.stepsPerSecond);
        steps.push_back(1e3 * watch.seconds());
        if (float(i) < settled * options.stepsPerSecond)
            energy = 0.5f * body.getLinearVelocity().length2() + potential();
    }
    gContactAddedCallback = nullptr;
    const double expected = std::sqrt(std::max(2.0 * double(energy - potential()), 0.0));
    return {100 * double(body.getLinearVelocity().length()) / expected, median(steps)};
}

int run(int argc, char** argv) {
    CLI::App app(
        "A block slides over waves of triangles: the speed that it keeps, compared with a point without friction.");
    Options options;
    app.add_option("--heights", options.heights, "amplitudes of the waves [m]")->capture_default_str();
    app.add_option("--cell", options.cell, "edge of the ground's squares [m]")->capture_default_str();
    app.add_option("--speed", options.speed, "initial speed [m/s]")->capture_default_str();
    app.add_option("--seconds", options.seconds, "simulated time [s]")->capture_default_str();
    app.add_option("--steps", options.stepsPerSecond, "steps per second")->capture_default_str();
    app.add_option("--voxel", options.voxelSize, "edge of a voxel [m]")->capture_default_str();
    CLI11_PARSE(app, argc, argv);
    fmt::print("Speed kept [%]; a step [ms]\n\n| block |");
    for (const float height : options.heights) fmt::print(" {:g} mm |", 1e3f * height);
    fmt::print("\n|---|");
    for (std::size_t i = 0; i < options.heights.size(); ++i) fmt::print("---|");
    fmt::print("\n");
    for (const Rival& rival : rivals(options)) {
        fmt::print("| {} |", rival.name);
        for (const float height : options.heights) {
            const Slide result = slide(rival, options, height);
            fmt::print(" {:.1f}; {:.2f} |", result.kept, result.step);
            std::fflush(stdout);
        }
        fmt::print("\n");
    }
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    return program("terrain", run, argc, argv);
}
