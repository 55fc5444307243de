#include "integration/bullet/no_passing.h"

#include <BulletCollision/BroadphaseCollision/btBroadphaseInterface.h>
#include <BulletCollision/BroadphaseCollision/btOverlappingPairCache.h>
#include <BulletCollision/CollisionShapes/btCompoundShape.h>
#include <BulletCollision/CollisionShapes/btStaticPlaneShape.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <LinearMath/btAabbUtil2.h>
#include <LinearMath/btTransformUtil.h>
#include <tbb/parallel_for_each.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <limits>
#include <optional>
#include <unordered_map>
#include <vector>

#include "integration/bullet/convert.h"
#include "integration/bullet/convex.h"
#include "integration/bullet/shape.h"

namespace bilayer::bullet {
namespace {

// What gets through is told by points that lie so far inside of their own body: contacts see to what overlaps less, and
// a body that slides along another one is not held [voxels].
constexpr float sunk = 0.25f;
// How deep such a point may go below the plane of the place where it enters, or deeper than it has been [voxels].
constexpr float allowed = 0.1f;
// Arcs are looked at as chords, which are off by the square of this over eight, in parts of the radius [rad].
constexpr float pieceTurn = 0.1f;
// A way is surely free as long as nothing is nearer than this [voxels].
constexpr float nearby = 0.5f;
// What an interpolated distance may be above the true one (see collide()) [voxels].
constexpr float interpolationError = 0.87f;
constexpr float flattest = 0.1f;  // a gradient shorter than this tells no direction
// Of a way along which something is nearby; what takes longer is looked at point by point, or taken as met.
constexpr int mostSteps = 64;
// A body that is held back may be met by another one: pairs are looked at again up to so many times.
constexpr int mostRounds = 8;

/// Where a way from one point to another enters an obstacle.
struct Entry {
    glm::vec3 position, normal;  ///< outward, of unit length
};

/// An obstacle in its own coordinates, distances in its own units.
class FieldObstacle {
  public:
    explicit FieldObstacle(const Field& field) : field_(field) {}

    /// Not more than the distance of its surface.
    float bound(const glm::vec3& point) const {
        return field_.distance(point) - interpolationError * field_.voxelSize();
    }
    std::optional<Entry> entry(const glm::vec3& from, const glm::vec3& to) const {
        const auto hit = field_.segment(from, to);
        if (!hit) return std::nullopt;
        return Entry{hit->position, hit->normal};
    }
    /// The way out of it for a point that is in it; none where that is not known.
    std::optional<glm::vec3> wayOut(const glm::vec3& point) const {
        const Sample sample = field_.sample(point);
        const float length = glm::length(sample.gradient);
        if (!sample.inBand || length < flattest) return std::nullopt;
        return -sample.distance / length * sample.gradient;
    }

  private:
    const Field& field_;
};

class ConvexObstacle {
  public:
    ConvexObstacle(const btConvexShape& shape, float tolerance) : convex_(shape), tolerance_(tolerance) {}

    float bound(const glm::vec3& point) const { return nearest(point).distance; }
    std::optional<Entry> entry(const glm::vec3& from, const glm::vec3& to) const {
        const glm::vec3 way = to - from;
        const float length = glm::length(way);
        float gone = 0;
        for (int i = 0; i < mostSteps; ++i) {
            const glm::vec3 at = length > 0 ? from + gone / length * way : from;
            const Convex::Near near = nearest(at);
            if (near.distance <= tolerance_) return Entry{at - near.distance * near.normal, near.normal};
            gone += near.distance;
            if (gone > length) break;
        }
        return std::nullopt;
    }
    std::optional<glm::vec3> wayOut(const glm::vec3& point) const {
        const Convex::Near near = nearest(point);
        return -near.distance * near.normal;
    }

  private:
    Convex::Near nearest(const glm::vec3& point) const {
        return convex_.nearest(point, std::numeric_limits<float>::max());
    }

    Convex convex_;
    float tolerance_;
};

class PlaneObstacle {
  public:
    explicit PlaneObstacle(const btStaticPlaneShape& shape)
        : normal_(toGlm(shape.getPlaneNormal())), offset_(shape.getPlaneConstant()) {}

    float bound(const glm::vec3& point) const { return glm::dot(normal_, point) - offset_; }
    std::optional<Entry> entry(const glm::vec3& from, const glm::vec3& to) const {
        const float before = bound(from), after = bound(to);
        if (before > 0 && after > 0) return std::nullopt;
        const float part = before > 0 ? before / (before - after) : 0;
        return Entry{from + part * (to - from), normal_};
    }
    std::optional<glm::vec3> wayOut(const glm::vec3& point) const { return -bound(point) * normal_; }

