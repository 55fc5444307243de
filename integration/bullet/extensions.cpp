// SPDX-License-Identifier: Apache-2.0
#include <BulletDynamics/Dynamics/btActionInterface.h>
#include <bilayer/integration/bullet/extensions.h>

#include <algorithm>
#include <map>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <vector>

#include "integration/bullet/detail/continuous_collision.h"
#include "integration/bullet/detail/gyroscopic_integrator.h"
#include "integration/bullet/detail/rest_stabilisation.h"
#include "integration/bullet/detail/smooth_ground.h"

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
        if (options.smoothGround) ground_.emplace(world);
        if (options.gyroscopicIntegration) gyroscopic_.emplace(world);
        if (actsBefore()) join();
        world_.addAction(this);
    }

    ~Hook() override {
        world_.removeAction(this);
        if (actsBefore()) leave();
    }

    void updateAction(btCollisionWorld*, btScalar seconds) override {
        if (ground_) ground_->afterStep(seconds);
        if (collision) collision->afterStep(seconds);
        if (rest) rest->afterStep(seconds);
        if (gyroscopic_) gyroscopic_->afterStep();
        if (!actsBefore()) return;
        const std::lock_guard lock(mutex_);
        takePreTick(worlds_.at(&world_));
    }
    void debugDraw(btIDebugDraw*) override {}

    std::optional<ContinuousCollision> collision;
    std::optional<RestStabilisation> rest;

  private:
    /// The pre-tick callbacks of a world.
    struct PreTicks {
        std::vector<Hook*> hooks;
        btInternalTickCallback usersCallback = nullptr;
    };

    static void preTick(btDynamicsWorld* world, btScalar seconds) {
        PreTicks all;
        {
            const std::lock_guard lock(mutex_);
            if (const auto found = worlds_.find(world); found != worlds_.end()) all = found->second;
        }
        if (all.usersCallback) all.usersCallback(world, seconds);
        for (Hook* hook : all.hooks) {
            if (hook->collision) hook->collision->beforeStep();
            if (hook->gyroscopic_) hook->gyroscopic_->beforeStep(seconds);
        }
        // one of them is enough
        const auto ground =
            std::find_if(all.hooks.begin(), all.hooks.end(), [](Hook* hook) { return hook->ground_.has_value(); });
        if (ground != all.hooks.end()) (*ground)->ground_->beforeStep();
    }

    bool actsBefore() const { return collision || ground_ || gyroscopic_; }

    void join() {
        const std::lock_guard lock(mutex_);
        PreTicks& all = worlds_[&world_];
        const bool isSecond = std::any_of(all.hooks.begin(), all.hooks.end(),
                                          [&](const Hook* other) { return gyroscopic_ && other->gyroscopic_; });
        if (isSecond)
            throw std::invalid_argument(
                "WorldExtensions: another one of this world integrates gyroscopically already; set "
                "ExtensionOptions::gyroscopicIntegration in only one of them");
        all.hooks.push_back(this);
        takePreTick(all);
    }

    void leave() {
        const std::lock_guard lock(mutex_);
        PreTicks& all = worlds_.at(&world_);
        std::erase(all.hooks, this);
        if (!all.hooks.empty()) return;
        if (PreTick::of(world_) == preTick) PreTick::of(world_) = all.usersCallback;
        worlds_.erase(&world_);
    }

    // also replaces a callback that the user has set later
    void takePreTick(PreTicks& all) {
        btInternalTickCallback& current = PreTick::of(world_);
        if (current == preTick) return;
        all.usersCallback = current;
        current = preTick;
    }

    static inline std::mutex mutex_;                             // guards the member below
    static inline std::map<btDynamicsWorld*, PreTicks> worlds_;  // those with hooks that act before a step

    btDynamicsWorld& world_;
    std::optional<SmoothGround> ground_;
    std::optional<GyroscopicIntegrator> gyroscopic_;
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
