// SPDX-License-Identifier: Apache-2.0
#include "bench/pile.h"

#include <BulletCollision/BroadphaseCollision/btDbvtBroadphase.h>
#include <BulletCollision/CollisionDispatch/btDefaultCollisionConfiguration.h>
#include <BulletDynamics/ConstraintSolver/btSequentialImpulseConstraintSolver.h>
#include <BulletDynamics/Dynamics/btDiscreteDynamicsWorld.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <oneapi/tbb/parallel_for.h>

#include <bilayer/integration/bullet/dispatcher.h>
#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "bench/measure.h"
#include "demos/shared/world.h"
#include "integration/bullet/detail/convert.h"

namespace bilayer::bench {

using namespace bilayer::detail;
using namespace bilayer::bullet::detail;
namespace {

constexpr float gravity = 9.81f;  // [m/s^2]
constexpr float friction = 0.5f;
constexpr float restingSpeed = 0.1f, restingSpin = 1;  // thresholds below which bodies could sleep [m/s, rad/s]
constexpr float splitAt = 0.01f;  // Bullet splits off deeper penetration [fraction of a body's size]

btVector3 inertiaOf(const Member& member) {
    const MassProperties& of = member.form->mass;
    const glm::vec3 inertia = of.principalInertia * float(double(member.mass) / of.volume);
    return {inertia.x, inertia.y, inertia.z};
}

// Bullet's world, which measures the parts of a step.
class MeasuredWorld : public btDiscreteDynamicsWorld {
  public:
    using btDiscreteDynamicsWorld::btDiscreteDynamicsWorld;

    void updateAabbs() override {
        const Timed part(last_.broadPhase);
        btDiscreteDynamicsWorld::updateAabbs();
    }
    void computeOverlappingPairs() override {
        const Timed part(last_.broadPhase);
        btDiscreteDynamicsWorld::computeOverlappingPairs();
    }
    void performDiscreteCollisionDetection() override {
        const Timed part(last_.contacts);
        btDiscreteDynamicsWorld::performDiscreteCollisionDetection();
    }
    void calculateSimulationIslands() override {
        const Timed part(last_.solver);
        btDiscreteDynamicsWorld::calculateSimulationIslands();
    }
    void solveConstraints(btContactSolverInfo& info) override {
        const Timed part(last_.solver);
        btDiscreteDynamicsWorld::solveConstraints(info);
    }

    // The parts since the last call.
    StepParts takeParts() {
        StepParts parts = std::exchange(last_, {});
        parts.contacts -= parts.broadPhase;  // which is a part of it
        for (int i = 0; i < getDispatcher()->getNumManifolds(); ++i)
            parts.points += getDispatcher()->getManifoldByIndexInternal(i)->getNumContacts();
        return parts;
    }

  private:
    // Adds the milliseconds of its life.
    class Timed {
      public:
        explicit Timed(double& sum) : sum_(sum) {}
        ~Timed() { sum_ += 1e3 * watch_.seconds(); }
        Timed(const Timed&) = delete;
        Timed& operator=(const Timed&) = delete;

      private:
        double& sum_;
        Stopwatch watch_;
    };
    StepParts last_;
};

// Bullet's world with the bodies of one run.
class Arena {
  public:
    Arena(const Rival& rival, const std::vector<Member>& members)
        : dispatcher_(rival.dispatcher(configuration_)),
          world_(dispatcher_.get(), &broadphase_, &solver_, &configuration_) {
        world_.setGravity({0, 0, -gravity});
        world_.getSolverInfo().m_solverMode |= SOLVER_USE_2_FRICTION_DIRECTIONS;
        float size = 0;
        for (const Member& member : members) {
            add(member);
            if (member.mass > 0) size = member.form->box.longestSide();
        }
        world_.getSolverInfo().m_splitImpulsePenetrationThreshold = -splitAt * size;
    }
    ~Arena() {
        for (const auto& body : bodies_) world_.removeRigidBody(body.get());
    }
    Arena(const Arena&) = delete;
    Arena& operator=(const Arena&) = delete;

    void step(float seconds) { world_.stepSimulation(seconds, 1, seconds); }
    StepParts takeParts() { return world_.takeParts(); }
    DeviceTimes deviceTimes() const {
        const auto* fields = dynamic_cast<const bullet::Dispatcher*>(dispatcher_.get());
        return fields ? fields->statistics().device : DeviceTimes{};
    }