  private:
    glm::vec3 normal_;
    float offset_;
};

/// The way of an object through a step that has come to its end.
class Course {
  public:
    Course(btCollisionObject& object, float seconds)
        : object_(object),
          end_(object.getWorldTransform()),
          start_(end_.getOrigin()),
          orientation_(end_.getRotation()) {
        auto* body = btRigidBody::upcast(&object);
        if (!body || body->isStaticOrKinematicObject() || !body->isActive()) return;
        body_ = body;
        way_ = seconds * body->getLinearVelocity();
        start_ -= way_;
        const btVector3& spin = body->getAngularVelocity();
        const float angle = seconds * spin.length();
        if (!(angle > 0)) return;
        axis_ = spin.normalized();
        // beyond its limit, Bullet turns by another angle than the spin's, but about the same axis
        const float most = ANGULAR_MOTION_THRESHOLD;
        turn_ = angle > most ? 2 * std::atan(angle / most * std::tan(most / 2)) : angle;
    }

    const btCollisionObject& object() const { return object_; }
    float turn() const { return turn_; }
    bool moves() const { return body_; }

    /// Where it is after a part of the step [0..1].
    btTransform at(float time) const {
        if (!body_ || std::min(time, part_) >= 1) return end_;
        const float gone = std::min(time, part_), left = 1 - gone;
        const btTransform back(btQuaternion(axis_, -left * turn_));
        return btTransform((back.getRotation() * orientation_).normalized(), start_ + gone * way_);
    }

    /// A ball around everything about the object's origin.
    float radius() const {
        btVector3 centre;
        btScalar radius;
        object_.getCollisionShape()->getBoundingSphere(centre, radius);
        return centre.length() + radius;
    }
    float longest() const { return way_.length() + radius() * turn_; }
    void box(btVector3& lower, btVector3& upper) const {
        const float r = radius();
        lower = upper = start_;
        lower.setMin(start_ + way_);
        upper.setMax(start_ + way_);
        lower -= btVector3(r, r, r);
        upper += btVector3(r, r, r);
    }

    /// The part of the step after which it goes no farther.
    float part() const { return part_; }
    bool holdAt(float part) {
        if (!body_ || part >= part_) return false;
        part_ = part;
        return true;
    }
    /// Puts the body where it is held; whether it is.
    bool apply() const {
        if (part_ >= 1) return false;
        body_->setCenterOfMassTransform(at(part_));
        return true;
    }

  private:
    btCollisionObject& object_;
    btRigidBody* body_ = nullptr;
    btTransform end_;
    btVector3 start_, way_{0, 0, 0}, axis_{1, 0, 0};
    btQuaternion orientation_;  // at the end
    float turn_ = 0, part_ = 1;
};

/// A shape that is no compound, and where its object has it.
struct Part {
    const btCollisionShape* shape;
    btTransform local;

    const Shape* field() const {
        if (shape->getShapeType() != FAST_CONCAVE_MESH_PROXYTYPE) return nullptr;
        const auto* field = static_cast<const Shape*>(shape);
        return field->sweeps() ? field : nullptr;
    }
};

void partsOf(const btCollisionShape* shape, const btTransform& local, std::vector<Part>& parts) {
    if (!shape->isCompound()) {
        parts.push_back({shape, local});
        return;
    }
    const auto* compound = static_cast<const btCompoundShape*>(shape);
    for (int i = 0; i < compound->getNumChildShapes(); ++i)
        partsOf(compound->getChildShape(i), local * compound->getChildTransform(i), parts);
}

std::vector<Part> partsOf(const btCollisionObject& object) {
    std::vector<Part> parts;
    partsOf(object.getCollisionShape(), btTransform::getIdentity(), parts);
    return parts;
}

/// Takes a field's coordinates into an obstacle's at some time of the step.
struct Moment {
    float time;
    glm::mat3 linear;
    glm::vec3 shift;

    glm::vec3 operator()(const glm::vec3& point) const { return linear * point + shift; }
};

/// A field's coordinates, or those of another shape.
struct Frame {
    Pose pose;
    float scale;
};

Frame frameOf(const Part& part, const btTransform& object) {
    const btTransform here = object * part.local;
    if (part.shape->getShapeType() != FAST_CONCAVE_MESH_PROXYTYPE) return {toPose(here), 1};
    const Placed placed = static_cast<const Shape*>(part.shape)->placed(here);
    return {placed.pose, placed.scale};
}

/// From start to end, so close together that the ways in between are straight.
std::vector<Moment> momentsOf(const Part& points, const Course& its, const Part& obstacle, const Course& others) {
    const int pieces = std::max(1, int(std::ceil((its.turn() + others.turn()) / pieceTurn)));
    std::vector<float> times{its.part(), others.part()};
    for (int i = 0; i <= pieces; ++i) times.push_back(float(i) / float(pieces));
    std::sort(times.begin(), times.end());
    times.erase(std::unique(times.begin(), times.end()), times.end());
    std::vector<Moment> moments;
    for (const float time : times) {
        const Frame from = frameOf(points, its.at(time)), into = frameOf(obstacle, others.at(time));
        const Pose pose = relative(into.pose, from.pose);
        moments.push_back({time, from.scale / into.scale * glm::mat3_cast(pose.rotation), pose.position / into.scale});
    }
    return moments;
}

/// The surface points of a field on their ways through an obstacle.
template <class Obstacle>
class Passage {
  public:
    /// @param voxel  in the obstacle's units
    Passage(const Obstacle& obstacle, const Collider& collider, const std::vector<Moment>& moments, float voxel)
        : obstacle_(obstacle), collider_(collider), moments_(moments), voxel_(voxel) {
        scale_ = glm::length(moments.front().linear[0]);
    }

