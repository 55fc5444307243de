// SPDX-License-Identifier: Apache-2.0
// Continuous collision: stops bodies at the surfaces that a step would take them through.
// Tested by tests/bullet/continuous_collision.cpp through WorldExtensions.
#pragma once

#include <BulletDynamics/Dynamics/btDynamicsWorld.h>

#include <array>
#include <vector>

#include "integration/bullet/detail/recorded_states.h"

namespace bilayer::bullet::detail {

/// The bodies that one of the last two steps moved by more than a margin. In an impact the solver does not
/// remove all of the approach speed in one step, and it begins the next step with the impulses of the impact. So these
/// bodies are checked even if what is left moves them by less than a margin.
class RecentlyFastBodies {
  public:
    using Objects = std::vector<const btCollisionObject*>;  ///< sorted by address

    bool contain(const btCollisionObject& object) const;
    void addStep(Objects fast);

  private:
    std::array<Objects, 2> steps_;  ///< the last one first
};

/// Two objects; one was stopped where it met the other.
struct StoppedPair {
    const btCollisionObject *first, *second;
    int stepsAtStart;  ///< for how many steps in a row they have not moved before they were stopped

    bool isOfSameObjects(const StoppedPair& other) const { return first == other.first && second == other.second; }
};

/// Stops bodies on their paths: ExtensionOptions::continuousCollision.
class ContinuousCollision {
  public:
    explicit ContinuousCollision(btDynamicsWorld& world);
    ~ContinuousCollision();
    ContinuousCollision(const ContinuousCollision&) = delete;
    ContinuousCollision& operator=(const ContinuousCollision&) = delete;

    void beforeStep();
    void afterStep(float seconds);
    int stoppedBodies() const { return stopped_; }  ///< in the last step

    /// Whether the worlds of a dispatcher have continuous collision. Speculative contacts are then made only for bodies
    /// that move less than their own size. A contact far ahead bends a body's path instead of ending it, so a fast body
    /// could miss what it would have hit.
    static bool serves(const btDispatcher& dispatcher);

  private:
    btDynamicsWorld& world_;
    const btDispatcher* const dispatcher_;
    RecordedStates<btTransform> starts_;
    RecentlyFastBodies fastBodies_;
    std::vector<StoppedPair> stoppedPairs_;  ///< in the last step
    int stopped_ = 0;
};

}  // namespace bilayer::bullet::detail
