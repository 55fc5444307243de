// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/nuts.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/constants.hpp>
#include <glm/trigonometric.hpp>

#include <bilayer/collider/mass.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/accumulated_rotation.h"
#include "demos/shared/stage.h"
#include "demos/shared/threads.h"

namespace bilayer::demo {
namespace {

constexpr float density = 7850;       // of steel [kg/m^3]
constexpr float boltLength = 70e-3f;  // some have run 17 revolutions by the time others have made 10 [m]
constexpr const char *factoryBolt = "factory_bolt_m16_loose.obj", *factoryNut = "factory_nut_m16_loose_subdiv_3x.obj";
constexpr float factoryStart = 10e-3f;  // above the head, where the thread still carries the entire nut [m]
constexpr float lane = 40e-3f;          // between bolts [m]
constexpr float startBelowTip = 1e-3f;  // [m]
// Contact margin: more than nuts advance per step, and less than the distance from one flank to the other [m].
constexpr float margin = 50e-6f;
constexpr float settled = 0.1f;  // by then nuts have fallen through their play [s]
// Relative distance from the limit between running and sticking below which theory does not decide.
constexpr double unclear = 0.2;
constexpr int framesPerMeasuring = 16;
constexpr double maxPlay = 1;  // max rotation of nuts that should stick [degrees]

constexpr Look boltLook{.colour = 0x9aa3ad, .roughness = 0.35f, .metalness = 0.6f};
constexpr std::uint32_t runningColour = 0xe07a5f, stayingColour = 0x81b29a;

// The theory of a body on an inclined plane: the lead of the flanks, and friction increased by their slope.
struct Theory {
    double pitch, radius;  // of the thread, and mean radius at which its flanks meet [m]

    explicit Theory(const shapes::Thread& thread) : pitch(thread.pitch) {
        // the flanks of bolt and nut meet from 1/8 to 3/4 of the height of the sharp triangle
        radius = thread.diameter / 2 - 5.0 / 32 * std::sqrt(3.0) * pitch;
    }
    double lead() const { return std::atan(pitch / (2 * glm::pi<double>() * radius)); }
    // Returns the friction angle on flanks at 30 degrees, relative to the axis.
    double holding(double friction) const { return std::atan(friction / std::cos(glm::radians(30.0))); }
    bool runs(double friction) const { return holding(friction) < (1 - unclear) * lead(); }
    bool stays(double friction) const { return holding(friction) > (1 + unclear) * lead(); }
    // Returns the acceleration of a nut of unit mass, with given inertia about its axis and weight [rad/s^2].
    double acceleration(double friction, double inertia, double weight) const {
        const double lever = radius * std::tan(lead() - holding(friction));
        return weight * lever / (inertia + lever * pitch / (2 * glm::pi<double>()));
    }
};

// The parts that are screwed together.
struct Parts {
    Mesh bolt, nut;
    float start;        // initial position of nuts: shapes::onThread() [m]
    float turns;        // revolutions of the nuts
    float bottom, top;  // of the bolt [m]

