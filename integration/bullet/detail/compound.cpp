// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/compound.h"
#include <bilayer/collider/contact.h>

#include <BulletCollision/BroadphaseCollision/btDbvt.h>
#include <BulletCollision/CollisionDispatch/btCompoundCompoundCollisionAlgorithm.h>
#include <BulletCollision/CollisionShapes/btCompoundShape.h>
#include <LinearMath/btAabbUtil2.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <span>
#include <utility>

#include "integration/bullet/detail/convert.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

namespace {

struct Box {
    btVector3 lower, upper;

    void grow(float by) {
        lower -= btVector3(by, by, by);
        upper += btVector3(by, by, by);
    }
    bool meets(const Box& other) const { return TestAabbAgainstAabb2(lower, upper, other.lower, other.upper); }
};

Box boxOf(const Side& side) {
    Box box;
    side.shape->getAabb(side.transform, box.lower, box.upper);
    return box;
}

/// Upper bound of the displacement of a shape's points by rotation.
float maxRotationDisplacement(const Motion& motion, const Side& side, const Box& box) {
    const btVector3 &origin = side.transform.getOrigin(), ofLower = (box.lower - origin).absolute();
    btVector3 farthest = (box.upper - origin).absolute();
    farthest.setMax(ofLower);
    return glm::length(motion.rotation) * farthest.length();
}

/// Bounding box of a shape's points over the whole step.
Box sweptBoxOf(const Side& side) {
    Box box = boxOf(side);
    const Motion motion = side.motion();
    const float rotation = maxRotationDisplacement(motion, side, box);
    const btVector3 displacement = toBullet(motion.displacement), lower = box.lower + displacement,
                    upper = box.upper + displacement;
    box.lower.setMin(lower);
    box.upper.setMax(upper);
    box.grow(rotation);
    return box;
}

/// @param visit  callback (int index) for the children of a compound whose boxes overlap a box of the world, in any
///               order
template <class Visit>
void visitChildren(const Side& side, const Box& box, Visit&& visit) {
    const auto& compound = static_cast<const btCompoundShape&>(*side.shape);
    const btDbvt* tree = compound.getDynamicAabbTree();
    if (!tree) {
        for (int i = 0; i < compound.getNumChildShapes(); ++i) visit(i);
        return;
    }
    struct LeafVisitor : btDbvt::ICollide {
        explicit LeafVisitor(Visit& visit) : visit(visit) {}
        void Process(const btDbvtNode* leaf) override { visit(leaf->dataAsInt); }
        Visit& visit;
    } visitor(visit);
    btVector3 lower, upper;
    const btVector3 half = 0.5f * (box.upper - box.lower), middle = 0.5f * (box.upper + box.lower);
    btTransformAabb(half, 0, side.transform.inverse() * btTransform(btQuaternion::getIdentity(), middle), lower, upper);
    tree->collideTV(tree->m_root, btDbvtVolume::FromMM(lower, upper), visitor);
}

Side childOf(const Side& side, int index) {
    const auto& compound = static_cast<const btCompoundShape&>(*side.shape);
    return {*compound.getChildShape(index), side.transform * compound.getChildTransform(index), *side.object,
            side.seconds};
}

/// Descends two compounds to the children that may meet in the step.
class ChildPairSearch {
  public:
    using Children = CompoundAlgorithm::Children;

    /// @param within  maximum distance of the children [m]
    explicit ChildPairSearch(float within) : within_(within) {}

    /// Sorted by their indices.
    std::vector<Children> operator()(const Side& first, const Side& second) {
        areCompounds_ = first.shape->isCompound() && second.shape->isCompound();
        descend({first, holdsField(*first.shape)}, {second, holdsField(*second.shape)});
        std::sort(found_.begin(), found_.end(), [](const Children& a, const Children& b) {
            return std::tie(a.firstPath, a.secondPath) < std::tie(b.firstPath, b.secondPath);
        });
        return std::move(found_);
    }

  private:
    /// A shape that the descent into compounds visits.
    struct Node {
        Side side;
        bool holdsField;
    };

    void descend(const Node& first, const Node& second) {
        if (!first.holdsField && !second.holdsField) return;
        if (first.side.shape->isCompound())
            visit(first, second, firstPath_, [&](const Node& child) { descend(child, second); });
        else if (second.side.shape->isCompound())
            visit(second, first, secondPath_, [&](const Node& child) { descend(first, child); });
        else if (!isRefused(*first.side.shape, *second.side.shape))
            found_.push_back({firstPath_, secondPath_, first.side, second.side});
    }

    template <class Visit>
    void visit(const Node& compound, const Node& other, CompoundAlgorithm::Path& path, Visit&& visit) {
        Box around = sweptBoxOf(other.side);
        around.grow(within_);
        Box from = around;  // positions of the children that may reach it
        const Motion motion = compound.side.motion();
        from.grow(glm::length(motion.displacement) +
                  maxRotationDisplacement(motion, compound.side, boxOf(compound.side)));
        visitChildren(compound.side, from, [&](int index) {
            const Side child = childOf(compound.side, index);
            const bool holds = compound.holdsField && holdsField(*child.shape);
            if (!(holds || other.holdsField) || !sweptBoxOf(child).meets(around)) return;
            path.push_back(index);
            visit({child, holds});
            path.pop_back();
        });
    }

