#include "integration/bullet/shape.h"

#include <BulletCollision/CollisionShapes/btBvhTriangleMeshShape.h>
#include <BulletCollision/CollisionShapes/btScaledBvhTriangleMeshShape.h>
#include <BulletCollision/CollisionShapes/btSphereShape.h>
#include <BulletCollision/CollisionShapes/btTriangleIndexVertexArray.h>
#include <BulletCollision/NarrowPhaseCollision/btRaycastCallback.h>
#include <LinearMath/btAabbUtil2.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <mutex>
#include <stdexcept>

#include "integration/bullet/convert.h"
#include "integration/bullet/sweep.h"

namespace bilayer::bullet {

namespace {

// Points of a manifold count as the same from step to step within this distance [voxels]: the spacing of surface
// points.
constexpr float breakingVoxels = 2;

btVector3 halfSize(const Bounds& bounds) {
    return toBullet(0.5f * bounds.size());
}

void castRay(const Placed& field, btTriangleRaycastCallback& callback) {
    const glm::vec3 from = field.pose.toBody(toGlm(callback.m_from)) / field.scale;
    const glm::vec3 to = field.pose.toBody(toGlm(callback.m_to)) / field.scale;
    const float length = glm::length(to - from);
    if (!(length > 0)) return;
    const auto hit = field.collider.field().raycast({from, (to - from) / length, length * callback.m_hitFraction});
    if (!hit) return;
    const float fraction = hit->distance / length;
    if (fraction < callback.m_hitFraction)
        callback.m_hitFraction = callback.reportHit(toBullet(field.pose.rotation * hit->normal), fraction, 0, -1);
}

void castSphere(const Placed& field, float radius, btTriangleConvexcastCallback& callback) {
    const glm::vec3 from = toGlm(callback.m_convexShapeFrom.getOrigin());
    const glm::vec3 to = toGlm(callback.m_convexShapeTo.getOrigin());
    const auto hit = sweepSphere(field, from, to, radius, callback.m_allowedPenetration);
    if (hit && hit->fraction < callback.m_hitFraction)
        callback.m_hitFraction =
            callback.reportHit(toBullet(hit->normal), toBullet(hit->position), hit->fraction, 0, -1);
}

}  // namespace

Pose centreOfMassFrame(const Collider& collider) {
    const MassProperties& mass = collider.mass();
    const glm::quat rotation = glm::conjugate(mass.principalAxes);
    return {-(rotation * mass.centre), rotation};
}

/// The mesh in body coordinates under Bullet's own bounding hierarchy. Built when first asked for: rays and contacts do
/// without, and it takes longer to build than the surface points.
class Shape::Triangles {
  public:
    const btScaledBvhTriangleMeshShape& of(const Shape& shape) {
        std::call_once(once_, [&] { build(shape); });
        return *scaled_;
    }
    void setScaling(const btVector3& scaling) {
        if (scaled_) scaled_->setLocalScaling(scaling);
    }

  private:
    void build(const Shape& shape) {
        const Mesh& mesh = shape.collider().mesh();
        points_.reserve(mesh.points.size());
        for (const glm::vec3& point : mesh.points) points_.push_back(shape.frame().toWorld(point));
        indices_.reserve(3 * mesh.triangles.size());
        for (const glm::uvec3& triangle : mesh.triangles)
            for (int corner = 0; corner < 3; ++corner) indices_.push_back(static_cast<int>(triangle[corner]));
        array_ = std::make_unique<btTriangleIndexVertexArray>(
            static_cast<int>(mesh.triangles.size()), indices_.data(), static_cast<int>(3 * sizeof(int)),
            static_cast<int>(points_.size()), &points_.front().x, static_cast<int>(sizeof(glm::vec3)));
        mesh_.reset(new btBvhTriangleMeshShape(array_.get(), true));
        scaled_.reset(new btScaledBvhTriangleMeshShape(mesh_.get(), shape.getLocalScaling()));
    }

