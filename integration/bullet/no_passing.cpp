#include "integration/bullet/no_passing.h"

#include <BulletCollision/BroadphaseCollision/btBroadphaseInterface.h>
#include <BulletCollision/BroadphaseCollision/btOverlappingPairCache.h>
#include <BulletCollision/CollisionShapes/btCompoundShape.h>
#include <BulletCollision/CollisionShapes/btStaticPlaneShape.h>
#include <BulletCollision/CollisionShapes/btTriangleCallback.h>
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
#include <type_traits>
#include <unordered_map>
#include <utility>
#include <vector>

#include "collider/interpolant.h"
#include "collider/touch.h"
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
constexpr int mostProbes = 64;        // along an edge of a convex body
constexpr float leastStride = 0.05f;  // through samples [voxels]
// Of a way along which something is nearby; what takes longer is looked at point by point, or taken as met.
constexpr int mostSteps = 64;
// A body that is held back may be met by another one: pairs are looked at again up to so many times, about once for
// each body of a column that falls. In longer ones the last overlap for a step.
constexpr int mostRounds = 256;

// Who is held so early in a step has not moved.
constexpr float atStart = 1e-3f;

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
        return field_.distance(point) - mostInterpolationError * field_.voxelSize();
    }
    std::optional<Entry> entry(const glm::vec3& from, const glm::vec3& to, float radius) const {
        if (from == to) return overlaps(from, radius) ? std::optional(Entry{from, glm::vec3(0)}) : std::nullopt;
        if (staysOut(from, to, radius)) return std::nullopt;
        const glm::vec3 way = to - from;
        const auto hit =
            radius > 0 ? field_.sphereCast({from, way, glm::length(way)}, radius) : field_.segment(from, to);
        if (!hit) return std::nullopt;
        return Entry{hit->position, hit->normal};
    }
    /// The way out of it for a ball that is in it; none where that is not known.
    std::optional<glm::vec3> wayOut(const glm::vec3& point, float radius) const {
        if (radius > 0) {
            const ClosestPoint closest = field_.closest(point, radius);
            const glm::vec3 way = closest.distance < 0 ? closest.position - point : point - closest.position;
            const float length = glm::length(way);
            if (!closest.found || !(length > 0)) return std::nullopt;
            return (radius - closest.distance) / length * way;
        }
        const Sample sample = field_.sample(point);
        const glm::vec3 normal = directionOf(sample, field_.voxelSize());
        if (!sample.inBand || normal == glm::vec3(0)) return std::nullopt;
        return -sample.distance * normal;
    }

  private:
    /// By strides through the samples; many times as quick as the search for the place of an entry.
    bool staysOut(const glm::vec3& from, const glm::vec3& to, float radius) const {
        const float length = glm::distance(from, to), voxel = field_.voxelSize();
        const float error = field_.mesh() ? mostInterpolationError * voxel : 0;
        float gone = 0;
        for (int i = 0; i < mostSteps && gone <= length; ++i) {
            const Sample sample = field_.sampleWithin(length > 0 ? from + gone / length * (to - from) : from, 0);
            const float left = sample.inBand && radius == 0 ? (sample.distance - error) / steepestInterpolant
                                                            : sample.distance - radius - mostInterpolationError * voxel;
            if (left < leastStride * voxel) return false;
            gone += left;
        }
        return gone > length;
    }

    bool overlaps(const glm::vec3& point, float radius) const {
        return radius > 0 ? field_.overlapsSphere(point, radius) : field_.distance(point) <= 0;
    }

    const Field& field_;
};

class ConvexObstacle {
  public:
    ConvexObstacle(const Convex& convex, float tolerance) : convex_(convex), tolerance_(tolerance) {}

    float bound(const glm::vec3& point) const { return nearest(point).distance; }
    std::optional<Entry> entry(const glm::vec3& from, const glm::vec3& to, float) const {
        const auto entry = convex_.enter(from, to - from, tolerance_);
        if (!entry) return std::nullopt;
        const glm::vec3 at = from + entry->part * (to - from);
        return Entry{at - entry->near.distance * entry->near.normal, entry->near.normal};
    }
    std::optional<glm::vec3> wayOut(const glm::vec3& point, float) const {
        const Convex::Near near = nearest(point);
        return -near.distance * near.normal;
    }

  private:
    Convex::Near nearest(const glm::vec3& point) const {
        return convex_.nearest(point, std::numeric_limits<float>::max());
    }

    const Convex& convex_;
    float tolerance_;
};

