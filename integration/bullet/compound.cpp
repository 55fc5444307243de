#include "integration/bullet/compound.h"

#include <BulletCollision/BroadphaseCollision/btDbvt.h>
#include <BulletCollision/CollisionDispatch/btCompoundCompoundCollisionAlgorithm.h>
#include <BulletCollision/CollisionShapes/btCompoundShape.h>
#include <LinearMath/btAabbUtil2.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <utility>

#include "integration/bullet/convert.h"

namespace bilayer::bullet {

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

/// How far a shape's turn takes any of its points in the step, at most.
float turningOf(const Side& side, const Box& box) {
    const btVector3 &origin = side.transform.getOrigin(), ofLower = (box.lower - origin).absolute();
    btVector3 farthest = (box.upper - origin).absolute();
    farthest.setMax(ofLower);
    return glm::length(side.motion().turn) * farthest.length();
}

/// Around all places where a shape's points are in the step.
Box sweptBoxOf(const Side& side) {
    Box box = boxOf(side);
    const float turning = turningOf(side, box);
    const btVector3 way = toBullet(side.motion().way), lower = box.lower + way, upper = box.upper + way;
    box.lower.setMin(lower);
    box.upper.setMax(upper);
    box.grow(turning);
    return box;
}

/// @param visit  (int index), for the children of a compound whose boxes meet one of the world, in no order
template <class Visit>
void visitChildren(const Side& side, const Box& box, Visit&& visit) {
    const auto& compound = static_cast<const btCompoundShape&>(*side.shape);
    const btDbvt* tree = compound.getDynamicAabbTree();
    if (!tree) {
        for (int i = 0; i < compound.getNumChildShapes(); ++i) visit(i);
        return;
    }
    struct Found : btDbvt::ICollide {
        explicit Found(Visit& visit) : visit(visit) {}
        void Process(const btDbvtNode* leaf) override { visit(leaf->dataAsInt); }
        Visit& visit;
    } found(visit);
    btVector3 lower, upper;
    const btVector3 half = 0.5f * (box.upper - box.lower), middle = 0.5f * (box.upper + box.lower);
    btTransformAabb(half, 0, side.transform.inverse() * btTransform(btQuaternion::getIdentity(), middle), lower, upper);
    tree->collideTV(tree->m_root, btDbvtVolume::FromMM(lower, upper), found);
}

Side childOf(const Side& side, int index) {
    const auto& compound = static_cast<const btCompoundShape&>(*side.shape);
    return {*compound.getChildShape(index), side.transform * compound.getChildTransform(index), *side.object,
            side.seconds};
}

/// Goes down two compounds to the children that may meet in the step.
class Descent {
  public:
    using Children = CompoundAlgorithm::Children;

    /// @param within  how far apart children may be [m]
    explicit Descent(float within) : within_(within) {}

    /// In the order of their indices.
    std::vector<Children> operator()(const Side& first, const Side& second) {
        descend(first, second);
        std::sort(found_.begin(), found_.end(), [](const Children& a, const Children& b) {
            return std::tie(a.firstPath, a.secondPath) < std::tie(b.firstPath, b.secondPath);
        });
        return std::move(found_);
    }

  private:
    void descend(const Side& first, const Side& second) {
        if (!holdsField(*first.shape) && !holdsField(*second.shape)) return;
        if (first.shape->isCompound())
            visit(first, second, firstPath_, [&](const Side& child) { descend(child, second); });
        else if (second.shape->isCompound())
            visit(second, first, secondPath_, [&](const Side& child) { descend(first, child); });
        else
            found_.push_back({firstPath_, secondPath_, first, second});
    }

    template <class Visit>
    void visit(const Side& compound, const Side& other, CompoundAlgorithm::Path& path, Visit&& visit) {
        Box around = sweptBoxOf(other);
        around.grow(within_);
        Box from = around;  // where children are that come to it
        from.grow(glm::length(compound.motion().way) + turningOf(compound, boxOf(compound)));
        visitChildren(compound, from, [&](int index) {
            const Side child = childOf(compound, index);
            if (!sweptBoxOf(child).meets(around) || isRefused(*child.shape, *other.shape)) return;
            path.push_back(index);
            visit(child);
            path.pop_back();
        });
    }

