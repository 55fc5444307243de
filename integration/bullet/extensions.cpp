// SPDX-License-Identifier: Apache-2.0
#include <BulletDynamics/Dynamics/btActionInterface.h>
#include <bilayer/integration/bullet/extensions.h>

#include <map>
#include <mutex>
#include <optional>
#include <stdexcept>

#include "integration/bullet/detail/continuous_collision.h"
#include "integration/bullet/detail/gyroscopic_integrator.h"
#include "integration/bullet/detail/rest_stabilisation.h"

namespace bilayer::bullet {

using namespace detail;

namespace {

// A world's pre-tick callback, which Bullet does not expose.
struct PreTick : btDynamicsWorld {
    static btInternalTickCallback& of(btDynamicsWorld& world) { return world.*&PreTick::m_internalPreTickCallback; }
};

}  // namespace

/// Runs at the end of each internal step as one of the world's actions, and at the beginning as its pre-tick callback.
class WorldExtensions::Hook : public btActionInterface {
  public:
    Hook(btDynamicsWorld& world, const ExtensionOptions& options) : world_(world) {
        if (options.continuousCollision) collision.emplace(world);
        if (options.restStabilisation) rest.emplace(world);
        if (options.gyroscopicIntegration) integrateGyroscopically();
        world_.addAction(this);
    }

    ~Hook() override {
        world_.removeAction(this);
        if (!gyroscopic_) return;
        const std::lock_guard lock(mutex_);
        hooks_.erase(&world_);
        if (PreTick::of(world_) == preTick) PreTick::of(world_) = users_;
    }

    void updateAction(btCollisionWorld*, btScalar seconds) override {
        if (collision) collision->afterStep(seconds);
        if (rest) rest->afterStep(seconds);
        if (!gyroscopic_) return;
        gyroscopic_->afterStep();
        takePreTick();
    }
    void debugDraw(btIDebugDraw*) override {}

    std::optional<ContinuousCollision> collision;
    std::optional<RestStabilisation> rest;

  private:
    static void preTick(btDynamicsWorld* world, btScalar seconds) {
        Hook* hook = nullptr;
        {
            const std::lock_guard lock(mutex_);
            if (const auto found = hooks_.find(world); found != hooks_.end()) hook = found->second;
        }
        if (!hook) return;
        if (hook->users_) hook->users_(world, seconds);
        hook->gyroscopic_->beforeStep(seconds);
    }

    void integrateGyroscopically() {
        const std::lock_guard lock(mutex_);
        if (!hooks_.emplace(&world_, this).second)
            throw std::invalid_argument(
                "WorldExtensions: another one of this world integrates gyroscopically already; set "
                "ExtensionOptions::gyroscopicIntegration in only one of them");
        gyroscopic_.emplace(world_);
        takePreTick();
    }

    // also replaces a callback that the user has set later
    void takePreTick() {
        btInternalTickCallback& current = PreTick::of(world_);
        if (current == preTick) return;
        users_ = current;
        current = preTick;
    }

    static inline std::mutex mutex_;                         // guards the members below
    static inline std::map<btDynamicsWorld*, Hook*> hooks_;  // those with a gyroscopic integrator

    btDynamicsWorld& world_;
    std::optional<GyroscopicIntegrator> gyroscopic_;
    btInternalTickCallback users_ = nullptr;
};

WorldExtensions::WorldExtensions(btDynamicsWorld& world, const ExtensionOptions& options)
    : hook_(std::make_unique<Hook>(world, options)) {}

WorldExtensions::~WorldExtensions() = default;

int WorldExtensions::stoppedBodies() const {
    return hook_->collision ? hook_->collision->stoppedBodies() : 0;
}

int WorldExtensions::restingBodies() const {
    return hook_->rest ? hook_->rest->restingBodies() : 0;
}

}  // namespace bilayer::bullet
