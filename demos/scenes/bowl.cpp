// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/bowl.h"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/vec2.hpp>
#include <random>
#include <stdexcept>

#include <bilayer/integration/bullet/extensions.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/inspect.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "demos/shared/stage.h"

namespace bilayer::demo {

using namespace bilayer::detail;
namespace {

constexpr const char* bunnyFile = "/usr/share/glmark2/models/bunny.obj";  // Debian's package glmark2-data
constexpr float bodySize = 0.2f;                                          // longest side [m]

// The bowl for thirty bodies. For other counts it is scaled by the cube root of the ratio.
constexpr float usualBodies = 30;
constexpr float bowlRadius = 0.66f, bowlWall = 0.035f;  // of the sphere from which the bowl is cut [m]
constexpr float bowlOpening = 1.25f;                    // from the bottom to the rim [rad]
constexpr float bowlFoot = 0.2f;                        // radius of its foot [m]
constexpr float bowlVoxels = 3;                         // edge of its voxels [voxels of the bodies]

constexpr float usualBodiesPerLayer = 5;
constexpr float layerRadius = 0.26f;    // radius of a layer's ring in the bowl for thirty [m]
constexpr float minApart = 0.26f;       // min initial distance of bodies' centres, in neighbouring layers too [m]
constexpr float recordedAtRest = 0.5f;  // how long the recording continues after all bodies are at rest [s]
// A resting pile jitters by far less. Bodies that roll as slowly as allowed elsewhere would continue when they are
// woken.
constexpr float restingSpeed = 0.02f, restingSpin = 0.2f;  // [m/s], [rad/s]
// at 6 m/s a bunny moves 16 of its voxels in one step; its interior band must be that wide [voxels]
constexpr float bodyInteriorVoxels = 20, bowlInteriorVoxels = 6;

// The fraction of friction slip per step that anchors pull back, and the friction factor of resting contacts (see
// bullet::ShapeOptions), as for wood on wood. With Bullet's 0.2 and a factor of 1, a few bodies that are kept awake
// continue to slip.
constexpr float pulledBack = 0.5f, restingFriction = 1.5f;

constexpr double maxOverlap = 0.5;  // of 99 % of the penetrations [voxels]
constexpr double maxRise = 1;       // of energy, relative to the peak kinetic energy [%]
constexpr double maxDrift = 1;      // drift while kept awake [voxels]

constexpr Look bowlLook{.colour = 0x35506b, .roughness = 0.45f, .clearcoat = 0.6f};
constexpr std::uint32_t colours[] = {0xe07a5f, 0xf2cc8f, 0x81b29a, 0xf4f1de, 0x9db4d6, 0xe8a598, 0xc9b1d9, 0x7fb7be};

std::shared_ptr<const BodyPrototype> bodyOf(const Kind& kind, float resolution) {
    const glm::mat4 toSize = glm::scale(glm::mat4(1), glm::vec3(bodySize / bounds(kind.mesh).longestSide()));
    return makePrototype(transformed(kind.mesh, toSize), {.voxelSize = bodySize / resolution,
                                                          .interiorWidthVoxels = bodyInteriorVoxels,
                                                          .restingFriction = restingFriction});
}

// Returns the max distance of the surface from a point [m].
float reachOf(const Mesh& mesh, const glm::vec3& from) {
    float reach = 0;
    for (const glm::vec3& point : mesh.points) reach = std::max(reach, glm::distance(point, from));
    return reach;
}

// Returns the positions of a layer's bodies: as many rings as fit.
std::vector<glm::vec2> layerOf(float scale, float apart) {
    std::vector<glm::vec2> places;  // radius and angle
    for (float radius = layerRadius * scale; radius > 0; radius -= apart) {
        const int fits = std::max(1, int(usualBodiesPerLayer * radius / apart));
        for (int i = 0; i < fits; ++i) places.emplace_back(radius, 6.2832f * float(i) / float(fits));
    }
    return places;
}

// Returns poses in layers above the bowl, each layer rotated relative to those below, and every body rotated at random
// about the centre of its box.
std::vector<Pose> startPoses(const std::vector<std::shared_ptr<const BodyPrototype>>& prototypes,
                             const BowlOptions& options, float scale) {
    std::mt19937 random(options.seed);
    std::normal_distribution<float> normal;
    float apart = minApart;
    std::vector<glm::vec3> middles;
    for (const auto& prototype : prototypes) {
        middles.push_back(bounds(prototype->mesh).centre());
        apart = std::max(apart, 2 * reachOf(prototype->mesh, middles.back()));
    }
    const std::vector<glm::vec2> places = layerOf(scale, apart);
    std::vector<Pose> poses;
    for (std::size_t i = 0; i < std::size_t(options.bodies); ++i) {
        const std::size_t layer = i / places.size();
        const glm::vec2 place = places[i % places.size()];
        const float radius = place.x, angle = place.y + 0.6f * float(layer);
        const float x = normal(random), y = normal(random), z = normal(random), w = normal(random);
        const glm::vec3 at(radius * std::cos(angle), radius * std::sin(angle), apart * float(layer));
        const glm::quat rotation = glm::normalize(glm::quat(w, x, y, z));
        poses.push_back({at - rotation * middles[i % prototypes.size()], rotation});
    }
    return poses;
}

glm::vec3 centreOf(const btRigidBody& body) {
    const btVector3& p = body.getWorldTransform().getOrigin();
    return {p.x(), p.y(), p.z()};
}

std::vector<glm::vec3> centresOf(const std::vector<btRigidBody*>& bodies) {
    std::vector<glm::vec3> centres;
    for (const btRigidBody* body : bodies) centres.push_back(centreOf(*body));
    return centres;
}

// Keeps all bodies awake for a time, and returns the max drift of any body [m].
double drift(Stage& stage, const std::vector<btRigidBody*>& bodies, double seconds) {
    const std::vector<glm::vec3> before = centresOf(bodies);
    for (btRigidBody* body : bodies) body->forceActivationState(DISABLE_DEACTIVATION);
    stage.run(stage.time() + seconds);
    double largest = 0;
    for (std::size_t i = 0; i < bodies.size(); ++i)
        largest = worse(largest, glm::distance(before[i], centreOf(*bodies[i])));
    return largest;
}

std::string describe(const BodyPrototype& prototype) {
    const MeshReport report = inspect(prototype.mesh);
    return fmt::format("{} triangles, {}; {} voxels of {:.2f} mm, {:.1f} MB", report.triangles,
                       report.closed() && report.oriented() ? "closed" : "NOT closed", prototype.field.activeVoxels(),
                       1e3 * prototype.field.voxelSize(), 1e-6 * double(prototype.field.memoryBytes()));
}

}  // namespace

Kind readKind(const std::string& path) {
    const glm::mat4 upright = glm::rotate(glm::mat4(1), glm::radians(90.f), glm::vec3(1, 0, 0));
    return {std::filesystem::path(path).stem().string(), transformed(readMesh(path), upright)};
}

Kind bunny() {
    if (!std::filesystem::exists(bunnyFile)) return {"knot", shapes::torusKnot(2, 3, 0.06f, 0.02f)};
    return readKind(bunnyFile);
}

Outcome bowl(const BowlOptions& options) {
    if (options.kinds.empty()) throw std::invalid_argument("a bowl needs a kind of body");
    const float scale = std::cbrt(std::max(1.f, float(options.bodies) / usualBodies));
    const auto start = std::chrono::steady_clock::now();
    std::vector<std::shared_ptr<const BodyPrototype>> prototypes;
    for (const Kind& kind : options.kinds) prototypes.push_back(bodyOf(kind, float(options.resolution)));
    const float radius = scale * bowlRadius, wall = scale * bowlWall;
    const auto vessel = makePrototype(shapes::bowl(radius, wall, 192, bowlOpening, scale * bowlFoot),
                                      {bowlVoxels * prototypes[0]->field.voxelSize(), bowlInteriorVoxels});
    const std::chrono::duration<double> built = std::chrono::steady_clock::now() - start;

    Stage stage(fmt::format("{} bodies in a bowl", options.bodies), {.framesPerMeasuring = 30});
    stage.world().bullet().getSolverInfo().m_numIterations = options.iterations;
    stage.world().bullet().getSolverInfo().m_frictionERP = pulledBack;
    const bullet::WorldExtensions still(stage.world().bullet(),
                                        {.continuousCollision = false, .restStabilisation = true});
    stage.add(vessel, {}, {}, bowlLook);
    const Matter matter{.mass = 1, .restingSpeed = restingSpeed, .restingSpin = restingSpin};
    std::vector<btRigidBody*> bodies;
    for (const Pose& pose : startPoses(prototypes, options, scale)) {
        const std::size_t i = bodies.size();
        const Look look{.colour = colours[i % std::size(colours)], .roughness = 0.55f, .clearcoat = 0.12f};
        bodies.push_back(&stage.add(prototypes[i % prototypes.size()], matter, pose, look));
    }
    stage.run(options.seconds, [&] { return stage.allAsleep(); });
    const int awake = stage.world().moving() - stage.world().asleep();
    stage.run(stage.time() + recordedAtRest);
    const double drifted = options.hold > 0 ? drift(stage, bodies, options.hold) : 0;
    const float rim = radius * std::sin(bowlOpening);
    const auto left = std::count_if(bodies.begin(), bodies.end(), [&](const btRigidBody* body) {
        const glm::vec3 at = centreOf(*body);
        return !(std::hypot(at.x, at.y) < rim && at.z > -radius);
    });

    Outcome outcome = stage.finish({.target = {0, 0, -0.42f * scale},
                                    .distance = 2.75f * scale,
                                    .azimuth = -1.35f,
                                    .elevation = 0.78f,
                                    .groundHeight = bounds(vessel->mesh).lower.z});
    for (std::size_t i = 0; i < prototypes.size(); ++i) {
        outcome.facts.emplace_back(options.kinds[i].name, describe(*prototypes[i]));
        outcome.fields.emplace_back(options.kinds[i].name, prototypes[i]->field);
    }
    outcome.facts.emplace_back("bowl", describe(*vessel));
    outcome.facts.emplace_back("build the fields", fmt::format("{:.2f} s", built.count()));
    const double voxel = outcome.voxelSize;
    outcome.criteria = {{"bodies still awake", double(awake), 0},
                        {"bodies that left the bowl", double(left), 0},
                        {"99 in 100 penetrations", outcome.usuallyBelow() / voxel, maxOverlap, "voxels"},
                        {"energy rises by", 100 * outcome.energies.rise(), maxRise, "%"}};
    if (options.hold > 0)
        outcome.criteria.push_back({fmt::format("drift in {:g} s", options.hold), drifted / voxel, maxDrift, "voxels"});
    return outcome;
}

}  // namespace bilayer::demo
