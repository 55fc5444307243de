#include "integration/bullet/dispatcher.h"

#include <BulletCollision/BroadphaseCollision/btCollisionAlgorithm.h>
#include <BulletCollision/BroadphaseCollision/btOverlappingPairCache.h>
#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/CollisionDispatch/btGhostObject.h>
#include <BulletCollision/CollisionDispatch/btManifoldResult.h>
#include <BulletCollision/CollisionShapes/btStaticPlaneShape.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <tbb/parallel_for_each.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <new>
#include <optional>
#include <typeinfo>
#include <utility>
#include <vector>

#include "integration/bullet/convert.h"
#include "integration/bullet/manifolds.h"
#include "integration/bullet/narrow.h"
#include "integration/bullet/sampled_pairs.h"
#include "integration/bullet/shape.h"

namespace bilayer::bullet {

namespace {

// Bullet's pool hands out elements of this size, that of its own largest algorithm, whatever it is asked for [bytes].
constexpr std::size_t poolElement = 184;

bool isField(const btCollisionShape* shape) {
    return shape->getShapeType() == FAST_CONCAVE_MESH_PROXYTYPE;
}

/// GImpact counts locks while its triangles are read, without atomics: such pairs wait for their turn in Bullet's
/// order.
bool locks(const btCollisionShape* shape) {
    return shape->getShapeType() == GIMPACT_SHAPE_PROXYTYPE;
}

/// What a point that a body carries along does until the next step, the forces on the body included.
Motion motionOf(const btCollisionObject& object, const btVector3& point, float seconds) {
    const auto* body = btRigidBody::upcast(&object);
    if (!body || body->isStaticObject() || !body->isActive()) return {};
    const btVector3 velocity =
        body->getLinearVelocity() + seconds * body->getInvMass() * body->getLinearFactor() * body->getTotalForce();
    const btVector3 turn = seconds * body->getAngularVelocity();
    return {toGlm(seconds * velocity + turn.cross(point - body->getCenterOfMassPosition())), toGlm(turn)};
}

btVector3 velocityOf(const btCollisionObject& object) {
    const auto* body = btRigidBody::upcast(&object);
    return body && !body->isStaticObject() ? body->getLinearVelocity() : btVector3(0, 0, 0);
}

float sizeOf(const btCollisionShape& shape) {
    btVector3 centre;
    btScalar radius;
    shape.getBoundingSphere(centre, radius);
    return radius;
}

/// A shape where it stands in the world, and how it moves; for the child of a compound, the child's own.
struct Side {
    const btCollisionShape* shape;
    btTransform transform;
    const btCollisionObject* object;
    float seconds;  ///< until the next step; 0: contacts are asked for as things are

    Motion motionAt(const glm::vec3& point) const { return motionOf(*object, toBullet(point), seconds); }
    Motion motion() const { return motionAt(toGlm(transform.getOrigin())); }
    /// Of a field's.
    Placed placed() const {
        Placed body = static_cast<const Shape&>(*shape).placed(transform);
        if (static_cast<const Shape&>(*shape).sweeps()) body.motion = motionAt(body.pose.position);
        return body;
    }
};

Side sideOf(const btCollisionObjectWrapper& wrap, float seconds) {
    return {wrap.getCollisionShape(), wrap.getWorldTransform(), wrap.getCollisionObject(), seconds};
}

/// Up to where contacts are made.
float marginOf(const Side& a, const Side& b) {
    return isField(a.shape) ? std::max(a.shape->getMargin(), b.shape->getMargin()) : b.shape->getMargin();
}

/// Of two bodies of which B is a field.
Continuity continuityOf(const btCollisionShape& a, const btCollisionShape& b, float seconds) {
    const auto restingFriction = [](const btCollisionShape& shape) {
        return isField(&shape) ? static_cast<const Shape&>(shape).restingFriction() : 1;
    };
    float sameWithin = b.getContactBreakingThreshold(gContactBreakingThreshold);
    if (isField(&a)) sameWithin = std::min(sameWithin, a.getContactBreakingThreshold(gContactBreakingThreshold));
    return {.sameWithin = sameWithin,
            .restingFriction = std::max(restingFriction(a), restingFriction(b)),
            .seconds = seconds};
}

/// Two overlapping bodies of which B is a field. Collides them without a call that changes anything in Bullet, so that
/// many pairs can do it at once, and hands the contacts over later.
class Pair {
  public:
    Pair(btDispatcher& dispatcher, DispatchStatistics& statistics) : manifolds_(dispatcher), statistics_(statistics) {}