    /// By the callback that Bullet asks about children.
    static bool isRefused(const btCollisionShape& child, const btCollisionShape& other) {
        if (other.isCompound()) return false;  // before it has come to that one's children
        return gCompoundChildShapePairCallback && !gCompoundChildShapePairCallback(&other, &child);
    }

    float within_;
    CompoundAlgorithm::Path firstPath_, secondPath_;
    std::vector<Children> found_;
};

/// Puts other wraps into a result while children hand their contacts over.
class Unwrapped {
  public:
    Unwrapped(btManifoldResult& result, const btCollisionObjectWrapper& first, const btCollisionObjectWrapper& second)
        : result_(result), before_{result.getBody0Wrap(), result.getBody1Wrap()} {
        const bool isStraight = result.getBody0Internal() == first.getCollisionObject();
        result.setBody0Wrap(isStraight ? &first : &second);
        result.setBody1Wrap(isStraight ? &second : &first);
    }
    ~Unwrapped() {
        result_.setBody0Wrap(before_[0]);
        result_.setBody1Wrap(before_[1]);
    }
    Unwrapped(const Unwrapped&) = delete;
    Unwrapped& operator=(const Unwrapped&) = delete;

  private:
    btManifoldResult& result_;
    const btCollisionObjectWrapper* before_[2];
};

btCollisionObjectWrapper wrapOf(const Side& child, const btCollisionObjectWrapper& parent,
                                const CompoundAlgorithm::Path& path) {
    return {&parent, child.shape, child.object, child.transform, parent.m_partId, path.empty() ? -1 : path.back()};
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

Task CompoundAlgorithm::taskOf(const Children& children) {
    const bool bIsSecond = isField(*children.second.shape);
    Side a = bIsSecond ? children.first : children.second, b = bIsSecond ? children.second : children.first;
    a.seconds = b.seconds = state_.ahead(a, b, a.seconds);
    std::shared_ptr<Pair>& pair = pairs_[{children.firstPath, children.secondPath, bIsSecond}];
    if (!pair) pair = std::make_shared<Pair>(*m_dispatcher, state_.running);
    return {pair, a, b};
}

void CompoundAlgorithm::gather(const btCollisionObjectWrapper& first, const btCollisionObjectWrapper& second,
                               float seconds, std::vector<Task>& tasks) {
    for (const Children& children : Descent(0)(Side(first, seconds), Side(second, seconds)))
        if (const Task task = taskOf(children); !locks(*task.a.shape)) tasks.push_back(task);
}

void CompoundAlgorithm::processCollision(const btCollisionObjectWrapper* first, const btCollisionObjectWrapper* second,
                                         const btDispatcherInfo& info, btManifoldResult* result) {
    state_.leavesFields = true;
    rest_->processCollision(first, second, info, result);
    state_.leavesFields = false;

    const bool isTest = state_.isTest(*result);
    const float seconds = state_.secondsOf(info, isTest), within = result->m_closestPointDistanceThreshold;
    std::map<Key, std::shared_ptr<Pair>> met;
    for (const Children& children : Descent(within)(Side(*first, seconds), Side(*second, seconds))) {
        const auto& [pair, a, b] = taskOf(children);
        if (!pair->isReady()) {
            if (isTest)
                pair->test(a, b, within);
            else
                pair->collide(a, b);
        }
        const btCollisionObjectWrapper one = wrapOf(children.first, *first, children.firstPath),
                                       two = wrapOf(children.second, *second, children.secondPath);
        const Unwrapped unwrapped(*result, one, two);
        pair->commit(*a.object, *b.object, seconds, *result);
        met[{children.firstPath, children.secondPath, isField(*children.second.shape)}] = pair;
    }
    pairs_ = std::move(met);
}

void CompoundAlgorithm::getAllContactManifolds(btManifoldArray& manifolds) {
    rest_->getAllContactManifolds(manifolds);
    for (const auto& [key, pair] : pairs_)
        for (btPersistentManifold* manifold : pair->manifolds().all()) manifolds.push_back(manifold);
}

}  // namespace bilayer::bullet
