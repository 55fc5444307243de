// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/continuous_collision.h"

#include <BulletCollision/BroadphaseCollision/btBroadphaseInterface.h>
#include <BulletCollision/BroadphaseCollision/btOverlappingPairCache.h>
#include <LinearMath/btAabbUtil2.h>
#include <tbb/parallel_for_each.h>

#include <algorithm>
#include <limits>
#include <mutex>
#include <optional>
#include <set>
#include <unordered_map>
#include <utility>
#include <vector>

#include "integration/bullet/detail/convert.h"
#include "integration/bullet/detail/time_of_impact.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

namespace {

// Limit of rounds. A stopped body may be hit by another one, so pairs are checked again, about once for each body of a
// falling column. In longer columns the last bodies overlap for one step.
constexpr int maxRounds = 256;
// A body stopped this early in a step counts as not moved.
constexpr float atStart = 1e-3f;

/// Two objects; one was stopped where it met the other.
using StoppedPair = std::pair<const btCollisionObject*, const btCollisionObject*>;

/// Two bodies that may meet in a step; one of them is fast.
struct SweptPair {
    BodySweep *a, *b;
    float margin;     ///< two bodies that are not stopped may approach by up to this; contacts handle that [m]
    Impact impact{};  ///< the first impact; normal from b to a
    float checkedA = -1, checkedB = -1;  ///< the ends of their sweeps when they were last checked
    Impact stop{};                       ///< where one of them was stopped

    /// Whether the pair has not been checked since one of the two was stopped.
    bool needsCheck() const { return a->stopTime() != checkedA || b->stopTime() != checkedB; }

    void findImpact() {
        impact = {};
        checkedA = a->stopTime(), checkedB = b->stopTime();
        if (std::min(checkedA, checkedB) >= 1 && a->maxDisplacement(*b) <= margin) return;
        visitLeafShapes(a->object(), [&](const LeafShape& one) {
            visitLeafShapes(b->object(), [&](const LeafShape& two) {
                if (one.field()) impact = earlier(impact, timeOfImpact(one, *a, two, *b));
                if (two.field()) impact = earlier(impact, timeOfImpact(two, *b, one, *a).reversed());
            });
        });
    }

    /// Stops the body that moves farther. If it is stopped already, stops both, since the other one moves on into it.
    bool stopBody() {
        if (impact.time >= 1 || needsCheck()) return false;
        BodySweep *faster = a, *slower = b;
        if (a->maxDisplacement() < b->maxDisplacement()) std::swap(faster, slower);
        const bool wasStopped = faster->stopTime() < 1, isStopped = faster->stopAt(impact.time);
        const bool isOtherStopped = (wasStopped || !isStopped) && slower->stopAt(impact.time);
        if (!isStopped && !isOtherStopped) return false;
        stop = impact;
        return true;
    }

    bool isStopped() const { return stop.time < 1; }
    bool hasNotMoved() const { return stop.time <= atStart; }
    StoppedPair objects() const { return std::minmax(&a->object(), &b->object()); }

    /// Sets the velocity of bodies that do not move to zero.
    void removeVelocity() const {
        for (const BodySweep* sweep : {a, b})
            if (btRigidBody* body = sweep->body(); body && sweep->stopTime() <= atStart) {
                body->setLinearVelocity({0, 0, 0});
                body->setAngularVelocity({0, 0, 0});
            }
    }

    /// Removes the approach velocity of the two, as an impact without restitution and friction does.
    void removeApproachVelocity() const {
        const btVector3 place = toBullet(stop.place), normal = toBullet(stop.normal);
        float speed = 0, perMass = 0;
        for (const auto& [sweep, sign] : {std::pair(a, 1.f), std::pair(b, -1.f)})
            if (const btRigidBody* body = sweep->body()) {
                const btVector3 arm = place - body->getCenterOfMassPosition();
                speed += sign * body->getVelocityInLocalPoint(arm).dot(normal);
                perMass += body->computeImpulseDenominator(place, normal);
            }
        if (!(speed < 0) || !(perMass > 0)) return;
        for (const auto& [sweep, sign] : {std::pair(a, 1.f), std::pair(b, -1.f)})
            if (btRigidBody* body = sweep->body())
                body->applyImpulse(-sign * speed / perMass * normal, place - body->getCenterOfMassPosition());
    }
};

/// Maximum separation of contacts with an object; nothing without a field.
std::optional<float> marginOf(const btCollisionObject& object) {
    std::optional<float> margin;
    visitLeafShapes(object, [&](const LeafShape& shape) {
        if (const Shape* field = shape.field()) margin = std::max(margin.value_or(0), float(field->getMargin()));
    });
    return margin;
}

/// The pairs in which a fast body may have tunnelled in a step.
class SweptPairs {
  public:
    SweptPairs(btDynamicsWorld& world, float seconds) : world_(world), seconds_(seconds) {
        const btCollisionObjectArray& objects = world.getCollisionObjectArray();
        float minMargin = std::numeric_limits<float>::infinity();
        for (int i = 0; i < objects.size(); ++i)
            if (const auto margin = marginOf(*objects[i])) minMargin = std::min(minMargin, *margin);
        for (int i = 0; i < objects.size(); ++i) {
            if (!activeDynamicBody(*objects[i])) continue;
            const BodySweep sweep(*objects[i], seconds);
            if (sweep.maxDisplacement() > minMargin) fast_.push_back(sweep);
        }
        for (std::size_t i = 0; i < fast_.size(); ++i) find(i);
    }