    /// In a step: finds and reduces contacts up to the shapes' margins.
    void collide(const Side& a, const Side& b) {
        find(a, b, marginOf(a, b), false);
        finish(a, b);
    }

    /// In a contact test: up to the margins; where there are none, up to twice as far in turns, and then once more, as
    /// far as it takes to be sure of the nearest.
    /// @param asked  contacts up to this distance, or the margin if that is larger [m]
    void test(const Side& a, const Side& b, float asked) {
        const float voxel = static_cast<const Shape&>(*b.shape).voxelSize();
        float margin = std::max(marginOf(a, b), std::min(asked, voxel));
        const float most = std::max(margin, asked);
        // a place between surface points is found by those around it, which are farther away
        const float between = probeSpacing * voxel;
        find(a, b, margin, true);
        while (contacts_.empty() && margin < most + between)
            find(a, b, margin = std::min(std::max(2 * margin, voxel), most + between), true);
        if (const float surely = nearest() + between; !contacts_.empty() && surely > margin) find(a, b, surely, true);
        std::erase_if(contacts_, [&](const Contact& contact) { return contact.distance > most; });
        finish(a, b);
    }

    /// The same for two fields whose points have been sampled, as pair number `index`.
    void collide(const Side& a, const Side& b, const SampledPairs& sampled, std::size_t index) {
        contacts_.clear();
        report_ =
            collideFields(a.placed(), b.placed(), marginOf(a, b), sampled.ofA(index), sampled.ofB(index), contacts_);
        finish(a, b);
        ++sampled_;
    }

    /// Writes what collide() found into the manifolds; once.
    void commit(const btCollisionObject& a, const btCollisionObject& b, const Continuity& continuity,
                btManifoldResult& result) {
        const Reduced& reduced = choice_.reduced();
        manifolds_.write(reduced.patches, a, b, continuity, result);
        ++statistics_.pairs;
        statistics_.contactsFound += found_;
        for (const Patch& patch : reduced.patches) statistics_.contactsKept += patch.count;
        statistics_.lost = std::max(statistics_.lost, reduced.lost);
        statistics_.beyondBand += static_cast<int>(report_.beyondBand);
        statistics_.sampled += sampled_;
        isReady_ = false;
    }

    bool isReady() const { return isReady_; }
    void forget() { isReady_ = false; }
    const Manifolds& manifolds() const { return manifolds_; }

  private:
    float nearest() const {
        float least = std::numeric_limits<float>::max();
        for (const Contact& contact : contacts_) least = std::min(least, contact.distance);
        return least;
    }

    void find(const Side& a, const Side& b, float margin, bool measured) {
        contacts_.clear();
        const bool follows = static_cast<const Shape&>(*b.shape).sweeps();
        report_ = isField(a.shape) ? collideFields(a.placed(), b.placed(), margin, measured, near_, contacts_)
                                   : collideOther(a, b.placed(), margin, measured, follows ? a.motion() : Motion{});
    }

    void finish(const Side& a, const Side& b) {
        found_ = static_cast<int>(contacts_.size());
        choice_.update(contacts_, a.transform, b.transform);
        isReady_ = true;
        sampled_ = 0;
    }

