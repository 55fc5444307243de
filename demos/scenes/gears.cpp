// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/gears.h"

#include <BulletDynamics/ConstraintSolver/btHingeConstraint.h>
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <glm/vec2.hpp>
#include <memory>
#include <numeric>
#include <utility>

#include <bilayer/collider/mass.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/accumulated_rotation.h"
#include "demos/shared/gears.h"
#include "demos/shared/stage.h"
#include "integration/bullet/detail/convert.h"

namespace bilayer::demo {

using namespace bilayer::detail;
using namespace bilayer::bullet::detail;
namespace {

constexpr float density = 7850;   // of steel [kg/m^3]
constexpr float friction = 0.3f;  // of dry steel: the product of both bodies' coefficients is 0.1
constexpr float zigzag = 0.4f;    // of the direction from gear to gear [rad]
// Contact margin, half the backlash; one voxel works too, with five times the contacts [m].
constexpr float margin = 50e-6f;
constexpr float settled = 0.1f;         // the backlash is taken up by then [s]
constexpr float maxTorque = 100;        // max torque of the motor [loads]
constexpr int framesPerMeasuring = 24;  // teeth are in contact all the time
constexpr double halfTooth = 0.5;

constexpr const char* factoryGear = "factory_gear_medium.ply";
constexpr int factoryTeeth = 40;
constexpr float factoryModule = 1e-3f;  // [m]
constexpr float factoryAxis = 20e-3f;   // position of its bore along x [m]
constexpr float factoryExtraDistance =
    0.5e-3f;                        // additional axis distance in the data set, beyond half the diameters [m]
constexpr double tipRadius = 0.98;  // relative to the max radius: points beyond belong to a tooth's tip

constexpr std::uint32_t colours[] = {0xe07a5f, 0x9db4d6, 0xf2cc8f, 0x81b29a};

struct Wheel {
    btRigidBody& body;
    double ratio;  // of its angle to the first gear's, by the teeth
    AccumulatedRotation rotation;
    double start = 0;  // angle when settled [rad]

    double angle() const { return rotation.angle() - start; }
};

// Hinges bodies so that they can only rotate about vertical axes, and drives the first. Must be destroyed before their
// world.
class Axles {
  public:
    explicit Axles(btDiscreteDynamicsWorld& world) : world_(world) {}
    Axles(const Axles&) = delete;
    Axles& operator=(const Axles&) = delete;
    ~Axles() {
        for (const auto& hinge : hinges_) world_.removeConstraint(hinge.get());
    }

    /// @param place  on the axle, in world coordinates
    void add(btRigidBody& body, const glm::vec3& place) {
        const btTransform& pose = body.getWorldTransform();
        const btVector3 upright = pose.getBasis().transpose() * btVector3(0, 0, 1);
        hinges_.push_back(
            std::make_unique<btHingeConstraint>(body, pose.invXform(bullet::detail::toBullet(place)), upright));
        world_.addConstraint(hinges_.back().get());
    }

    /// @param maxImpulse  max impulse per step [N m s]
    void drive(float speed, float maxImpulse) {
        hinges_.front()->enableAngularMotor(true, speed, maxImpulse);
        hinges_.front()->setJointFeedback(&feedback_);
    }
    // Returns the torque of the last step [N m].
    double torque() const { return feedback_.m_appliedTorqueBodyA.z(); }

  private:
    btDiscreteDynamicsWorld& world_;
    std::vector<std::unique_ptr<btHingeConstraint>> hinges_;
    btJointFeedback feedback_{};
};

// Meshing gears.
struct Train {
    std::vector<shapes::Gear> parts;
    std::vector<Mesh> meshes;
    float apart;  // axis distance beyond half the diameters [m]