    /// When the first point goes too deep; 1 if none does.
    float first() {
        first_ = 1;
        const auto reject = [&](const glm::vec3& centre, float radius) { return !comesNear(centre, scale_ * radius); };
        collider_.points().visit(reject, [&](std::uint32_t, const SurfacePoint& point) { follow(point); });
        return first_;
    }

  private:
    bool comesNear(const glm::vec3& centre, float radius) const {
        for (std::size_t i = 0; i + 1 < moments_.size() && moments_[i].time < first_; ++i)
            if (comesNear(moments_[i](centre), moments_[i + 1](centre), radius)) return true;
        return false;
    }

    bool comesNear(const glm::vec3& from, const glm::vec3& to, float radius) const {
        const float length = glm::distance(from, to), near = nearby * voxel_;
        float gone = 0;
        for (int i = 0; i < mostSteps; ++i) {
            const glm::vec3 at = length > 0 ? from + gone / length * (to - from) : from;
            const float left = obstacle_.bound(at) - radius;
            if (left < near) return true;
            gone += left;
            if (gone > length) return false;
        }
        return true;
    }

    void follow(const SurfacePoint& point) {
        const glm::vec3 inner = point.position - sunk * voxel_ / scale_ * point.normal;
        glm::vec3 from = moments_.front()(inner), aside(0);
        // what is in there already may go on at its depth
        if (obstacle_.bound(from) <= 0)
            if (const auto inside = obstacle_.entry(from, from)) {
                const auto out = obstacle_.wayOut(from);
                if (!out) return;
                aside = *out;
            }
        from += aside;
        std::optional<Entry> entered;
        for (std::size_t i = 0; i + 1 < moments_.size() && moments_[i].time < first_; ++i) {
            const glm::vec3 to = moments_[i + 1](inner) + aside;
            if (!entered) entered = obstacle_.entry(from, to);
            if (entered) {
                const float before = glm::dot(entered->position - from, entered->normal);
                const float after = glm::dot(entered->position - to, entered->normal), deepest = allowed * voxel_;
                if (after > deepest) {
                    const float part = std::clamp((deepest - before) / (after - before), 0.f, 1.f);
                    const float time = moments_[i].time + part * (moments_[i + 1].time - moments_[i].time);
                    first_ = std::min(first_, time);
                    return;
                }
                if (after < 0) entered.reset();
            }
            from = to;
        }
    }

    const Obstacle& obstacle_;
    const Collider& collider_;
    const std::vector<Moment>& moments_;
    float voxel_, scale_, first_ = 1;
};

/// When a field's points get through another shape.
float passage(const Part& points, const Course& its, const Part& obstacle, const Course& others) {
    const Shape* field = points.field();
    if (!field) return 1;
    const std::vector<Moment> moments = momentsOf(points, its, obstacle, others);
    const Collider& collider = field->collider();
    if (const Shape* other = obstacle.field()) {
        const float voxel = std::min(field->voxelSize(), other->voxelSize()) / other->scale();
        return Passage(FieldObstacle(other->collider().field()), collider, moments, voxel).first();
    }
    const float voxel = field->voxelSize();
    if (obstacle.shape->getShapeType() == STATIC_PLANE_PROXYTYPE) {
        const PlaneObstacle plane(*static_cast<const btStaticPlaneShape*>(obstacle.shape));
        return Passage(plane, collider, moments, voxel).first();
    }
    if (!obstacle.shape->isConvex()) return 1;
    const ConvexObstacle convex(*static_cast<const btConvexShape*>(obstacle.shape), 0.1f * allowed * voxel);
    return Passage(convex, collider, moments, voxel).first();
}

struct Meeting {
    Course *a, *b;
    float time = 1;
    bool isOpen = true;  ///< to be looked at