    ContactReport collideOther(const Side& a, const Placed& field, float margin, bool measured, const Motion& motion) {
        if (a.shape->getShapeType() == STATIC_PLANE_PROXYTYPE) {
            const auto& plane = static_cast<const btStaticPlaneShape&>(*a.shape);
            const btVector3 normal = a.transform.getBasis() * plane.getPlaneNormal();
            const float offset = plane.getPlaneConstant() + normal.dot(a.transform.getOrigin());
            const Motion planeMotion = motion.about(toGlm(a.transform.getOrigin()), glm::vec3(0));
            return collidePlane(toGlm(normal), offset, planeMotion, field, margin, measured, contacts_);
        }
        if (a.shape->isConvex()) {
            const auto& convex = static_cast<const btConvexShape&>(*a.shape);
            if (!convex_ || !convex_->isOf(convex)) convex_.emplace(convex);
            return collideConvex(*convex_, toPose(a.transform), motion, field, margin, measured, contacts_);
        }
        return collideTriangles(static_cast<const btConcaveShape&>(*a.shape), a.transform, motion, field, margin,
                                measured, contacts_);
    }

    Manifolds manifolds_;
    DispatchStatistics& statistics_;
    std::optional<Convex> convex_;  ///< of A
    NearPoints near_;               ///< of two fields
    std::vector<Contact> contacts_;
    Choice choice_;
    ContactReport report_;
    int found_ = 0, sampled_ = 0;
    bool isReady_ = false;
};

/// Of the step under way.
struct StepState {
    DispatchStatistics running;  ///< contact tests between steps count here too
    float seconds = 0;           ///< that it takes; 0 between steps
    bool foreseesAll = true;
    bool isForeign = false;  ///< the dispatcher is another one, which does not tell its steps

    /// Contact tests ask for a distance, or hand over a result of their own kind, and not within a step.
    bool isTest(const btManifoldResult& result) const {
        if (result.m_closestPointDistanceThreshold > 0) return true;
        return seconds == 0 && typeid(result) != typeid(btManifoldResult);
    }

    float secondsOf(const btDispatcherInfo& info, bool isTest) const {
        if (!isForeign) return seconds;
        return isTest ? 0 : info.m_timeStep;
    }

    /// How far ahead the motion of two bodies is looked at. What goes farther than its own size is the business of a
    /// NoPassing, which does not see what the user moves, nor inside of what locks.
    float ahead(const btCollisionObjectWrapper& a, const btCollisionObjectWrapper& b, float step) const {
        const auto isLeft = [](const btCollisionObjectWrapper& side) {
            return side.getCollisionObject()->isKinematicObject() || locks(side.getCollisionShape());
        };
        if (foreseesAll || isLeft(a) || isLeft(b)) return step;
        const btVector3 way = step * (velocityOf(*a.getCollisionObject()) - velocityOf(*b.getCollisionObject()));
        const float size = std::min(sizeOf(*a.getCollisionShape()), sizeOf(*b.getCollisionShape()));
        return way.length() <= size ? step : 0;
    }
};

class Algorithm : public btCollisionAlgorithm {
  public:
    Algorithm(const btCollisionAlgorithmConstructionInfo& info, bool bIsSecond, StepState& state)
        : btCollisionAlgorithm(info),
          pair_(std::make_shared<Pair>(*info.m_dispatcher1, state.running)),
          state_(state),
          bIsSecond_(bIsSecond) {}

    /// Shared, since a callback of the user's may remove the bodies while a batch is under way.
    const std::shared_ptr<Pair>& pair() const { return pair_; }
    bool bIsSecond() const { return bIsSecond_; }

    void processCollision(const btCollisionObjectWrapper* first, const btCollisionObjectWrapper* second,
                          const btDispatcherInfo& info, btManifoldResult* result) override {
        const btCollisionObjectWrapper &a = bIsSecond_ ? *first : *second, &b = bIsSecond_ ? *second : *first;
        const bool isTest = state_.isTest(*result);
        const float seconds = state_.secondsOf(info, isTest);
        if (!pair_->isReady()) {
            const float ahead = state_.ahead(a, b, seconds);
            if (isTest)
                pair_->test(sideOf(a, ahead), sideOf(b, ahead), result->m_closestPointDistanceThreshold);
            else
                pair_->collide(sideOf(a, ahead), sideOf(b, ahead));
        }
        pair_->commit(*a.getCollisionObject(), *b.getCollisionObject(),
                      continuityOf(*a.getCollisionShape(), *b.getCollisionShape(), seconds), *result);
    }

