// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/algorithms.h"
#include <bilayer/collider/contact.h>

#include <BulletCollision/CollisionDispatch/btCollisionConfiguration.h>
#include <BulletCollision/CollisionDispatch/btEmptyCollisionAlgorithm.h>

#include <algorithm>
#include <new>
#include <utility>

#include "integration/bullet/detail/compound.h"
#include "integration/bullet/detail/velocity.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

namespace {

// The size of an element of Bullet's pool [bytes]: that of Bullet's largest algorithm, for any requested size.
constexpr std::size_t poolElement = 184;

template <class Algorithm, class... Arguments>
btCollisionAlgorithm* make(const btCollisionAlgorithmConstructionInfo& info, Arguments&&... arguments) {
    static_assert(sizeof(Algorithm) <= poolElement);
    void* memory = info.m_dispatcher1->allocateCollisionAlgorithm(sizeof(Algorithm));
    return new (memory) Algorithm(info, std::forward<Arguments>(arguments)...);
}

/// Whether Bullet asks while it traverses a compound whose fields are collided by us. Otherwise a user asks, in a
/// callback.
bool isSkipped(const StepState& state, const btCollisionObjectWrapper& first, const btCollisionObjectWrapper& second) {
    return state.skipsFieldsInCompounds && (first.m_parent || second.m_parent);
}

/// A pair of a field and a shape other than a compound.
class PairAlgorithm : public FieldAlgorithm {
  public:
    PairAlgorithm(const btCollisionAlgorithmConstructionInfo& info, bool bIsSecond, StepState& state)
        : FieldAlgorithm(info),
          pair_(std::make_shared<Pair>(*info.m_dispatcher1, state.running)),
          state_(state),
          bIsSecond_(bIsSecond) {}

    void gather(const btCollisionObjectWrapper& first, const btCollisionObjectWrapper& second, float seconds,
                std::vector<Task>& tasks) override {
        tasks.push_back(taskOf(first, second, seconds));
    }

    void processCollision(const btCollisionObjectWrapper* first, const btCollisionObjectWrapper* second,
                          const btDispatcherInfo& info, btManifoldResult* result) override {
        const bool isTest = state_.isTest(*result);
        const float seconds = state_.secondsOf(info, isTest);
        const Task task = taskOf(*first, *second, seconds);
        task.collide(*result, isTest);
        pair_->commit(*task.a.object, *task.b.object, seconds, *result);
    }

    void getAllContactManifolds(btManifoldArray& manifolds) override {
        for (btPersistentManifold* manifold : pair_->manifolds().all()) manifolds.push_back(manifold);
    }

  private:
    Task taskOf(const btCollisionObjectWrapper& first, const btCollisionObjectWrapper& second, float seconds) const {
        return state_.taskOf(pair_, Side(bIsSecond_ ? first : second, seconds),
                             Side(bIsSecond_ ? second : first, seconds));
    }

    std::shared_ptr<Pair> pair_;
    const StepState& state_;
    bool bIsSecond_;
};

struct CreatePair : btCollisionAlgorithmCreateFunc {
    CreatePair(bool bIsSecond, StepState& state) : bIsSecond(bIsSecond), state(state) {}

    btCollisionAlgorithm* CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                   const btCollisionObjectWrapper* first,
                                                   const btCollisionObjectWrapper* second) override {
        if (isSkipped(state, *first, *second)) return make<btEmptyAlgorithm>(info);
        return make<PairAlgorithm>(info, bIsSecond, state);
    }

    bool bIsSecond;
    StepState& state;
};

/// Creates the algorithm of a pair with one or two compounds. Pairs without a field are left to Bullet.
struct CreateCompound : btCollisionAlgorithmCreateFunc {
    CreateCompound(btCollisionAlgorithmCreateFunc& ofBullet, StepState& state) : ofBullet(ofBullet), state(state) {}

    btCollisionAlgorithm* CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                   const btCollisionObjectWrapper* first,
                                                   const btCollisionObjectWrapper* second) override {
        const bool ours = !isSkipped(state, *first, *second) &&
                          (holdsField(*first->getCollisionShape()) || holdsField(*second->getCollisionShape()));
        if (!ours) return ofBullet.CreateCollisionAlgorithm(info, first, second);
        const CompoundByBullet left(state);  // it creates some algorithms of the children at once
        btCollisionAlgorithm* rest = ofBullet.CreateCollisionAlgorithm(info, first, second);
        return make<CompoundAlgorithm>(info, rest, state);
    }

    btCollisionAlgorithmCreateFunc& ofBullet;
    StepState& state;
};