    static Parts byFormula(const shapes::Thread& thread, const NutsOptions& options) {
        const shapes::Bolt bolt{.thread = thread, .length = boltLength, .segments = options.segments};
        const shapes::Nut nut{.thread = thread, .segments = options.segments};
        const float start = boltLength - startBelowTip - nut.height / 2;
        return {shapes::bolt(bolt), shapes::nut(nut), start, options.turns, -bolt.headHeight, bolt.length};
    }
    // In the data set's coordinates, the nut is on the bolt's head.
    static Parts ofFactory(const NutsOptions& options) {
        Mesh bolt = readMesh(options.factory / factoryBolt), nut = readMesh(options.factory / factoryNut);
        const Bounds box = bounds(bolt);
        return {std::move(bolt), std::move(nut), factoryStart, std::min(options.turns, factoryTurns),
                box.lower.z,     box.upper.z};
    }
};

struct Rider {
    btRigidBody& body;
    float friction;
    double height;  // at the last step [m]
    AccumulatedRotation rotation;
    double turns = 0;                  // downward, since the nut has settled
    std::vector<double> heights{};     // after each whole revolution since then, including the start [m]
    double start = 0, speed = 0;       // revolutions, and angular speed [rad/s], when settled
    double acceleration = 0;           // since then, until it has made its revolutions [rad/s^2]
    std::vector<glm::dvec2> speeds{};  // time and angular speed until then [s, rad/s]
};

double spinOf(const btRigidBody& body) {
    return -double(body.getAngularVelocity().z());
}

void settle(Rider& rider) {
    rider.start = rider.rotation.revolutions();
    rider.turns = 0;
    rider.speed = spinOf(rider.body);
    rider.heights = {rider.height};
    rider.speeds.clear();
}

// Stops the nut before it runs into the bolt's head.
void hold(btRigidBody& body) {
    for (const auto set : {&btRigidBody::setLinearVelocity, &btRigidBody::setAngularVelocity})
        (body.*set)(btVector3(0, 0, 0));
    body.setLinearFactor(btVector3(0, 0, 0));
    body.setAngularFactor(btVector3(0, 0, 0));
}

// Stops a nut that has made `maxTurns` revolutions.
void follow(Rider& rider, const Pose& pose, double time, double maxTurns) {
    const bool hasSettled = !rider.heights.empty();
    if (hasSettled && rider.turns >= maxTurns) return;
    rider.rotation.follow(pose.rotation);
    const double turns = rider.start - rider.rotation.revolutions(), height = pose.position.z;
    const auto whole = double(rider.heights.size());
    if (hasSettled && turns >= whole)
        rider.heights.push_back(glm::mix(rider.height, height, (whole - rider.turns) / (turns - rider.turns)));
    rider.acceleration = (spinOf(rider.body) - rider.speed) / (time - settled);
    rider.speeds.emplace_back(time, spinOf(rider.body));
    rider.turns = turns;
    rider.height = height;
    if (hasSettled && turns >= maxTurns) hold(rider.body);
}

// Returns the max error of all revolutions [%].
double advanceOffPitch(const Rider& rider, double pitch) {
    double worst = 0;
    for (std::size_t i = 1; i < rider.heights.size(); ++i)
        worst = worse(worst, std::abs((rider.heights[i - 1] - rider.heights[i]) / pitch - 1));
    return 100 * worst;
}

// Returns the standard deviation of the angular speed from a uniform acceleration, relative to its mean [%].
double unevenness(const std::vector<glm::dvec2>& speeds) {
    glm::dvec2 mean(0);
    for (const glm::dvec2& at : speeds) mean += at / double(speeds.size());
    double times = 0, both = 0, all = 0;
    for (const glm::dvec2& at : speeds) {
        const glm::dvec2 off = at - mean;
        times += off.x * off.x, both += off.x * off.y, all += off.y * off.y;
    }
    return 100 * std::sqrt(std::max(all - both * both / times, 0.0) / double(speeds.size())) / std::abs(mean.y);
}

struct Verdict {
    int running = 0, staying = 0;          // count of nuts that should run and of those that should stick
    int stuck = 0;                         // nuts that should run but stick
    double turned = 0, slipped = 0;        // max movement of nuts that should stick [degrees, m]
    double advance = 0, acceleration = 0;  // max error against theory [%]
    double unevenness = 0;                 // of running nuts [%]
};

Verdict judge(const std::vector<Rider>& riders, const Theory& theory, double turns) {
    Verdict verdict;
    for (const Rider& rider : riders) {
        if (theory.stays(rider.friction)) {
            ++verdict.staying;
            verdict.turned = worse(verdict.turned, 360 * std::abs(rider.turns));
            verdict.slipped = worse(verdict.slipped, std::abs(rider.heights.front() - rider.height));
        }
        if (!theory.runs(rider.friction)) continue;
        ++verdict.running;
        const double inertia = double(rider.body.getInvMass()) / double(rider.body.getInvInertiaTensorWorld()[2][2]);
        const double weight = -double(rider.body.getGravity().z());
        const double expected = theory.acceleration(rider.friction, inertia, weight);
        verdict.stuck += rider.turns < turns;
        verdict.advance = worse(verdict.advance, advanceOffPitch(rider, theory.pitch));
        verdict.unevenness = worse(verdict.unevenness, unevenness(rider.speeds));
        verdict.acceleration = worse(verdict.acceleration, 100 * std::abs(rider.acceleration / expected - 1));
    }
    return verdict;
}

// Returns the criteria to judge. If there are none, that is a failed criterion.
std::vector<Criterion> criteriaOf(const Verdict& verdict, double deepest, double voxelSize) {
    std::vector<Criterion> criteria;
    if (verdict.running > 0)
        criteria = {{"error of the advance per turn, of the pitch", verdict.advance, 1, "%"},
                    {"nuts that should run and stuck", double(verdict.stuck), 0},
                    {"unevenness of angular speed", verdict.unevenness, 10, "%"}};
    if (verdict.staying > 0) {
        criteria.push_back({"rotation of nuts that should stay", verdict.turned, maxPlay, "degrees"});
        criteria.push_back({"displacement of nuts that should stay", verdict.slipped / voxelSize, 0.5, "voxels"});
    }
    if (criteria.empty()) criteria.push_back({"only frictions for which theory makes no prediction", 1, 0});
    criteria.push_back({"deepest penetration", deepest / voxelSize, 0.5, "voxels"});
    return criteria;
}

}  // namespace

bool hasFactoryThread(const std::filesystem::path& folder) {
    return std::filesystem::exists(folder / factoryBolt) && std::filesystem::exists(folder / factoryNut);
}

Outcome nuts(const NutsOptions& options) {
    const shapes::Thread thread{.clearance = options.clearance};  // Factory's thread has this diameter and pitch too
    const Theory theory(thread);
    Parts parts = options.factory.empty() ? Parts::byFormula(thread, options) : Parts::ofFactory(options);
    Stage stage(fmt::format("{} nuts on their bolts", options.pairs),
                {.stepsPerSecond = options.stepsPerSecond, .framesPerMeasuring = framesPerMeasuring});
    stage.world().bullet().getSolverInfo().m_numIterations = options.iterations;
    const PrototypeOptions prototypeOptions{
        .voxelSize = options.voxelSize, .margin = margin, .speculative = false, .accuracy = ContactAccuracy::exact};
    const auto bolt = makePrototype(std::move(parts.bolt), prototypeOptions);
    const auto nut = makePrototype(std::move(parts.nut), prototypeOptions);
    const float mass = density * float(massProperties(nut->mesh).volume);

    const int side = int(std::ceil(std::sqrt(float(options.pairs))));
    std::vector<Rider> riders;
    for (int i = 0; i < options.pairs; ++i) {
        const glm::vec3 place(lane * (glm::vec2(i % side, i / side) - 0.5f * float(side - 1)), 0);
        const float friction = options.frictions[std::size_t(i) % options.frictions.size()];
        // each starts at a different fraction of its first revolution
        Pose pose = shapes::onThread(thread, parts.start - thread.pitch * float(i) / float(options.pairs));
        pose.position += place;
        stage.add(bolt, {.friction = 1}, {place}, boltLook);
        btRigidBody& body = stage.add(
            nut, {.mass = mass, .friction = friction, .linearDamping = 0, .angularDamping = 0}, pose,
            {.colour = theory.stays(friction) ? stayingColour : runningColour, .roughness = 0.3f, .metalness = 0.4f});
        body.setActivationState(DISABLE_DEACTIVATION);
        body.setGravity(options.weights * body.getGravity());
        riders.push_back({body, friction, pose.position.z, AccumulatedRotation(pose.rotation)});
    }

    const auto followAll = [&] {
        const std::vector<Pose> poses = stage.world().poses();
        for (std::size_t i = 0; i < riders.size(); ++i) follow(riders[i], poses[2 * i + 1], stage.time(), parts.turns);
        const auto are = [&](const auto& what) { return std::count_if(riders.begin(), riders.end(), what); };
        const auto running = are([&](const Rider& rider) { return theory.runs(rider.friction); });
        const auto there = are([&](const Rider& rider) { return rider.turns >= parts.turns; });
        return running > 0 && there >= running;
    };
    stage.run(settled, followAll);
    for (Rider& rider : riders) settle(rider);
    stage.run(options.seconds, followAll);
    const Verdict verdict = judge(riders, theory, parts.turns);

    const float width = lane * float(side);
    Outcome outcome = stage.finish({.target = {0, 0, glm::mix(parts.bottom, parts.top, 0.5f)},
                                    .distance = 1.5f * width + 2.6f * (parts.top - parts.bottom),
                                    .elevation = 0.4f,
                                    .groundHeight = parts.bottom});
    outcome.facts = {{"friction that holds, by theory",
                      fmt::format("{:.4f}", std::tan(theory.lead()) * std::cos(glm::radians(30.0)))},
                     {"acceleration off theory", fmt::format("{:.2f} %", verdict.acceleration)}};
    outcome.criteria = criteriaOf(verdict, outcome.deepest(), options.voxelSize);
    return outcome;
}

}  // namespace bilayer::demo
