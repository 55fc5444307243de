// What Bullet's tables of algorithms hold for pairs with a field in them.
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

/// Two shapes to be collided, the second of which is a field.
struct Task {
    std::shared_ptr<Pair> pair;  ///< shared, since a callback of the user's may remove the bodies in the meantime
    Side a, b;

    /// For a result of Bullet's, unless that has been done with others' before.
    void collide(const btManifoldResult& result, bool isTest) const;
};

/// Of the step under way.
struct StepState {
    DispatchStatistics running{};  ///< contact tests between steps count here too
    float seconds = 0;             ///< that it takes; 0 between steps
    bool speculatesOnAll = true;
    bool isForeign = false;     ///< the dispatcher is another one, which does not tell its steps
    bool leavesFields = false;  ///< Bullet goes through a compound whose fields are our business

    /// Contact tests ask for a distance, or hand over a result of their own kind, and not within a step.
    bool isTest(const btManifoldResult& result) const;
    float secondsOf(const btDispatcherInfo& info, bool isTest) const;

    /// Of two shapes for the seconds that a step takes. The ways of what goes farther than its own size are the
    /// business of a NoPassing, which does not see what the user moves, nor inside of what locks.
    Task taskOf(std::shared_ptr<Pair> pair, Side a, Side b) const;
};

/// Lets Bullet go through a compound, and leaves its fields out as long as this lives.
class LeftToBullet {
  public:
    explicit LeftToBullet(StepState& state) : state_(state), before_(std::exchange(state.leavesFields, true)) {}
    ~LeftToBullet() { state_.leavesFields = before_; }
    LeftToBullet(const LeftToBullet&) = delete;
    LeftToBullet& operator=(const LeftToBullet&) = delete;

  private:
    StepState& state_;
    bool before_;
};

/// An algorithm whose pairs can be collided before Bullet asks it to process them: then it only hands contacts over.
class FieldAlgorithm : public btCollisionAlgorithm {
  public:
    using btCollisionAlgorithm::btCollisionAlgorithm;

    /// Appends what can be collided at once with others'.
    /// @param seconds  that the step takes
    virtual void gather(const btCollisionObjectWrapper& first, const btCollisionObjectWrapper& second, float seconds,
                        std::vector<Task>& tasks) = 0;

    /// Bullet asks this of pairs in continuous dispatch, which its worlds never use.
    btScalar calculateTimeOfImpact(btCollisionObject*, btCollisionObject*, const btDispatcherInfo&,
                                   btManifoldResult*) override {
        return 1;
    }
};

/// What makes such algorithms for a dispatcher's tables, which point to it.
class FieldAlgorithmFunctions {
  public:
    explicit FieldAlgorithmFunctions(btCollisionConfiguration& configuration);
    ~FieldAlgorithmFunctions();

    /// Fills the rows and columns of fields and of compounds.
    void registerWith(btCollisionDispatcher& dispatcher);

    StepState state;

  private:
    struct Functions;
    std::unique_ptr<Functions> functions_;
    KnowsFields knows_;
};

}  // namespace bilayer::bullet::detail