/// Types of shapes that are neither fields nor compounds.
std::vector<int> rigidTypes() {
    std::vector<int> types{
        STATIC_PLANE_PROXYTYPE,  TRIANGLE_MESH_SHAPE_PROXYTYPE, SCALED_TRIANGLE_MESH_SHAPE_PROXYTYPE,
        TERRAIN_SHAPE_PROXYTYPE, GIMPACT_SHAPE_PROXYTYPE,       MULTIMATERIAL_TRIANGLE_MESH_PROXYTYPE};
    for (int type = 0; type < CONCAVE_SHAPES_START_HERE; ++type) types.push_back(type);
    return types;
}

/// Whether the relative displacement of two shapes in a step exceeds the size of either.
bool mayPassEachOther(const Side& a, const Side& b) {
    const auto sizeOf = [](const Side& side) {
        btVector3 centre;
        btScalar radius;
        side.shape->getBoundingSphere(centre, radius);
        return radius;
    };
    const btVector3 displacement = a.seconds * (velocityOf(*a.object).linear - velocityOf(*b.object).linear);
    return displacement.length() > std::min(sizeOf(a), sizeOf(b));
}

}  // namespace

void Task::collide(const btManifoldResult& result, bool isTest) const {
    if (pair->isReady()) return;
    if (isTest)
        pair->test(a, b, result.m_closestPointDistanceThreshold);
    else
        pair->collide(a, b);
}

bool StepState::isTest(const btManifoldResult& result) const {
    if (result.m_closestPointDistanceThreshold > 0) return true;
    return seconds == 0 && isOfUser(result);
}

float StepState::secondsOf(const btDispatcherInfo& info, bool isTest) const {
    if (!hasOtherDispatcher) return seconds;
    return isTest ? 0 : info.m_timeStep;
}

Task StepState::taskOf(std::shared_ptr<Pair> pair, Side a, Side b) const {
    const auto needsSpeculation = [](const Side& side) {
        return side.object->isKinematicObject() || locks(*side.shape);
    };
    if (!speculatesOnAll && !needsSpeculation(a) && !needsSpeculation(b) && mayPassEachOther(a, b))
        a.seconds = b.seconds = 0;
    return {std::move(pair), a, b};
}

struct FieldAlgorithmFunctions::Functions {
    /// A function and its position in the dispatcher's tables, of contacts or of contact tests.
    struct Compound {
        int first, second;
        bool isOfTests;
        CreateCompound function;
    };

    Functions(btCollisionConfiguration& configuration, StepState& state)
        : fieldSecond(true, state), fieldFirst(false, state) {
        const auto add = [&](int first, int second) {
            compounds.push_back(
                {first, second, false, {*configuration.getCollisionAlgorithmCreateFunc(first, second), state}});
            compounds.push_back(
                {first, second, true, {*configuration.getClosestPointsAlgorithmCreateFunc(first, second), state}});
        };
        const int compound = COMPOUND_SHAPE_PROXYTYPE;
        for (const int other : rigidTypes()) {
            if (other == GIMPACT_SHAPE_PROXYTYPE) continue;
            add(compound, other);
            add(other, compound);
        }
        add(compound, FAST_CONCAVE_MESH_PROXYTYPE);
        add(FAST_CONCAVE_MESH_PROXYTYPE, compound);
        add(compound, compound);
    }

    CreatePair fieldSecond, fieldFirst;
    std::vector<Compound> compounds;
};

FieldAlgorithmFunctions::FieldAlgorithmFunctions(btCollisionConfiguration& configuration)
    : functions_(std::make_unique<Functions>(configuration, state)) {}

FieldAlgorithmFunctions::~FieldAlgorithmFunctions() = default;

void FieldAlgorithmFunctions::registerWith(btCollisionDispatcher& dispatcher) {
    const int field = FAST_CONCAVE_MESH_PROXYTYPE;
    // Bullet has separate tables for contacts and contact tests.
    const auto fill = [&](int first, int second, CreatePair& function) {
        dispatcher.registerCollisionCreateFunc(first, second, &function);
        dispatcher.registerClosestPointsCreateFunc(first, second, &function);
    };
    for (const int other : rigidTypes()) {
        fill(other, field, functions_->fieldSecond);
        fill(field, other, functions_->fieldFirst);
    }
    fill(field, field, functions_->fieldSecond);
    for (Functions::Compound& compound : functions_->compounds) {
        if (compound.isOfTests)
            dispatcher.registerClosestPointsCreateFunc(compound.first, compound.second, &compound.function);
        else
            dispatcher.registerCollisionCreateFunc(compound.first, compound.second, &compound.function);
    }
}

}  // namespace bilayer::bullet::detail
