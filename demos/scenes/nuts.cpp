#include "demos/scenes/nuts.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/constants.hpp>
#include <glm/trigonometric.hpp>

#include "collider/mass.h"
#include "demos/shared/machines.h"
#include "demos/shared/stage.h"
#include "demos/shared/turning.h"

namespace bilayer::demo {
namespace {

constexpr float gravity = 9.81f;        // [m/s^2]
constexpr float density = 7850;         // of steel [kg/m^3]
constexpr float boltLength = 70e-3f;    // some have run out 17 turns when others have made 10 [m]
constexpr float lane = 40e-3f;          // between bolts [m]
constexpr float startBelowTip = 1e-3f;  // [m]
// Contacts are made up to here: more than nuts advance in a step, less than from one flank to the other [m].
constexpr float margin = 50e-6f;
constexpr float settled = 0.1f;  // by then nuts have fallen through their play [s]
// Theory tells nuts that run from nuts that stay, farther than this from where they are the same [parts].
constexpr double unclear = 0.2;
constexpr int framesPerMeasuring = 16;
constexpr double mostPlay = 1;  // that nuts that should stay may turn [degrees]

constexpr Look boltLook{.colour = 0x9aa3ad, .roughness = 0.35f, .metalness = 0.6f};
constexpr std::uint32_t runningColour = 0xe07a5f, stayingColour = 0x81b29a;

// A nut on a thread as a body on an inclined plane: the flanks' lead, and friction that their slope makes larger.
struct Theory {
    double pitch, radius;  // the thread's, and where its flanks meet in the mean [m]

