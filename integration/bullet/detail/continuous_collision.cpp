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
using HeldPair = std::pair<const btCollisionObject*, const btCollisionObject*>;

struct Meeting {
    BodySweep *a, *b;
    float margin;    ///< two bodies that are not stopped may approach by up to this; contacts handle that [m]
    Impact touch{};  ///< the first impact; normal from b to a
    float heldA = -1, heldB = -1;  ///< the ends of their sweeps when they were last checked
    Impact stops{};                ///< where one of them was stopped

    /// Whether the pair has not been checked since one of the two was stopped.
    bool isOpen() const { return a->part() != heldA || b->part() != heldB; }

    void look() {
        touch = {};
        heldA = a->part(), heldB = b->part();
        if (std::min(heldA, heldB) >= 1 && a->longest(*b) <= margin) return;
        visitParts(a->object(), [&](const Part& one) {
            visitParts(b->object(), [&](const Part& two) {
                if (one.field()) touch = earlier(touch, timeOfImpact(one, *a, two, *b));
                if (two.field()) touch = earlier(touch, timeOfImpact(two, *b, one, *a).turned());
            });
        });
    }

    /// Stops the body that moves farther. If it is stopped already, stops both, since the other one moves on into it.
    bool hold() {
        if (touch.time >= 1 || isOpen()) return false;
        BodySweep *faster = a, *slower = b;
        if (a->longest() < b->longest()) std::swap(faster, slower);
        const bool goesOn = faster->part() < 1, isHeld = faster->holdAt(touch.time);
        const bool isOtherHeld = (goesOn || !isHeld) && slower->holdAt(touch.time);
        if (!isHeld && !isOtherHeld) return false;
        stops = touch;
        return true;
    }

    bool holds() const { return stops.time < 1; }
    bool hasNotMoved() const { return stops.time <= atStart; }
    HeldPair pair() const { return std::minmax(&a->object(), &b->object()); }

    /// Sets the velocity of bodies that do not move to zero.
    void rest() const {
        for (const BodySweep* course : {a, b})
            if (btRigidBody* body = course->body(); body && course->part() <= atStart) {
                body->setLinearVelocity({0, 0, 0});
                body->setAngularVelocity({0, 0, 0});
            }
    }

    /// Removes the approach velocity of the two, as an impact without restitution and friction does.
    void stop() const {
        const btVector3 place = toBullet(stops.place), normal = toBullet(stops.normal);
        float speed = 0, perMass = 0;
        for (const auto& [course, sign] : {std::pair(a, 1.f), std::pair(b, -1.f)})
            if (const btRigidBody* body = course->body()) {
                const btVector3 arm = place - body->getCenterOfMassPosition();
                speed += sign * body->getVelocityInLocalPoint(arm).dot(normal);
                perMass += body->computeImpulseDenominator(place, normal);
            }
        if (!(speed < 0) || !(perMass > 0)) return;
        for (const auto& [course, sign] : {std::pair(a, 1.f), std::pair(b, -1.f)})
            if (btRigidBody* body = course->body())
                body->applyImpulse(-sign * speed / perMass * normal, place - body->getCenterOfMassPosition());
    }
};

/// Maximum separation of contacts with an object; nothing without a field.
std::optional<float> marginOf(const btCollisionObject& object) {
    std::optional<float> most;
    visitParts(object, [&](const Part& part) {
        if (const Shape* field = part.field()) most = std::max(most.value_or(0), float(field->getMargin()));
    });
    return most;
}

/// The pairs in which a fast body may have tunnelled in a step.
class Meetings {
  public:
    Meetings(btDynamicsWorld& world, float seconds) : world_(world), seconds_(seconds) {
        const btCollisionObjectArray& objects = world.getCollisionObjectArray();
        float least = std::numeric_limits<float>::infinity();
        for (int i = 0; i < objects.size(); ++i)
            if (const auto margin = marginOf(*objects[i])) least = std::min(least, *margin);
        for (int i = 0; i < objects.size(); ++i) {
            if (!activeDynamicBody(*objects[i])) continue;
            const BodySweep course(*objects[i], seconds);
            if (course.longest() > least) fast_.push_back(course);
        }
        for (std::size_t i = 0; i < fast_.size(); ++i) find(i);
    }