class PlaneObstacle {
  public:
    explicit PlaneObstacle(const btStaticPlaneShape& shape)
        : normal_(toGlm(shape.getPlaneNormal())), offset_(shape.getPlaneConstant()) {}

    float bound(const glm::vec3& point) const { return glm::dot(normal_, point) - offset_; }
    std::optional<Entry> entry(const glm::vec3& from, const glm::vec3& to, float) const {
        const float before = bound(from), after = bound(to);
        if (before > 0 && after > 0) return std::nullopt;
        const float part = before > 0 ? before / (before - after) : 0;
        return Entry{from + part * (to - from), normal_};
    }
    std::optional<glm::vec3> wayOut(const glm::vec3& point, float) const { return -bound(point) * normal_; }

  private:
    glm::vec3 normal_;
    float offset_;
};

/// The triangles of a mesh or a height field: sheets, which nothing is inside of.
class TriangleObstacle {
  public:
    explicit TriangleObstacle(const btConcaveShape& mesh) : mesh_(mesh) {}

    std::optional<Entry> entry(const glm::vec3& from, const glm::vec3& to, float) const {
        struct First : btTriangleCallback {
            glm::vec3 from, way;
            float part = 1;
            std::optional<Entry> entry;

            void processTriangle(btVector3* corners, int, int) override {
                const glm::vec3 a = toGlm(corners[0]), one = toGlm(corners[1]) - a, two = toGlm(corners[2]) - a;
                const glm::vec3 normal = glm::cross(one, two), start = from - a, turned = glm::cross(start, way);
                const float along = -glm::dot(way, normal);
                if (along == 0) return;
                const float s = glm::dot(start, normal) / along, u = glm::dot(two, turned) / along,
                            v = -glm::dot(one, turned) / along;
                if (!(s >= 0 && s < part && u >= 0 && v >= 0 && u + v <= 1)) return;
                part = s;
                entry = Entry{from + s * way, (along > 0 ? 1.f : -1.f) * glm::normalize(normal)};
            }
        } first;
        first.from = from, first.way = to - from;
        visit(glm::min(from, to), glm::max(from, to), first);
        return first.entry;
    }
    std::optional<glm::vec3> wayOut(const glm::vec3&, float) const { return std::nullopt; }
    bool isNear(const glm::vec3& from, const glm::vec3& to, float radius) const {
        struct Any : btTriangleCallback {
            bool found = false;
            void processTriangle(btVector3*, int, int) override { found = true; }
        } any;
        visit(glm::min(from, to) - radius, glm::max(from, to) + radius, any);
        return any.found;
    }

  private:
    void visit(const glm::vec3& lower, const glm::vec3& upper, btTriangleCallback& callback) const {
        mesh_.processAllTriangles(&callback, toBullet(lower), toBullet(upper));
    }

    const btConcaveShape& mesh_;
};

/// An object as a body that the world moves and that is awake; null for others.
btRigidBody* goingBody(btCollisionObject& object) {
    auto* body = btRigidBody::upcast(&object);
    return body && !body->isStaticOrKinematicObject() && body->isActive() ? body : nullptr;
}

/// The way of an object through a step that has come to its end.
class Course {
  public:
    Course(btCollisionObject& object, float seconds)
        : object_(object),
          end_(object.getWorldTransform()),
          start_(end_.getOrigin()),
          orientation_(end_.getRotation()) {
        body_ = goingBody(object);
        // Bullet's own CCD leaves a body that it has stopped its velocity, but not the way that it has gone
        if (!body_ || body_->getHitFraction() < 1) return;
        way_ = seconds * body_->getLinearVelocity();
        start_ -= way_;
        const btVector3& spin = body_->getAngularVelocity();
        const float angle = seconds * spin.length();
        if (!(angle > 0)) return;
        axis_ = spin.normalized();
        // beyond its limit, Bullet turns by another angle than the spin's, but about the same axis
        const float most = ANGULAR_MOTION_THRESHOLD;
        turn_ = angle > most ? 2 * std::atan(angle / most * std::tan(most / 2)) : angle;
    }

    const btCollisionObject& object() const { return object_; }
    float turn() const { return turn_; }

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
    /// How far any of its points goes as another object sees it, at most.
    float longest(const Course& other) const {
        return (way_ - other.way_).length() + radius() * turn_ + other.radius() * other.turn_;
    }
    void box(btVector3& lower, btVector3& upper) const {
        const float r = radius();
        lower = upper = start_;
        lower.setMin(start_ + way_);
        upper.setMax(start_ + way_);
        lower -= btVector3(r, r, r);
        upper += btVector3(r, r, r);
    }