    static Train byFormula(const GearsOptions& options) {
        Train train{{}, {}, 0};
        for (const int teeth : options.teeth) {
            train.parts.push_back({.teeth = teeth, .backlash = options.backlash});
            train.meshes.push_back(shapes::gear(train.parts.back()));
        }
        return train;
    }
    static Train ofFactory(const std::filesystem::path& folder);
};

// Makes gears as shapes::gear() does: around z, with a tooth along +x.
Train Train::ofFactory(const std::filesystem::path& folder) {
    Mesh mesh = readMesh(folder / factoryGear);
    const float middle = (bounds(mesh).lower.z + bounds(mesh).upper.z) / 2;
    double largest = 0;
    for (glm::vec3& point : mesh.points) {
        point -= glm::vec3(factoryAxis, 0, middle);
        largest = std::max(largest, double(glm::length(glm::vec2(point))));
    }
    std::complex<double> sum = 0;  // of the tips, to align all teeth
    for (const glm::vec3& point : mesh.points)
        if (double(glm::length(glm::vec2(point))) > tipRadius * largest)
            sum += std::polar(1.0, factoryTeeth * std::atan2(double(point.y), double(point.x)));
    const glm::quat rotation = glm::angleAxis(-float(std::arg(sum) / factoryTeeth), glm::vec3(0, 0, 1));
    for (glm::vec3& point : mesh.points) point = rotation * point;
    const shapes::Gear part{.teeth = factoryTeeth, .toothModule = factoryModule};
    return {{part, part}, {mesh, mesh}, factoryExtraDistance};
}

// Adds the gears one after another, each centred in the backlash.
std::vector<Wheel> addTrain(Stage& stage, Axles& axles, Train train, const GearsOptions& options) {
    std::vector<Wheel> wheels;
    glm::vec3 place(0);
    float angle = 0;
    for (std::size_t i = 0; i < train.parts.size(); ++i) {
        const shapes::Gear& part = train.parts[i];
        if (i > 0) {
            const shapes::Gear& last = train.parts[i - 1];
            const float direction = i % 2 == 0 ? zigzag : -zigzag;
            const float distance = (part.pitchDiameter() + last.pitchDiameter()) / 2 + train.apart;
            place += distance * glm::vec3(std::cos(direction), std::sin(direction), 0);
            angle = shapes::meshingAngle(part, angle, last, direction);
        }
        const auto prototype =
            makePrototype(std::move(train.meshes[i]),
                          {.voxelSize = options.voxelSize, .margin = margin, .accuracy = ContactAccuracy::exact});
        const float mass = density * float(massProperties(prototype->mesh).volume);
        const Pose pose{place, glm::angleAxis(angle, glm::vec3(0, 0, 1))};
        const Matter matter{.mass = mass, .friction = friction, .linearDamping = 0, .angularDamping = 0};
        btRigidBody& body =
            stage.add(prototype, matter, pose,
                      {.colour = colours[i % std::size(colours)], .roughness = 0.35f, .metalness = 0.3f});
        body.setActivationState(DISABLE_DEACTIVATION);
        axles.add(body, place);
        const double sign = i % 2 == 0 ? 1 : -1;
        wheels.push_back({body, sign * train.parts[0].teeth / part.teeth, AccumulatedRotation(pose.rotation)});
    }
    return wheels;
}

double meanOf(const std::vector<double>& values) {
    return std::accumulate(values.begin(), values.end(), 0.0) / double(values.size());
}

double deviationOf(const std::vector<double>& values) {
    const double mean = meanOf(values);
    double sum = 0;
    for (const double value : values) sum += (value - mean) * (value - mean);
    return std::sqrt(sum / double(values.size()));
}

}  // namespace

bool hasFactoryGear(const std::filesystem::path& folder) {
    return std::filesystem::exists(folder / factoryGear);
}

Outcome gears(const GearsOptions& options) {
    Train train = options.factory.empty() ? Train::byFormula(options) : Train::ofFactory(options.factory);
    const std::vector<shapes::Gear> parts = train.parts;
    Stage stage(fmt::format("A train of {} gears", parts.size()),
                {.stepsPerSecond = options.stepsPerSecond, .framesPerMeasuring = framesPerMeasuring});
    stage.world().bullet().getSolverInfo().m_numIterations = options.iterations;
    Axles axles(stage.world().bullet());
    std::vector<Wheel> wheels = addTrain(stage, axles, std::move(train), options);
    axles.drive(options.speed, maxTorque * options.load / options.stepsPerSecond);
    const btVector3 brake(0, 0, wheels.back().ratio > 0 ? -options.load : options.load);

    std::vector<double> torques;            // of the motor [N m]
    double worstAngle = 0, worstTooth = 0;  // max deviation: of the last gear [rad], of any gear [teeth]
    const auto step = [&] {
        wheels.back().body.applyTorque(brake);
        stage.step();
        torques.push_back(axles.torque());
        const std::vector<Pose> poses = stage.world().poses();
        for (std::size_t i = 0; i < wheels.size(); ++i) wheels[i].rotation.follow(poses[i].rotation);
        const auto off = [&](const Wheel& wheel) {
            return std::abs(wheel.angle() - wheel.ratio * wheels.front().angle());
        };
        for (std::size_t i = 0; i < wheels.size(); ++i)
            worstTooth = worse(worstTooth, off(wheels[i]) * parts[i].teeth / (2 * glm::pi<double>()));
        worstAngle = worse(worstAngle, off(wheels.back()));
    };
    while (stage.time() < settled) step();
    for (Wheel& wheel : wheels) wheel.start = wheel.rotation.angle();
    torques.clear();
    worstAngle = worstTooth = 0;
    const double angle = 2 * glm::pi<double>() * options.turns, longest = settled + 2 * angle / options.speed;
    while (wheels.front().angle() < angle && stage.time() < longest) step();

    double ratio = 0;
    for (const Wheel& wheel : wheels)
        ratio = worse(ratio, std::abs(wheel.angle() / (wheel.ratio * wheels.front().angle()) - 1));
    const double made = wheels.front().angle() / (2 * glm::pi<double>());
    // from the left of the first gear to the right of the last
    const glm::vec3 end = stage.frames().front().back().position;
    const float left = -parts.front().pitchDiameter() / 2, right = end.x + parts.back().pitchDiameter() / 2;
    Outcome outcome = stage.finish({.target = {(left + right) / 2, end.y / 2, 0},
                                    .distance = 1.55f * (right - left),
                                    .elevation = 1.1f,
                                    .groundHeight = -parts.front().faceWidth});
    outcome.facts = {
        {"turns of the first gear", fmt::format("{:.2f}", made)},
        {"last gear off its angle", fmt::format("{:.3f} mrad at most", 1e3 * worstAngle)},
        {"torque of the motor", fmt::format("{:.4f} N m, without losses {:.4f} N m", meanOf(torques),
                                            options.load * std::abs(wheels.back().ratio))},
        {"torque ripple", fmt::format("{:.1f} % (standard deviation)", 100 * deviationOf(torques) / meanOf(torques))}};
    outcome.criteria = {{"turns that are missing", options.turns - made, 0},
                        {"ratio off the teeth's", 100 * ratio, 0.5, "%"},
                        {"a gear off its angle", worstTooth, halfTooth, "teeth"},
                        {"deepest penetration", outcome.deepest() / options.voxelSize, 0.5, "voxels"}};
    return outcome;
}

}  // namespace bilayer::demo