    std::vector<Pose> poses() const {
        std::vector<Pose> all;
        for (const auto& body : bodies_) all.push_back(bullet::detail::toPose(body->getWorldTransform()));
        return all;
    }

    double kineticEnergy() const {
        double sum = 0;
        for (const auto& body : bodies_)
            if (!body->isStaticObject()) sum += demo::kineticEnergyOf(*body);
        return sum;
    }

    int awakeBodies() const {
        return int(std::count_if(bodies_.begin(), bodies_.end(), [](const auto& body) {
            return !(body->getLinearVelocity().length() < restingSpeed) ||
                   !(body->getAngularVelocity().length() < restingSpin);
        }));
    }

  private:
    void add(const Member& member) {
        const btVector3 inertia = member.mass > 0 ? inertiaOf(member) : btVector3(0, 0, 0);
        btRigidBody::btRigidBodyConstructionInfo info(member.mass, nullptr, member.form->shape, inertia);
        info.m_startWorldTransform = toBullet(member.pose);
        info.m_friction = friction;
        bodies_.push_back(std::make_unique<btRigidBody>(info));
        if (member.mass > 0) bodies_.back()->setActivationState(DISABLE_DEACTIVATION);
        world_.addRigidBody(bodies_.back().get());
    }

    btDefaultCollisionConfiguration configuration_;
    std::unique_ptr<btCollisionDispatcher> dispatcher_;
    btDbvtBroadphase broadphase_;
    btSequentialImpulseConstraintSolver solver_;
    MeasuredWorld world_;
    std::vector<std::unique_ptr<btRigidBody>> bodies_;
};

bool near(const Form& a, const Pose& poseA, const Form& b, const Pose& poseB) {
    const auto ball = [](const Form& form) { return 0.5f * glm::length(form.box.size()); };
    const auto centre = [](const Form& form, const Pose& pose) { return pose.toWorld(form.box.centre()); };
    return glm::distance(centre(a, poseA), centre(b, poseB)) < ball(a) + ball(b);
}

std::vector<double> penetrationsIn(const std::vector<Member>& members, const std::vector<Pose>& poses) {
    std::vector<double> depths;
    for (std::size_t i = 0; i < members.size(); ++i)
        for (std::size_t j = 0; j < i; ++j) {
            const Member &a = members[i], &b = members[j];
            if ((a.mass == 0 && b.mass == 0) || !near(*a.form, poses[i], *b.form, poses[j])) continue;
            const double depth = demo::penetration(*a.form->specimen, poses[i], *b.form->specimen, poses[j]);
            if (depth > 0) depths.push_back(depth);
        }
    return depths;
}

}  // namespace

Form::Form(Mesh from, btCollisionShape& collidesBy, double spacing)
    : mesh(std::move(from)),
      box(bounds(mesh)),
      shape(&collidesBy),
      mass(massProperties(mesh)),
      specimen(std::make_unique<demo::Specimen>(mesh, spacing)) {}

PileRun play(const Rival& rival, const std::vector<Member>& members, const PileOptions& options) {
    Arena arena(rival, members);
    const int steps = std::max(1, int(std::lround(options.seconds * double(options.stepsPerSecond))));
    const int between = std::max(1, steps / options.measuredFrames);
    PileRun run;
    std::vector<std::vector<Pose>> frames;
    const Stopwatch since;
    for (int i = 1; i <= steps && since.seconds() < options.timeLimit; ++i) {
        const Stopwatch watch;
        arena.step(1 / options.stepsPerSecond);
        run.stepMs.push_back(1e3 * watch.seconds());
        run.parts.push_back(arena.takeParts());
        run.kineticEnergy.push_back(arena.kineticEnergy());
        run.device += arena.deviceTimes();
        if (i % between == 0) frames.push_back(arena.poses());
    }
    run.simulated = double(run.stepMs.size()) / double(options.stepsPerSecond);
    run.awakeBodies = arena.awakeBodies();
    std::vector<std::vector<double>> depths(frames.size());
    tbb::parallel_for(std::size_t(0), frames.size(),
                      [&](std::size_t i) { depths[i] = penetrationsIn(members, frames[i]); });
    for (const auto& some : depths) run.penetrations.insert(run.penetrations.end(), some.begin(), some.end());
    return run;
}

}  // namespace bilayer::bench