    btRigidBody* body() const { return body_; }
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

/// @param found  (const Part&)
template <class Found>
void visitParts(const btCollisionShape* shape, const btTransform& local, Found&& found) {
    if (!shape->isCompound()) return found(Part{shape, local});
    const auto* compound = static_cast<const btCompoundShape*>(shape);
    for (int i = 0; i < compound->getNumChildShapes(); ++i)
        visitParts(compound->getChildShape(i), local * compound->getChildTransform(i), found);
}

template <class Found>
void visitParts(const btCollisionObject& object, Found&& found) {
    visitParts(object.getCollisionShape(), btTransform::getIdentity(), found);
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

/// Where something first goes too deep into an obstacle: when, there, and the normal outward from it.
struct Touch {
    float time = 1;  ///< 1: nothing does in this step
    glm::vec3 place{0}, normal{0};

    Touch turned() const { return {time, place, -normal}; }
};

Touch earlier(const Touch& one, const Touch& other) {
    return other.time < one.time ? other : one;
}

/// @param touch  in the coordinates of the obstacle
Touch inWorld(const Touch& touch, const Part& obstacle, const Course& its) {
    const Frame frame = frameOf(obstacle, its.at(touch.time));
    return {touch.time, frame.pose.toWorld(frame.scale * touch.place), frame.pose.rotation * touch.normal};
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

/// Points on their ways through an obstacle.
template <class Obstacle>
class Passage {
  public:
    /// @param voxel  in the obstacle's units
    Passage(const Obstacle& obstacle, const std::vector<Moment>& moments, float voxel)
        : obstacle_(obstacle), moments_(moments), voxel_(voxel), scale_(glm::length(moments.front().linear[0])) {}

    /// The surface points of a field.
    void follow(const SurfacePoints& points) {
        const auto reject = [&](const glm::vec3& centre, float radius) { return !comesNear(centre, scale_ * radius); };
        points.visit(reject,
                     [&](std::uint32_t, const SurfacePoint& point) { follow(point.position, point.normal, 0); });
    }

    /// A ball.
    /// @param outward  of its body, to which the ball belongs
    void follow(const glm::vec3& point, const glm::vec3& outward, float radius) {
        const float inward = sunk * voxel_, smaller = std::max(scale_ * radius - inward, 0.f);
        const glm::vec3 inner = point - (inward - scale_ * radius + smaller) / scale_ * outward;
        glm::vec3 from = moments_.front()(inner), aside(0);
        // what is in there already may go on at its depth
        if (obstacle_.entry(from, from, smaller)) {
            const auto out = obstacle_.wayOut(from, smaller);
            if (!out) return;
            aside = *out;
        }
        from += aside;
        std::optional<Entry> entered;
        for (std::size_t i = 0; i + 1 < moments_.size() && moments_[i].time < first_.time; ++i) {
            const glm::vec3 to = moments_[i + 1](inner) + aside;
            if (!entered) entered = obstacle_.entry(from, to, smaller);
            if (entered) {
                const auto depth = [&](const glm::vec3& at) {
                    return glm::dot(entered->position - at, entered->normal) + smaller;
                };
                const float before = depth(from), after = depth(to), deepest = allowed * voxel_;
                if (after > deepest) {
                    // back to where its own surface touched
                    const glm::vec3 out = moments_[i].linear * outward / scale_;
                    const float touching = std::min(inward * glm::dot(out, entered->normal), 0.f);
                    const float part = (touching - before) / (after - before);
                    const float time = moments_[i].time + part * (moments_[i + 1].time - moments_[i].time);
                    first_ = {std::clamp(time, 0.f, first_.time), entered->position - aside, entered->normal};
                    return;
                }
                if (after < 0) entered.reset();
            }
            from = to;
        }
    }

    /// The first of them that goes too deep, in the obstacle's coordinates.
    const Touch& first() const { return first_; }

  private:
    bool comesNear(const glm::vec3& centre, float radius) const {
        for (std::size_t i = 0; i + 1 < moments_.size() && moments_[i].time < first_.time; ++i)
            if (isNear(moments_[i](centre), moments_[i + 1](centre), radius)) return true;
        return false;
    }

    bool isNear(const glm::vec3& from, const glm::vec3& to, float radius) const {
        if constexpr (std::is_same_v<Obstacle, TriangleObstacle>) {
            return obstacle_.isNear(from, to, radius);
        } else {
            const float length = glm::distance(from, to), near = nearby * voxel_;
            float gone = 0;
            for (int i = 0; i < mostSteps && gone <= length; ++i) {
                const glm::vec3 at = length > 0 ? from + gone / length * (to - from) : from;
                const float left = obstacle_.bound(at) - radius;
                if (left < near) return true;
                gone += left;
            }
            return gone <= length;
        }
    }

    const Obstacle& obstacle_;
    const std::vector<Moment>& moments_;
    float voxel_, scale_;
    Touch first_;
};

template <class Obstacle>
Touch passageOf(const Shape& field, const Obstacle& obstacle, const std::vector<Moment>& moments, float voxel) {
    Passage passage(obstacle, moments, voxel);
    passage.follow(field.collider().points());
    return passage.first();
}

/// The corners and edges of a convex body, and what it is grown by.
Touch passageOf(const Convex& convex, const Shape& field, const std::vector<Moment>& moments) {
    const FieldObstacle obstacle(field.collider().field());
    Passage passage(obstacle, moments, field.voxelSize() / field.scale());
    const auto follow = [&](const glm::vec3& point, float radius) {
        const float length = glm::length(point);
        passage.follow(point, length > 0 ? point / length : glm::vec3(0), radius);
    };
    const auto corners = convex.corners();
    for (std::uint32_t i = 0; i < corners.size(); ++i) follow(corners[i], convex.radius(i));
    for (const Convex::Edge& edge : convex.edges()) {
        const float length = glm::distance(corners[edge.from], corners[edge.to]);
        const int parts = probeParts(length, field.voxelSize(), mostProbes);
        for (int i = 1; i < parts; ++i) {
            const float part = float(i) / float(parts);
            follow(convex.place(edge, part), convex.radius(edge, part));
        }
    }
    return passage.first();
}

/// Where a field and another shape first get through each other; the normal is that of the other one.
Touch passage(const Part& part, const Course& its, const Part& other, const Course& others) {
    const Shape& field = *part.field();
    const std::vector<Moment> moments = momentsOf(part, its, other, others);
    const float voxel = field.voxelSize();
    const int type = other.shape->getShapeType();
    const auto into = [&](const auto& obstacle, float its) {
        return inWorld(passageOf(field, obstacle, moments, its), other, others);
    };
    if (const Shape* second = other.field())
        return into(FieldObstacle(second->collider().field()), std::min(voxel, second->voxelSize()) / second->scale());
    if (type == STATIC_PLANE_PROXYTYPE)
        return into(PlaneObstacle(static_cast<const btStaticPlaneShape&>(*other.shape)), voxel);
    if (other.shape->isConvex()) {
        const Convex convex(static_cast<const btConvexShape&>(*other.shape));
        const Touch touch = passageOf(convex, field, momentsOf(other, others, part, its));
        return earlier(into(ConvexObstacle(convex, 0.1f * allowed * voxel), voxel), inWorld(touch, part, its).turned());
    }
    if (!other.shape->isConcave() || type == GIMPACT_SHAPE_PROXYTYPE || type == FAST_CONCAVE_MESH_PROXYTYPE) return {};
    return into(TriangleObstacle(static_cast<const btConcaveShape&>(*other.shape)), voxel);
}

/// Two objects of which one was held where it met the other one.
using HeldPair = std::pair<const btCollisionObject*, const btCollisionObject*>;

struct Meeting {
    Course *a, *b;
    float margin;                  ///< what two that are not held come closer by than this is left to contacts [m]
    Touch touch{};                 ///< the first; from b to a
    float heldA = -1, heldB = -1;  ///< their courses' parts when they were looked at
    Touch stops{};                 ///< where one of them was held

    /// Whether it has not been looked at since one of the two was held.
    bool isOpen() const { return a->part() != heldA || b->part() != heldB; }

    void look() {
        touch = {};
        heldA = a->part(), heldB = b->part();
        if (std::min(heldA, heldB) >= 1 && a->longest(*b) <= margin) return;
        visitParts(a->object(), [&](const Part& one) {
            visitParts(b->object(), [&](const Part& two) {
                if (one.field()) touch = earlier(touch, passage(one, *a, two, *b));
                if (two.field()) touch = earlier(touch, passage(two, *b, one, *a).turned());
            });
        });
    }

    /// Holds what goes farther, and where that is held already, both: the other one goes on into it.
    bool hold() {
        if (touch.time >= 1 || isOpen()) return false;
        Course *faster = a, *slower = b;
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

    /// Leaves no speed to what does not move.
    void rest() const {
        for (const Course* course : {a, b})
            if (btRigidBody* body = course->body(); body && course->part() <= atStart) {
                body->setLinearVelocity({0, 0, 0});
                body->setAngularVelocity({0, 0, 0});
            }
    }

    /// Takes away the speed at which the two go for each other, as an impact without restitution and friction does.
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

/// Up to which contacts are made with an object; nothing without a field.
std::optional<float> marginOf(const btCollisionObject& object) {
    std::optional<float> most;
    visitParts(object, [&](const Part& part) {
        if (const Shape* field = part.field()) most = std::max(most.value_or(0), float(field->getMargin()));
    });
    return most;
}

/// What fast bodies may have passed through in a step.
class Meetings {
  public:
    Meetings(btDynamicsWorld& world, float seconds) : world_(world), seconds_(seconds) {
        const btCollisionObjectArray& objects = world.getCollisionObjectArray();
        float least = std::numeric_limits<float>::infinity();
        for (int i = 0; i < objects.size(); ++i)
            if (const auto margin = marginOf(*objects[i])) least = std::min(least, *margin);
        for (int i = 0; i < objects.size(); ++i) {
            if (!goingBody(*objects[i])) continue;
            const Course course(*objects[i], seconds);
            if (course.longest() > least) fast_.push_back(course);
        }
        for (std::size_t i = 0; i < fast_.size(); ++i) find(i);
    }

    /// Holds bodies until none passes.
    void settle() {
        for (int round = 0; round < mostRounds; ++round) {
            tbb::parallel_for_each(meetings_, [](Meeting& meeting) {
                if (meeting.isOpen()) meeting.look();
            });
            // the first ones first: what is held may come no farther
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

    /// Puts them where they are held. Two that hold each other in a second step in a row, or that have not moved, lose
    /// the speed that this step's contacts have left them; where both is true, all of it: it would grow with each step.
    /// @param before  the pairs of the last step; becomes those of this one
    int apply(std::vector<HeldPair>& before) const {
        int held = 0;
        for (const Course& course : fast_) held += course.apply();
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
        // those are no longer where the broad phase has them
        for (std::size_t j = 0; j < i; ++j) {
            btVector3 lowerOther, upperOther;
            fast_[j].box(lowerOther, upperOther);
            if (TestAabbAgainstAabb2(lower, upper, lowerOther, upperOther) &&
                meets(fast_[i].object(), fast_[j].object()))
                add(fast_[i], fast_[j]);
        }
    }

    bool isFast(const btCollisionObject& object) const {
        const auto index = [](const Course& course) { return course.object().getWorldArrayIndex(); };
        const auto at = std::lower_bound(fast_.begin(), fast_.end(), object.getWorldArrayIndex(),
                                         [&](const Course& course, int other) { return index(course) < other; });
        return at != fast_.end() && &at->object() == &object;
    }

    bool meets(const btCollisionObject& a, const btCollisionObject& b) const {
        const auto *one = a.getBroadphaseHandle(), *two = b.getBroadphaseHandle();
        return &a != &b && one && two &&
               world_.getPairCache()->needsBroadphaseCollision(const_cast<btBroadphaseProxy*>(one),
                                                               const_cast<btBroadphaseProxy*>(two)) &&
               world_.getDispatcher()->needsCollision(&a, &b) && world_.getDispatcher()->needsResponse(&a, &b);
    }

    void add(Course& a, Course& b) {
        const auto margin = std::max(marginOf(a.object()), marginOf(b.object()));  // no field is less than any margin
        if (margin) meetings_.push_back({&a, &b, *margin});
    }

    btDynamicsWorld& world_;
    float seconds_;
    std::vector<Course> fast_;                                   ///< in the world's order
    std::unordered_map<const btCollisionObject*, Course> slow_;  ///< that these may meet, and what does not move
    std::vector<Meeting> meetings_;
};

Dispatcher* fieldsOf(btDynamicsWorld& world) {
    return dynamic_cast<Dispatcher*>(world.getDispatcher());
}

}  // namespace

NoPassing::NoPassing(btDynamicsWorld& world) : world_(world) {
    world_.addAction(this);
    if (Dispatcher* dispatcher = fieldsOf(world_)) dispatcher->foreseeAll(false);
}

NoPassing::~NoPassing() {
    world_.removeAction(this);
    if (Dispatcher* dispatcher = fieldsOf(world_)) dispatcher->foreseeAll(true);
}

void NoPassing::updateAction(btCollisionWorld*, btScalar seconds) {
    Meetings meetings(world_, seconds);
    meetings.settle();
    held_ = meetings.apply(heldPairs_);
}

}  // namespace bilayer::bullet