    /// Calls Bullet's filter callbacks for children. If both shapes are compounds, it is a different callback with
    /// another order of arguments.
    bool isRefused(const btCollisionShape& first, const btCollisionShape& second) const {
        if (areCompounds_)
            return gCompoundCompoundChildShapePairCallback && !gCompoundCompoundChildShapePairCallback(&first, &second);
        if (!gCompoundChildShapePairCallback) return false;
        return firstPath_.empty() ? !gCompoundChildShapePairCallback(&first, &second)
                                  : !gCompoundChildShapePairCallback(&second, &first);
    }

    float within_;
    bool areCompounds_ = false;
    CompoundAlgorithm::Path firstPath_, secondPath_;
    std::vector<Children> found_;
};

/// Scope guard: replaces the wrappers of a result while children hand over their contacts.
class ChildWrappers {
  public:
    ChildWrappers(btManifoldResult& result, const btCollisionObjectWrapper& first,
                  const btCollisionObjectWrapper& second)
        : result_(result), before_{result.getBody0Wrap(), result.getBody1Wrap()} {
        const bool isStraight = result.getBody0Internal() == first.getCollisionObject();
        result.setBody0Wrap(isStraight ? &first : &second);
        result.setBody1Wrap(isStraight ? &second : &first);
    }
    ~ChildWrappers() {
        result_.setBody0Wrap(before_[0]);
        result_.setBody1Wrap(before_[1]);
    }
    ChildWrappers(const ChildWrappers&) = delete;
    ChildWrappers& operator=(const ChildWrappers&) = delete;

  private:
    btManifoldResult& result_;
    const btCollisionObjectWrapper* before_[2];
};

/// Calls used(wrapper) with the wrapper of a child, whose parents are the wrappers of its enclosing compounds.
template <class Used>
void withWrapper(const btCollisionObjectWrapper& parent, std::span<const int> path, Used&& used) {
    if (path.empty()) return used(parent);
    const auto& compound = static_cast<const btCompoundShape&>(*parent.getCollisionShape());
    const btTransform place = parent.getWorldTransform() * compound.getChildTransform(path.front());
    const btCollisionObjectWrapper child(&parent, compound.getChildShape(path.front()), parent.getCollisionObject(),
                                         place, -1, path.front());
    withWrapper(child, path.subspan(1), used);
}

}  // namespace

bool holdsField(const btCollisionShape& shape) {
    if (!shape.isCompound()) return isField(shape);
    const auto& compound = static_cast<const btCompoundShape&>(shape);
    for (int i = 0; i < compound.getNumChildShapes(); ++i)
        if (holdsField(*compound.getChildShape(i))) return true;
    return false;
}

bool locks(const btCollisionShape& shape) {
    return shape.getShapeType() == GIMPACT_SHAPE_PROXYTYPE;
}

CompoundAlgorithm::~CompoundAlgorithm() {
    rest_->~btCollisionAlgorithm();
    m_dispatcher->freeCollisionAlgorithm(rest_);
}

CompoundAlgorithm::Key CompoundAlgorithm::keyOf(const Children& children) {
    return {children.firstPath, children.secondPath, isField(*children.second.shape)};
}

Task CompoundAlgorithm::taskOf(const Children& children) {
    const bool bIsSecond = isField(*children.second.shape);
    std::shared_ptr<Pair>& pair = (*pairs_)[keyOf(children)];
    if (!pair) pair = std::make_shared<Pair>(*m_dispatcher, state_.running);
    return state_.taskOf(pair, bIsSecond ? children.first : children.second,
                         bIsSecond ? children.second : children.first);
}

void CompoundAlgorithm::gather(const btCollisionObjectWrapper& first, const btCollisionObjectWrapper& second,
                               float seconds, std::vector<Task>& tasks) {
    for (const Children& children : ChildPairSearch(0)(Side(first, seconds), Side(second, seconds)))
        tasks.push_back(taskOf(children));
}

void CompoundAlgorithm::processCollision(const btCollisionObjectWrapper* first, const btCollisionObjectWrapper* second,
                                         const btDispatcherInfo& info, btManifoldResult* result) {
    {
        const CompoundByBullet left(state_);
        rest_->processCollision(first, second, info, result);
    }
    const bool isTest = state_.isTest(*result);
    const float seconds = state_.secondsOf(info, isTest);
    Pairs met;
    const std::shared_ptr<Pairs> pairs = pairs_;  // a user's callback may destroy this algorithm
    for (const Children& children :
         ChildPairSearch(result->m_closestPointDistanceThreshold)(Side(*first, seconds), Side(*second, seconds))) {
        const Task task = taskOf(children);
        task.collide(*result, isTest);
        withWrapper(*first, children.firstPath, [&](const btCollisionObjectWrapper& one) {
            withWrapper(*second, children.secondPath, [&](const btCollisionObjectWrapper& two) {
                const ChildWrappers wrappers(*result, one, two);
                task.pair->commit(*task.a.object, *task.b.object, seconds, *result);
            });
        });
        if (pairs.use_count() == 1) return;
        met.emplace(keyOf(children), task.pair);
    }
    *pairs_ = std::move(met);
}

void CompoundAlgorithm::getAllContactManifolds(btManifoldArray& manifolds) {
    rest_->getAllContactManifolds(manifolds);
    for (const auto& [key, pair] : *pairs_)
        for (btPersistentManifold* manifold : pair->manifolds().all()) manifolds.push_back(manifold);
}

}  // namespace bilayer::bullet::detail
