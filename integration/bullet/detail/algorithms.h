// SPDX-License-Identifier: Apache-2.0
// Collision algorithms that Bullet's tables hold for pairs with a field.
// Tested by tests/bullet/pairs.cpp through bullet::Shape.
#pragma once

#include <BulletCollision/BroadphaseCollision/btCollisionAlgorithm.h>
#include <BulletCollision/CollisionDispatch/btCollisionDispatcher.h>

#include <memory>
#include <utility>
#include <vector>

#include <bilayer/collider/contact.h>
#include <bilayer/integration/bullet/dispatcher.h>
#include "integration/bullet/detail/missing_dispatcher.h"
#include "integration/bullet/detail/pair_contacts.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

/// Two shapes to be collided; the second one is a field.
struct Task {
    std::shared_ptr<Pair> pair;  ///< shared, since a user's callback may remove the bodies in the meantime
    Side a, b;

    /// Collides the pair for Bullet's result, unless the batch of the step has done so.
    void collide(const btManifoldResult& result, bool isTest) const;
};

/// State of the current step.
struct StepState {
    DispatchStatistics running{};  ///< includes contact tests between steps
    float seconds = 0;             ///< duration of the step [s]; 0 between steps
    bool speculatesOnAll = true;
    bool hasOtherDispatcher = false;      ///< the dispatcher is not ours and does not report its steps
    bool skipsFieldsInCompounds = false;  ///< Bullet traverses a compound; its fields are collided by us

    /// Whether the call is a contact test. Contact tests ask for a distance, or pass a result of their own kind, and
    /// run outside a step.
    bool isTest(const btManifoldResult& result) const;
    float secondsOf(const btDispatcherInfo& info, bool isTest) const;

    /// The task for two shapes over the duration of a step. ContinuousCollision handles paths longer than the body's
    /// own size, except those of objects that the user moves, and of shapes that lock (see locks()).
    Task taskOf(std::shared_ptr<Pair> pair, Side a, Side b) const;
};

/// Scope guard: during its lifetime Bullet traverses a compound and skips the fields in it.
class CompoundByBullet {
  public:
    explicit CompoundByBullet(StepState& state)
        : state_(state), before_(std::exchange(state.skipsFieldsInCompounds, true)) {}
    ~CompoundByBullet() { state_.skipsFieldsInCompounds = before_; }
    CompoundByBullet(const CompoundByBullet&) = delete;
    CompoundByBullet& operator=(const CompoundByBullet&) = delete;

  private:
    StepState& state_;
    bool before_;
};

/// An algorithm whose pairs can be collided before Bullet calls processCollision(). That call then only hands over the
/// contacts.
class FieldAlgorithm : public btCollisionAlgorithm {
  public:
    using btCollisionAlgorithm::btCollisionAlgorithm;

    /// Appends the pairs that can be collided in the batch of the step.
    /// @param seconds  duration of the step [s]
    virtual void gather(const btCollisionObjectWrapper& first, const btCollisionObjectWrapper& second, float seconds,
                        std::vector<Task>& tasks) = 0;

    /// Bullet calls this in continuous dispatch only, which its worlds never use.
    btScalar calculateTimeOfImpact(btCollisionObject*, btCollisionObject*, const btDispatcherInfo&,
                                   btManifoldResult*) override {
        return 1;
    }
};

/// Creates these algorithms for the tables of a dispatcher. The tables point to this object.
class FieldAlgorithmFunctions {
  public:
    explicit FieldAlgorithmFunctions(btCollisionConfiguration& configuration);
    ~FieldAlgorithmFunctions();

    /// Fills the rows and columns of fields and compounds.
    void registerWith(btCollisionDispatcher& dispatcher);

    StepState state;

  private:
    struct Functions;
    std::unique_ptr<Functions> functions_;
    FieldDispatcherMark dispatcherMark_;
};

}  // namespace bilayer::bullet::detail
