// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/continuous_collision.h"

#include <BulletCollision/BroadphaseCollision/btBroadphaseInterface.h>
#include <BulletCollision/BroadphaseCollision/btOverlappingPairCache.h>
#include <LinearMath/btAabbUtil2.h>
#include <LinearMath/btTransformUtil.h>
#include <tbb/parallel_for_each.h>

#include <algorithm>
#include <limits>
#include <mutex>
#include <optional>
#include <set>
#include <unordered_map>
#include <utility>
#include <vector>

#include <bilayer/integration/bullet/shape.h>
#include "collider/contact/impact/penetration.h"
#include "integration/bullet/detail/body_sweep.h"
#include "integration/bullet/detail/contact_shapes.h"
#include "integration/bullet/detail/convert.h"
#include "integration/bullet/detail/leaf_shapes.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

namespace {

// Limit of rounds. A stopped body may be hit by another one, so pairs are checked again, about once for each body of a
// falling column. In longer columns the last bodies overlap for one step.
constexpr int maxRounds = 256;
// A body stopped this early in a step counts as not moved.
constexpr float atStart = 1e-3f;
// Bodies that have not moved in this many successive steps lose their velocity. In each of the steps they lose the
// approach velocity in one place: a body that touches in several places may then be free to move on.
constexpr int maxStepsAtStart = 3;

/// A shape other than a compound, and its pose in its object.
struct LeafShape {
    const btCollisionShape* shape;
    btTransform local;

    const Shape* field() const {
        return shape->getShapeType() == FAST_CONCAVE_MESH_PROXYTYPE ? static_cast<const Shape*>(shape) : nullptr;
    }
    /// Whether it takes part in continuous collision. Soft bodies are neither convex nor concave.
    bool takesPart() const {
        return shape->getShapeType() != GIMPACT_SHAPE_PROXYTYPE && (shape->isConvex() || shape->isConcave()) &&
               (!field() || field()->speculative());
    }
    /// @param contactShape  contactShapeOf() this shape
    SweptShape swept(const ContactShape& contactShape, const Sweep& sweep) const {
        if (!field()) return {contactShape, sweep, toPose(local)};
        const Placed placed = field()->placed(local);
        return {contactShape, sweep, placed.pose, placed.scale};
    }
};

/// Visits the shapes that take part.
/// @param found  callback (const LeafShape&)
template <class Found>
void visitShapesOf(const btCollisionObject& object, Found&& found) {
    visitLeafShapes(*object.getCollisionShape(), btTransform::getIdentity(),
                    [&](const btCollisionShape& shape, const btTransform& local) {
                        if (const LeafShape leaf{&shape, local}; leaf.takesPart()) found(leaf);
                    });
}

/// Two bodies that may meet in a step; one of them is fast.
struct SweptPair {
    BodySweep *a, *b;
    float margin;          ///< two bodies that are not stopped may move by up to this; contacts handle that [m]
    Penetration impact{};  ///< the first one
    float checkedA = -1, checkedB = -1;  ///< the ends of their sweeps when they were last checked
    Penetration stop{};                  ///< where one of them was stopped

    /// Whether the pair has not been checked since one of the two was stopped.
    bool needsCheck() const { return a->stopTime() != checkedA || b->stopTime() != checkedB; }

    void findImpact() {
        impact = {};
        checkedA = a->stopTime(), checkedB = b->stopTime();
        if (std::min(checkedA, checkedB) >= 1 && a->maxDisplacement(*b) <= margin) return;
        visitShapesOf(a->object(), [&](const LeafShape& one) {
            const ContactShape ofOne = contactShapeOf(*one.shape);
            visitShapesOf(b->object(), [&](const LeafShape& two) {
                if (!one.field() && !two.field()) return;
                const ContactShape ofTwo = contactShapeOf(*two.shape);
                const Penetration first = firstPenetration(one.swept(ofOne, a->sweep()), two.swept(ofTwo, b->sweep()));
                impact = earlier(impact, first, relativeDisplacement(a->sweep(), b->sweep()));
            });
        });
    }

    /// Stops the body that moves farther. If it is stopped already, stops both, since the other one moves on into it.
    bool stopBody() {
        if (!impact.found() || needsCheck()) return false;
        BodySweep *faster = a, *slower = b;
        if (a->maxDisplacement() < b->maxDisplacement()) std::swap(faster, slower);
        const bool wasStopped = faster->stopTime() < 1, isStopped = faster->stopAt(impact.time);
        const bool isOtherStopped = (wasStopped || !isStopped) && slower->stopAt(impact.time);
        if (!isStopped && !isOtherStopped) return false;
        stop = impact;
        return true;
    }