    /// Stops bodies until none tunnels.
    void settle() {
        for (int round = 0; round < maxRounds; ++round) {
            tbb::parallel_for_each(meetings_, [](Meeting& meeting) {
                if (meeting.isOpen()) meeting.look();
            });
            // earliest first: a stopped body may come no farther
            std::vector<Meeting*> order;
            for (Meeting& meeting : meetings_)
                if (meeting.touch.time < 1) order.push_back(&meeting);
            std::stable_sort(order.begin(), order.end(),
                             [](auto* one, auto* two) { return one->touch.time < two->touch.time; });
            bool held = false;
            for (Meeting* meeting : order) held = meeting->hold() || held;
            if (!held) break;
        }
    }

    /// Moves the bodies to the poses where they are stopped. Two bodies that stop each other in two successive steps,
    /// or that have not moved, lose the approach velocity that this step's contacts have left. If both is true, they
    /// lose all of their velocity, which would otherwise grow with each step.
    /// @param before  the pairs of the last step; replaced by those of this one
    int apply(std::vector<HeldPair>& before) const {
        int held = 0;
        for (const BodySweep& course : fast_) held += course.apply();
        for (const auto& [object, course] : slow_) held += course.apply();
        std::vector<HeldPair> now;
        for (const Meeting& meeting : meetings_) {
            if (!meeting.holds()) continue;
            now.push_back(meeting.pair());
            const bool again = std::find(before.begin(), before.end(), meeting.pair()) != before.end();
            if (again || meeting.hasNotMoved()) meeting.stop();
            if (again && meeting.hasNotMoved()) meeting.rest();
        }
        before = std::move(now);
        return held;
    }

  private:
    void find(std::size_t i) {
        struct Found : btBroadphaseAabbCallback {
            std::vector<btCollisionObject*> objects;
            bool process(const btBroadphaseProxy* proxy) override {
                objects.push_back(static_cast<btCollisionObject*>(proxy->m_clientObject));
                return true;
            }
        } found;
        btVector3 lower, upper;
        fast_[i].box(lower, upper);
        world_.getBroadphase()->aabbTest(lower, upper, found);
        for (btCollisionObject* object : found.objects) {
            if (isFast(*object) || !meets(fast_[i].object(), *object)) continue;
            add(fast_[i], slow_.try_emplace(object, *object, seconds_).first->second);
        }
        // their boxes in the broad phase are out of date
        for (std::size_t j = 0; j < i; ++j) {
            btVector3 lowerOther, upperOther;
            fast_[j].box(lowerOther, upperOther);
            if (TestAabbAgainstAabb2(lower, upper, lowerOther, upperOther) &&
                meets(fast_[i].object(), fast_[j].object()))
                add(fast_[i], fast_[j]);
        }
    }

    bool isFast(const btCollisionObject& object) const {
        const auto index = [](const BodySweep& course) { return course.object().getWorldArrayIndex(); };
        const auto at = std::lower_bound(fast_.begin(), fast_.end(), object.getWorldArrayIndex(),
                                         [&](const BodySweep& course, int other) { return index(course) < other; });
        return at != fast_.end() && &at->object() == &object;
    }

    bool meets(const btCollisionObject& a, const btCollisionObject& b) const {
        const auto *one = a.getBroadphaseHandle(), *two = b.getBroadphaseHandle();
        return &a != &b && one && two &&
               world_.getPairCache()->needsBroadphaseCollision(const_cast<btBroadphaseProxy*>(one),
                                                               const_cast<btBroadphaseProxy*>(two)) &&
               world_.getDispatcher()->needsCollision(&a, &b) && world_.getDispatcher()->needsResponse(&a, &b);
    }

    void add(BodySweep& a, BodySweep& b) {
        // no field compares less than any margin
        const auto margin = std::max(marginOf(a.object()), marginOf(b.object()));
        if (margin) meetings_.push_back({&a, &b, *margin});
    }

    btDynamicsWorld& world_;
    float seconds_;
    std::vector<BodySweep> fast_;  ///< in the world's order
    /// bodies that these may meet, including static ones
    std::unordered_map<const btCollisionObject*, BodySweep> slow_;
    std::vector<Meeting> meetings_;
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
    Meetings meetings(world_, seconds);
    meetings.settle();
    stopped_ = meetings.apply(heldPairs_);
}

}  // namespace bilayer::bullet::detail