    /// Stops bodies until none tunnels.
    void resolve() {
        for (int round = 0; round < maxRounds; ++round) {
            tbb::parallel_for_each(pairs_, [](SweptPair& pair) {
                if (pair.needsCheck()) pair.findImpact();
            });
            // earliest first: a stopped body may come no farther
            std::vector<SweptPair*> order;
            for (SweptPair& pair : pairs_)
                if (pair.impact.time < 1) order.push_back(&pair);
            std::stable_sort(order.begin(), order.end(),
                             [](auto* one, auto* two) { return one->impact.time < two->impact.time; });
            bool isAnyStopped = false;
            for (SweptPair* pair : order) isAnyStopped = pair->stopBody() || isAnyStopped;
            if (!isAnyStopped) break;
        }
    }

    /// Moves the bodies to the poses where they are stopped. Two bodies that stop each other in two successive steps,
    /// or that have not moved, lose the approach velocity that this step's contacts have left. If both is true, they
    /// lose all of their velocity, which would otherwise grow with each step.
    /// @param before  the pairs of the last step; replaced by those of this one
    int apply(std::vector<StoppedPair>& before) const {
        int stopped = 0;
        for (const BodySweep& sweep : fast_) stopped += sweep.apply();
        for (const auto& [object, sweep] : slow_) stopped += sweep.apply();
        std::vector<StoppedPair> stoppedPairs;
        for (const SweptPair& pair : pairs_) {
            if (!pair.isStopped()) continue;
            stoppedPairs.push_back(pair.objects());
            const bool isAgain = std::find(before.begin(), before.end(), pair.objects()) != before.end();
            if (isAgain || pair.hasNotMoved()) pair.removeApproachVelocity();
            if (isAgain && pair.hasNotMoved()) pair.removeVelocity();
        }
        before = std::move(stoppedPairs);
        return stopped;
    }

  private:
    void find(std::size_t i) {
        struct ObjectsInBox : btBroadphaseAabbCallback {
            std::vector<btCollisionObject*> objects;
            bool process(const btBroadphaseProxy* proxy) override {
                objects.push_back(static_cast<btCollisionObject*>(proxy->m_clientObject));
                return true;
            }
        } inBox;
        btVector3 lower, upper;
        fast_[i].box(lower, upper);
        world_.getBroadphase()->aabbTest(lower, upper, inBox);
        for (btCollisionObject* object : inBox.objects) {
            if (isFast(*object) || !mayCollide(fast_[i].object(), *object)) continue;
            add(fast_[i], slow_.try_emplace(object, *object, seconds_).first->second);
        }
        // their boxes in the broad phase are out of date
        for (std::size_t j = 0; j < i; ++j) {
            btVector3 lowerOther, upperOther;
            fast_[j].box(lowerOther, upperOther);
            if (TestAabbAgainstAabb2(lower, upper, lowerOther, upperOther) &&
                mayCollide(fast_[i].object(), fast_[j].object()))
                add(fast_[i], fast_[j]);
        }
    }

    bool isFast(const btCollisionObject& object) const {
        const auto index = [](const BodySweep& sweep) { return sweep.object().getWorldArrayIndex(); };
        const auto at = std::lower_bound(fast_.begin(), fast_.end(), object.getWorldArrayIndex(),
                                         [&](const BodySweep& sweep, int other) { return index(sweep) < other; });
        return at != fast_.end() && &at->object() == &object;
    }

    bool mayCollide(const btCollisionObject& a, const btCollisionObject& b) const {
        const auto *one = a.getBroadphaseHandle(), *two = b.getBroadphaseHandle();
        return &a != &b && one && two &&
               world_.getPairCache()->needsBroadphaseCollision(const_cast<btBroadphaseProxy*>(one),
                                                               const_cast<btBroadphaseProxy*>(two)) &&
               world_.getDispatcher()->needsCollision(&a, &b) && world_.getDispatcher()->needsResponse(&a, &b);
    }

    void add(BodySweep& a, BodySweep& b) {
        // no field compares less than any margin
        const auto margin = std::max(marginOf(a.object()), marginOf(b.object()));
        if (margin) pairs_.push_back({&a, &b, *margin});
    }

    btDynamicsWorld& world_;
    float seconds_;
    std::vector<BodySweep> fast_;  ///< in the world's order
    /// bodies that these may meet, including static ones
    std::unordered_map<const btCollisionObject*, BodySweep> slow_;
    std::vector<SweptPair> pairs_;
};

std::mutex mutex;  // guards what follows
std::multiset<const btDispatcher*> served;

}  // namespace

ContinuousCollision::ContinuousCollision(btDynamicsWorld& world) : world_(world), dispatcher_(world.getDispatcher()) {
    const std::lock_guard lock(mutex);
    served.insert(dispatcher_);
}

ContinuousCollision::~ContinuousCollision() {
    const std::lock_guard lock(mutex);
    served.erase(served.find(dispatcher_));
}

bool ContinuousCollision::serves(const btDispatcher& dispatcher) {
    const std::lock_guard lock(mutex);
    return served.contains(&dispatcher);
}

void ContinuousCollision::afterStep(float seconds) {
    SweptPairs pairs(world_, seconds);
    pairs.resolve();
    stopped_ = pairs.apply(stoppedPairs_);
}

}  // namespace bilayer::bullet::detail