    bool isStopped() const { return stop.found(); }
    StoppedPair stopped() const {
        const auto [first, second] = std::minmax(&a->object(), &b->object());
        return {first, second, stop.time <= atStart ? 1 : 0};
    }

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
        const btVector3 place = toBullet(stop.position), normal = toBullet(stop.normal);
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
    visitShapesOf(object, [&](const LeafShape& leaf) {
        if (const Shape* field = leaf.field()) margin = std::max(margin.value_or(0), float(field->getMargin()));
    });
    return margin;
}

/// The pairs in which a fast body may have tunnelled in a step.
class SweptPairs {
  public:
    SweptPairs(btDynamicsWorld& world, float seconds, const RecordedStates<btTransform>& starts,
               const RecentlyFastBodies& fastBefore)
        : world_(world), seconds_(seconds), starts_(starts), fastBefore_(fastBefore) {
        const btCollisionObjectArray& objects = world.getCollisionObjectArray();
        for (int i = 0; i < objects.size(); ++i)
            if (const auto margin = marginOf(*objects[i])) minMargin_ = std::min(minMargin_, *margin);
        for (int i = 0; i < objects.size(); ++i) {
            if (!activeDynamicBody(*objects[i])) continue;
            const BodySweep sweep(*objects[i], startOf(*objects[i]));
            if (sweep.maxDisplacement() > minMargin_ || fastBefore_.contain(*objects[i])) fast_.push_back(sweep);
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
                if (pair.impact.found()) order.push_back(&pair);
            std::stable_sort(order.begin(), order.end(),
                             [](auto* one, auto* two) { return one->impact.time < two->impact.time; });
            bool isAnyStopped = false;
            for (SweptPair* pair : order) isAnyStopped = pair->stopBody() || isAnyStopped;
            if (!isAnyStopped) break;
        }
    }

    /// Moves the bodies to the poses where they are stopped. Two bodies that stop each other in two successive steps,
    /// or that have not moved, lose the approach velocity that this step's contacts have left. If they have not moved
    /// in three successive steps, they lose all of their velocity, which would otherwise grow with each step.
    /// @param before  the pairs of the last step; replaced by those of this one
    int apply(std::vector<StoppedPair>& before) const {
        int stopped = 0;
        const auto stop = [&](const BodySweep& sweep) {
            if (!sweep.apply()) return;
            sweep.endForces(seconds_);
            ++stopped;
        };
        for (const BodySweep& sweep : fast_) stop(sweep);
        for (const auto& [object, sweep] : slow_) stop(sweep);
        std::vector<StoppedPair> stoppedPairs;
        for (const SweptPair& pair : pairs_) {
            if (!pair.isStopped()) continue;
            StoppedPair& now = stoppedPairs.emplace_back(pair.stopped());
            const auto last = std::find_if(before.begin(), before.end(),
                                           [&](const StoppedPair& one) { return one.isOfSameObjects(now); });
            const bool isAgain = last != before.end();
            if (isAgain && now.stepsAtStart) now.stepsAtStart += last->stepsAtStart;
            if (isAgain || now.stepsAtStart) pair.removeApproachVelocity();
            if (now.stepsAtStart >= maxStepsAtStart) pair.removeVelocity();
        }
        before = std::move(stoppedPairs);
        return stopped;
    }

    /// The bodies that this step moves by more than a margin, sorted by address.
    std::vector<const btCollisionObject*> fastBodies() const {
        std::vector<const btCollisionObject*> bodies;
        for (const BodySweep& sweep : fast_)
            if (sweep.maxDisplacement() > minMargin_) bodies.push_back(&sweep.object());
        std::sort(bodies.begin(), bodies.end());
        return bodies;
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
            add(fast_[i], slow_.try_emplace(object, *object, startOf(*object)).first->second);
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

    /// Where a body was at the start of the step. Found from its velocity if nothing was recorded.
    btTransform startOf(const btCollisionObject& object) const {
        if (const btTransform* start = starts_.find(object)) return *start;
        btTransform start = object.getWorldTransform();
        if (const auto* body = btRigidBody::upcast(&object))
            btTransformUtil::integrateTransform(object.getWorldTransform(), -body->getLinearVelocity(),
                                                -body->getAngularVelocity(), seconds_, start);
        return start;
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
        const bool wasFast = fastBefore_.contain(a.object()) || fastBefore_.contain(b.object());
        if (margin) pairs_.push_back({&a, &b, wasFast ? 0 : *margin});
    }

    btDynamicsWorld& world_;
    float seconds_;
    const RecordedStates<btTransform>& starts_;
    const RecentlyFastBodies& fastBefore_;
    float minMargin_ = std::numeric_limits<float>::infinity();  ///< of all fields
    std::vector<BodySweep> fast_;                               ///< in the world's order
    /// bodies that these may meet, including static ones
    std::unordered_map<const btCollisionObject*, BodySweep> slow_;
    std::vector<SweptPair> pairs_;
};

std::mutex mutex;  // guards what follows
std::multiset<const btDispatcher*> served;

}  // namespace

bool RecentlyFastBodies::contain(const btCollisionObject& object) const {
    return std::any_of(steps_.begin(), steps_.end(), [&](const Objects& objects) {
        return std::binary_search(objects.begin(), objects.end(), &object);
    });
}

void RecentlyFastBodies::addStep(Objects fast) {
    steps_ = {std::move(fast), std::move(steps_[0])};
}

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

void ContinuousCollision::beforeStep() {
    starts_.record(world_, [](const btCollisionObject& object) { return object.getWorldTransform(); });
}

void ContinuousCollision::afterStep(float seconds) {
    SweptPairs pairs(world_, seconds, starts_, fastBodies_);
    starts_.clear();
    pairs.resolve();
    stopped_ = pairs.apply(stoppedPairs_);
    fastBodies_.addStep(pairs.fastBodies());
}

}  // namespace bilayer::bullet::detail