    // Bullet's array keeps pointers to the points and indices only.
    std::vector<glm::vec3> points_;
    std::vector<int> indices_;
    std::unique_ptr<btTriangleIndexVertexArray> array_;
    std::unique_ptr<btBvhTriangleMeshShape> mesh_;
    std::unique_ptr<btScaledBvhTriangleMeshShape> scaled_;
    std::once_flag once_;
};

Shape::Shape(std::shared_ptr<const Collider> collider, const ShapeOptions& options)
    : collider_(std::move(collider)),
      frame_(options.frame),
      sweeps_(options.sweeps),
      triangles_(std::make_unique<Triangles>()) {
    if (!collider_) throw std::invalid_argument("Shape: no collider");
    if (!std::isfinite(options.margin)) throw std::invalid_argument("Shape: the margin is not finite");
    // Not the type for custom concave shapes: Bullet takes every shape of that type for its own btSdfCollisionShape.
    // This one is used by nothing else in Bullet.
    m_shapeType = FAST_CONCAVE_MESH_PROXYTYPE;
    m_collisionMargin = options.margin < 0 ? collider_->margin() : options.margin;
}

Shape::~Shape() = default;

Placed Shape::placed(const btTransform& bodyTransform) const {
    const Pose body = toPose(bodyTransform);
    return {*collider_, {body.toWorld(scale() * frame_.position), body.rotation * frame_.rotation}, scale()};
}

void Shape::setLocalScaling(const btVector3& scaling) {
    const float s = scaling.x();
    if (!(s > 0) || !std::isfinite(s) || scaling.y() != s || scaling.z() != s)
        throw std::invalid_argument("Shape: a field can only be scaled by one positive factor");
    m_collisionMargin *= s / scale();
    scaling_ = {s, s, s};
    triangles_->setScaling(scaling_);
}

void Shape::setMargin(btScalar margin) {
    if (!(margin >= 0) || !std::isfinite(margin)) throw std::invalid_argument("Shape: a margin is at least 0");
    m_collisionMargin = margin;
}

void Shape::getAabb(const btTransform& transform, btVector3& lower, btVector3& upper) const {
    const Placed here = placed(transform);
    const Bounds& bounds = collider_->bounds();
    const btTransform frame(toBullet(here.pose.rotation), toBullet(here.pose.toWorld(scale() * bounds.centre())));
    btTransformAabb(scale() * halfSize(bounds), m_collisionMargin, frame, lower, upper);
}

void Shape::calculateLocalInertia(btScalar mass, btVector3& inertia) const {
    const MassProperties& solid = collider_->mass();
    const glm::mat3 axes(frame_.rotation);
    const glm::mat3 turned = axes * solid.inertia * glm::transpose(axes);
    const glm::vec3 centre = frame_.toWorld(solid.centre);
    const float density = mass / static_cast<float>(solid.volume);
    // Steiner's theorem, then Bullet's simplification: the diagonal alone.
    for (int i = 0; i < 3; ++i)
        inertia[i] =
            scale() * scale() * (density * turned[i][i] + mass * (glm::dot(centre, centre) - centre[i] * centre[i]));
}

void Shape::processAllTriangles(btTriangleCallback* callback, const btVector3& lower, const btVector3& upper) const {
    if (auto* ray = dynamic_cast<btTriangleRaycastCallback*>(callback))
        return castRay(placed(btTransform::getIdentity()), *ray);

    if (auto* sweep = dynamic_cast<btTriangleConvexcastCallback*>(callback)) {
        // The margin makes contacts early; it is no part of the body.
        sweep->m_triangleCollisionMargin = 0;
        const auto* sphere = dynamic_cast<const btSphereShape*>(sweep->m_convexShape);
        const Placed here = placed(sweep->m_triangleToWorld);
        if (sphere && sweepable(here, sphere->getRadius())) return castSphere(here, sphere->getRadius(), *sweep);
    }

    // Debug drawing asks for a box of 1e18 m, for which the hierarchy's integers are too short.
    btVector3 ownLower, ownUpper;
    getAabb(btTransform::getIdentity(), ownLower, ownUpper);
    ownLower.setMax(lower);
    ownUpper.setMin(upper);
    if (ownLower.x() > ownUpper.x() || ownLower.y() > ownUpper.y() || ownLower.z() > ownUpper.z()) return;
    triangles_->of(*this).processAllTriangles(callback, ownLower, ownUpper);
}

btScalar Shape::getContactBreakingThreshold(btScalar) const {
    return breakingVoxels * voxelSize();
}

}  // namespace bilayer::bullet
