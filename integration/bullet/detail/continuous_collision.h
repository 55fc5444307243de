// SPDX-License-Identifier: Apache-2.0
// Continuous collision: stops bodies at the surfaces that a step would take them through.
#pragma once

#include <BulletDynamics/Dynamics/btDynamicsWorld.h>

#include <utility>
#include <vector>

namespace bilayer::bullet::detail {

/// Stops bodies on their paths: ExtensionOptions::continuousCollision.
class ContinuousCollision {
  public:
    explicit ContinuousCollision(btDynamicsWorld& world);
    ~ContinuousCollision();
    ContinuousCollision(const ContinuousCollision&) = delete;
    ContinuousCollision& operator=(const ContinuousCollision&) = delete;

    void afterStep(float seconds);
    int stoppedBodies() const { return stopped_; }  ///< in the last step

    /// Whether the worlds of a dispatcher have continuous collision. Speculative contacts are then made only for bodies
    /// that move less than their own size. A contact far ahead bends a body's path instead of ending it, so a fast body
    /// could miss what it would have hit.
    static bool serves(const btDispatcher& dispatcher);

  private:
    btDynamicsWorld& world_;
    const btDispatcher* const dispatcher_;
    std::vector<std::pair<const btCollisionObject*, const btCollisionObject*>> stoppedPairs_;  ///< in the last step
    int stopped_ = 0;
};

}  // namespace bilayer::bullet::detail