    void look() {
        time = 1;
        for (const Part& partOfA : partsOf(a->object()))
            for (const Part& partOfB : partsOf(b->object()))
                time = std::min({time, passage(partOfA, *a, partOfB, *b), passage(partOfB, *b, partOfA, *a)});
    }

    /// Holds what goes farther, and where that is held already, the other one.
    bool hold() {
        if (time >= 1) return false;
        Course *faster = a, *slower = b;
        if (a->longest() < b->longest()) std::swap(faster, slower);
        return faster->holdAt(time) || slower->holdAt(time);
    }
};

/// The least margin of the fields in a world; infinite if there are none.
float leastMargin(const btCollisionObjectArray& objects) {
    float least = std::numeric_limits<float>::infinity();
    for (int i = 0; i < objects.size(); ++i)
        for (const Part& part : partsOf(*objects[i]))
            if (const Shape* field = part.field()) least = std::min(least, float(field->getMargin()));
    return least;
}

}  // namespace

NoPassing::NoPassing(btDynamicsWorld& world) : world_(world) {
    world_.addAction(this);
    if (auto* dispatcher = dynamic_cast<Dispatcher*>(world_.getDispatcher())) dispatcher->foresee(false);
}

NoPassing::~NoPassing() {
    world_.removeAction(this);
    if (auto* dispatcher = dynamic_cast<Dispatcher*>(world_.getDispatcher())) dispatcher->foresee(true);
}

namespace {

/// All that fast bodies may meet.
class Meetings {
  public:
    Meetings(btDynamicsWorld& world, float seconds) : world_(world), seconds_(seconds) {
        const btCollisionObjectArray& objects = world.getCollisionObjectArray();
        const float margin = leastMargin(objects);
        if (!std::isfinite(margin)) return;
        for (int i = 0; i < objects.size(); ++i) {
            Course course(*objects[i], seconds);
            if (course.moves() && course.longest() > margin)
                courses_.try_emplace(objects[i], course), fast_.push_back(objects[i]);
        }
        for (std::size_t i = 0; i < fast_.size(); ++i) meetOthers(i);
    }

    std::vector<Meeting>& all() { return meetings_; }
    /// In the world's order.
    int apply() {
        int held = 0;
        for (const btCollisionObject* object : fast_) held += courses_.at(object).apply();
        for (const btCollisionObject* object : slow_) held += courses_.at(object).apply();
        return held;
    }

  private:
    void meetOthers(std::size_t i) {
        struct Found : btBroadphaseAabbCallback {
            std::vector<btCollisionObject*> objects;
            bool process(const btBroadphaseProxy* proxy) override {
                objects.push_back(static_cast<btCollisionObject*>(proxy->m_clientObject));
                return true;
            }
        } found;
        btVector3 lower, upper;
        courses_.at(fast_[i]).box(lower, upper);
        world_.getBroadphase()->aabbTest(lower, upper, found);
        for (btCollisionObject* object : found.objects)
            if (!isFast(object)) meet(fast_[i], object);
        for (std::size_t j = 0; j < i; ++j) {
            btVector3 otherLower, otherUpper;
            courses_.at(fast_[j]).box(otherLower, otherUpper);
            if (TestAabbAgainstAabb2(lower, upper, otherLower, otherUpper)) meet(fast_[i], fast_[j]);
        }
    }

    bool isFast(const btCollisionObject* object) const {
        const auto it = courses_.find(object);
        return it != courses_.end() && std::find(slow_.begin(), slow_.end(), object) == slow_.end();
    }

    void meet(btCollisionObject* a, btCollisionObject* b) {
        if (a == b) return;
        auto *one = a->getBroadphaseHandle(), *two = b->getBroadphaseHandle();
        if (!one || !two || !world_.getPairCache()->needsBroadphaseCollision(one, two)) return;
        if (!world_.getDispatcher()->needsCollision(a, b) || !world_.getDispatcher()->needsResponse(a, b)) return;
        if (courses_.try_emplace(b, *b, seconds_).second) slow_.push_back(b);
        meetings_.push_back({&courses_.at(a), &courses_.at(b)});
    }

    btDynamicsWorld& world_;
    float seconds_;
    std::unordered_map<const btCollisionObject*, Course> courses_;
    std::vector<btCollisionObject*> fast_, slow_;
    std::vector<Meeting> meetings_;
};

}  // namespace

void NoPassing::updateAction(btCollisionWorld*, btScalar seconds) {
    Meetings meetings(world_, seconds);
    for (int round = 0; round < mostRounds; ++round) {
        tbb::parallel_for_each(meetings.all(), [](Meeting& meeting) {
            if (meeting.isOpen) meeting.look();
        });
        bool changed = false;
        for (Meeting& meeting : meetings.all()) changed = meeting.hold() || changed;
        if (!changed) break;
    }
    held_ = meetings.apply();
}

}  // namespace bilayer::bullet