    /// Bullet asks this of pairs in continuous dispatch, which its worlds never use.
    btScalar calculateTimeOfImpact(btCollisionObject*, btCollisionObject*, const btDispatcherInfo&,
                                   btManifoldResult*) override {
        return 1;
    }

    void getAllContactManifolds(btManifoldArray& manifolds) override {
        for (btPersistentManifold* manifold : pair_->manifolds().all()) manifolds.push_back(manifold);
    }

  private:
    std::shared_ptr<Pair> pair_;
    const StepState& state_;
    bool bIsSecond_;
};
static_assert(sizeof(Algorithm) <= poolElement);

struct CreateFunction : btCollisionAlgorithmCreateFunc {
    CreateFunction(bool bIsSecond, StepState& state) : bIsSecond(bIsSecond), state(state) {}

    btCollisionAlgorithm* CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                   const btCollisionObjectWrapper*,
                                                   const btCollisionObjectWrapper*) override {
        void* memory = info.m_dispatcher1->allocateCollisionAlgorithm(sizeof(Algorithm));
        return new (memory) Algorithm(info, bIsSecond, state);
    }

    bool bIsSecond;
    StepState& state;
};

/// Whether the pairs are a ghost's own, as character controllers dispatch them once more within a step.
bool isOfGhost(btOverlappingPairCache& cache) {
    if (cache.getNumOverlappingPairs() == 0) return false;
    const btBroadphasePair& pair = *cache.getOverlappingPairArrayPtr();
    const auto owns = [&](const btBroadphaseProxy* proxy) {
        auto* ghost = dynamic_cast<btPairCachingGhostObject*>(static_cast<btCollisionObject*>(proxy->m_clientObject));
        return ghost && ghost->getOverlappingPairCache() == &cache;
    };
    return owns(pair.m_pProxy0) || owns(pair.m_pProxy1);
}

/// What a dispatcher's tables point to.
struct AlgorithmFunctions {
    StepState state;
    CreateFunction fieldSecond{true, state};
    CreateFunction fieldFirst{false, state};

    void registerWith(btCollisionDispatcher& dispatcher) {
        std::vector<int> others{
            STATIC_PLANE_PROXYTYPE,  TRIANGLE_MESH_SHAPE_PROXYTYPE, SCALED_TRIANGLE_MESH_SHAPE_PROXYTYPE,
            TERRAIN_SHAPE_PROXYTYPE, GIMPACT_SHAPE_PROXYTYPE,       MULTIMATERIAL_TRIANGLE_MESH_PROXYTYPE};
        for (int type = 0; type < CONCAVE_SHAPES_START_HERE; ++type) others.push_back(type);
        const int field = FAST_CONCAVE_MESH_PROXYTYPE;
        // Bullet looks contacts and contact tests up in different tables.
        const auto fill = [&](int first, int second, CreateFunction& function) {
            dispatcher.registerCollisionCreateFunc(first, second, &function);
            dispatcher.registerClosestPointsCreateFunc(first, second, &function);
        };
        for (int other : others) {
            fill(other, field, fieldSecond);
            fill(field, other, fieldFirst);
        }
        fill(field, field, fieldSecond);
    }
};

}  // namespace

struct Dispatcher::Functions : AlgorithmFunctions {
    explicit Functions(PointSampler sampler) : sampledPairs(std::move(sampler)) {}

    SampledPairs sampledPairs;
    DispatchStatistics last;
};

struct FieldAlgorithms::Functions : AlgorithmFunctions {};