    explicit Theory(const shapes::Thread& thread) : pitch(thread.pitch) {
        // the bolt's flanks reach from 1/8 to 3/4 of the height of the sharp triangle, the nut's to its sixth eighth
        radius = thread.diameter / 2 - 5.0 / 32 * std::sqrt(3.0) * pitch;
    }
    double lead() const { return std::atan(pitch / (2 * glm::pi<double>() * radius)); }
    // The angle of friction on flanks at 30 degrees, seen from the axis.
    double holding(double friction) const { return std::atan(friction / std::cos(glm::radians(30.0))); }
    bool runs(double friction) const { return holding(friction) < (1 - unclear) * lead(); }
    bool stays(double friction) const { return holding(friction) > (1 + unclear) * lead(); }
    // Of a nut of unit mass and some inertia about its axis [rad/s^2].
    double acceleration(double friction, double inertia) const {
        const double lever = radius * std::tan(lead() - holding(friction));
        return gravity * lever / (inertia + lever * pitch / (2 * glm::pi<double>()));
    }
};

struct Rider {
    btRigidBody& body;
    float friction;
    double height;  // at the last step [m]
    Turning turning;
    double turns = 0;               // downward, since the nut had settled
    std::vector<double> heights{};  // after each whole turn since, the start included [m]
    double start = 0, speed = 0;    // angle and angular speed when it had settled [rad], [rad/s]
};

double spinOf(const btRigidBody& body) {
    return -double(body.getAngularVelocity().z());
}

void settle(Rider& rider) {
    rider.start = rider.turning.turns();
    rider.speed = spinOf(rider.body);
    rider.heights = {rider.height};
}

void follow(Rider& rider, const Pose& pose) {
    rider.turning.follow(pose.rotation);
    const double turns = rider.start - rider.turning.turns(), height = pose.position.z;
    const auto whole = double(rider.heights.size());
    if (!rider.heights.empty() && turns >= whole)
        rider.heights.push_back(glm::mix(rider.height, height, (whole - rider.turns) / (turns - rider.turns)));
    rider.turns = turns;
    rider.height = height;
}

// The worst of all turns [%].
double advanceOffPitch(const Rider& rider, double pitch) {
    double worst = 0;
    for (std::size_t i = 1; i < rider.heights.size(); ++i)
        worst = worse(worst, std::abs((rider.heights[i - 1] - rider.heights[i]) / pitch - 1));
    return 100 * worst;
}

struct Verdict {
    int stuck = 0;                         // that should run
    double moved = 0;                      // by those that should stay [degrees]
    double advance = 0, acceleration = 0;  // off theory [%]
};

Verdict judge(const std::vector<Rider>& riders, const Theory& theory, const NutsOptions& options, double time) {
    Verdict verdict;
    for (const Rider& rider : riders) {
        if (theory.stays(rider.friction)) verdict.moved = worse(verdict.moved, 360 * std::abs(rider.turns));
        if (!theory.runs(rider.friction)) continue;
        const double inertia = double(rider.body.getInvMass()) / double(rider.body.getInvInertiaTensorWorld()[2][2]);
        const double expected = theory.acceleration(rider.friction, inertia);
        const double measured = (spinOf(rider.body) - rider.speed) / (time - settled);
        verdict.stuck += rider.turns < options.turns;
        verdict.advance = worse(verdict.advance, advanceOffPitch(rider, theory.pitch));
        verdict.acceleration = worse(verdict.acceleration, 100 * std::abs(measured / expected - 1));
    }
    return verdict;
}

}  // namespace

Outcome nuts(const NutsOptions& options) {
    const shapes::Thread thread{.clearance = options.clearance};
    const shapes::Bolt boltPart{.thread = thread, .length = boltLength};
    const shapes::Nut nutPart{.thread = thread};
    const Theory theory(thread);
    Stage stage(fmt::format("{} nuts on their bolts", options.pairs),
                {.stepsPerSecond = options.stepsPerSecond, .framesPerMeasuring = framesPerMeasuring});
    stage.world().bullet().getSolverInfo().m_numIterations = options.iterations;
    const ThingOptions things{.voxelSize = options.voxelSize, .margin = margin, .sweeps = false, .exact = true};
    const auto bolt = makeThing(shapes::bolt(boltPart), things);
    const auto nut = makeThing(shapes::nut(nutPart), things);
    const float mass = density * float(massProperties(nut->mesh).volume);

    const int side = int(std::ceil(std::sqrt(float(options.pairs))));
    const float top = boltPart.length - startBelowTip - nutPart.height / 2;
    std::vector<Rider> riders;
    for (int i = 0; i < options.pairs; ++i) {
        const glm::vec3 place(lane * (glm::vec2(i % side, i / side) - 0.5f * float(side - 1)), 0);
        const float friction = options.frictions[std::size_t(i) % options.frictions.size()];
        // each starts in another part of its first turn
        Pose pose = shapes::onThread(thread, top - thread.pitch * float(i) / float(options.pairs));
        pose.position += place;
        stage.add(bolt, {.friction = 1}, {place}, boltLook);
        btRigidBody& body = stage.add(
            nut, {.mass = mass, .friction = friction, .linearDamping = 0, .angularDamping = 0}, pose,
            {.colour = theory.stays(friction) ? stayingColour : runningColour, .roughness = 0.3f, .metalness = 0.4f});
        body.setActivationState(DISABLE_DEACTIVATION);
        riders.push_back({body, friction, pose.position.z, Turning(pose.rotation)});
    }

    const auto followAll = [&] {
        const std::vector<Pose> poses = stage.world().poses();
        for (std::size_t i = 0; i < riders.size(); ++i) follow(riders[i], poses[2 * i + 1]);
        return std::all_of(riders.begin(), riders.end(), [&](const Rider& rider) {
            return !theory.runs(rider.friction) || rider.turns >= options.turns;
        });
    };
    stage.run(settled, followAll);
    for (Rider& rider : riders) settle(rider);
    stage.run(options.seconds, followAll);
    const Verdict verdict = judge(riders, theory, options, stage.time());

    const float width = lane * float(side);
    Outcome outcome = stage.finish({.target = {0, 0, 0.4f * boltPart.length},
                                    .distance = 1.5f * width + 3 * boltPart.length,
                                    .elevation = 0.4f,
                                    .groundHeight = -boltPart.headHeight});
    outcome.facts = {{"friction that holds, by theory",
                      fmt::format("{:.4f}", std::tan(theory.lead()) * std::cos(glm::radians(30.0)))},
                     {"acceleration off theory", fmt::format("{:.2f} %", verdict.acceleration)}};
    outcome.criteria = {{"advance of a turn off the pitch", verdict.advance, 1, "%"},
                        {"nuts that should run and stuck", double(verdict.stuck), 0},
                        {"turn of nuts that should stay", verdict.moved, mostPlay, "degrees"},
                        {"deepest penetration", outcome.deepest() / options.voxelSize, 0.5, "voxels"}};
    return outcome;
}

}  // namespace bilayer::demo