Dispatcher::Dispatcher(btCollisionConfiguration* configuration, PointSampler sampler)
    : btCollisionDispatcher(configuration), functions_(std::make_unique<Functions>(std::move(sampler))) {
    registerFields();
}

Dispatcher::~Dispatcher() = default;

void Dispatcher::registerFields() {
    functions_->registerWith(*this);
}

void Dispatcher::dispatchAllCollisionPairs(btOverlappingPairCache* cache, const btDispatcherInfo& info,
                                           btDispatcher* dispatcher) {
    const auto start = std::chrono::steady_clock::now();
    const bool isStep = !isOfGhost(*cache);
    functions_->state = {
        .running = {}, .seconds = isStep ? info.m_timeStep : 0, .foreseesAll = functions_->state.foreseesAll};

    struct Task {
        std::shared_ptr<Pair> pair;
        Side a, b;
        std::optional<std::size_t> sampled{};  // its number among these pairs
    };
    std::vector<Task> tasks;
    for (int i = 0; i < cache->getNumOverlappingPairs(); ++i) {
        btBroadphasePair& overlap = cache->getOverlappingPairArrayPtr()[i];
        auto* first = static_cast<btCollisionObject*>(overlap.m_pProxy0->m_clientObject);
        auto* second = static_cast<btCollisionObject*>(overlap.m_pProxy1->m_clientObject);
        if (!isField(first->getCollisionShape()) && !isField(second->getCollisionShape())) continue;
        if (!needsCollision(first, second)) continue;
        const btCollisionObjectWrapper one(nullptr, first->getCollisionShape(), first, first->getWorldTransform(), -1,
                                           -1);
        const btCollisionObjectWrapper two(nullptr, second->getCollisionShape(), second, second->getWorldTransform(),
                                           -1, -1);
        if (!overlap.m_algorithm) overlap.m_algorithm = findAlgorithm(&one, &two, nullptr, BT_CONTACT_POINT_ALGORITHMS);
        // Not ours: a compound's, which comes to us for its children, or one that the user has registered.
        const auto* algorithm = dynamic_cast<Algorithm*>(overlap.m_algorithm);
        if (!algorithm || locks(one.getCollisionShape()) || locks(two.getCollisionShape())) continue;
        const bool straight = algorithm->bIsSecond();
        const float ahead = functions_->state.ahead(one, two, functions_->state.seconds);
        tasks.push_back({algorithm->pair(), sideOf(straight ? one : two, ahead), sideOf(straight ? two : one, ahead)});
    }
    SampledPairs& sampled = functions_->sampledPairs;
    sampled.clear();
    if (sampled.works())
        for (Task& task : tasks)
            if (isField(task.a.shape))
                task.sampled = sampled.add(task.a.placed(), task.b.placed(), marginOf(task.a, task.b));
    const bool areSampled = sampled.sample();
    tbb::parallel_for_each(tasks, [&](Task& task) {
        if (areSampled && task.sampled)
            task.pair->collide(task.a, task.b, sampled, *task.sampled);
        else
            task.pair->collide(task.a, task.b);
    });

    btCollisionDispatcher::dispatchAllCollisionPairs(cache, info, dispatcher);

    for (const Task& task : tasks) task.pair->forget();
    functions_->state.seconds = 0;
    if (!isStep) return;
    functions_->last = functions_->state.running;
    functions_->last.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void Dispatcher::foreseeAll(bool motions) {
    functions_->state.foreseesAll = motions;
}

const DispatchStatistics& Dispatcher::statistics() const {
    return functions_->last;
}

FieldAlgorithms::FieldAlgorithms(btCollisionDispatcher& dispatcher)
    : dispatcher_(dispatcher), functions_(std::make_unique<Functions>()) {
    functions_->state.isForeign = true;
    registerFields();
}

FieldAlgorithms::~FieldAlgorithms() = default;

void FieldAlgorithms::registerFields() {
    functions_->registerWith(dispatcher_);
}

}  // namespace bilayer::bullet
