// SPDX-License-Identifier: Apache-2.0
#include <bilayer/collider/contact.h>
#include <bilayer/integration/bullet/shape.h>

#include <BulletCollision/CollisionShapes/btBvhTriangleMeshShape.h>
#include <BulletCollision/CollisionShapes/btScaledBvhTriangleMeshShape.h>
#include <BulletCollision/CollisionShapes/btSphereShape.h>
#include <BulletCollision/CollisionShapes/btTriangleIndexVertexArray.h>
#include <BulletCollision/CollisionShapes/btUniformScalingShape.h>
#include <BulletCollision/NarrowPhaseCollision/btRaycastCallback.h>
#include <LinearMath/btAabbUtil2.h>
#include <fmt/format.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <mutex>
#include <stdexcept>
#include <string>

#include "collider/contact/body/collider_data.h"
#include "collider/field/samples/field_data.h"
#include "collider/field/triangles/mesh_rays.h"
#include "collider/field/triangles/triangle_tests.h"
#include "integration/bullet/detail/casts.h"
#include "integration/bullet/detail/convert.h"
#include "integration/bullet/detail/missing_dispatcher.h"
#include "sdf/base/access.h"

namespace bilayer::bullet {

using namespace detail;
using namespace bilayer::detail;

namespace {

// Points of a manifold count as the same from step to step within this distance [voxels]: the spacing of surface
// points.
constexpr float breakingVoxels = 2;
// The voxel size used to sweep other shapes [m]: Bullet then ends its search a fiftieth of it before they touch.
constexpr float castVoxel = 0.05f;
// Offset at which a ray continues behind a back-facing triangle [voxels].
constexpr double skippedVoxels = 1e-4;
// Maximum index of a triangle: Bullet's quantized hierarchy stores the number of a part in the upper bits.
constexpr std::size_t maxQuantized = std::size_t(1) << (31 - MAX_NUM_PARTS_IN_BITS);
// Upper bound of the distance between the triangles of a field's zero set and the zeros of its interpolant [voxels].
constexpr float zeroSetVoxels = 0.1f;

btVector3 halfSize(const Bounds& bounds) {
    return toBullet(0.5f * bounds.size());
}

/// Casts a ray by the field of a body without a mesh. Returns the fraction of the ray behind which the triangles must
/// be tested. This is where the callback continues behind the hit, or the start of a ray inside the body, which leaves
/// it through a back face.
std::optional<float> castRay(const Placed& body, btTriangleRaycastCallback& callback) {
    const Field& field = body.collider.field();
    const glm::vec3 from = body.pose.toBody(toGlm(callback.m_from)) / body.scale;
    if (field.inside(from)) return 0;
    const glm::vec3 displacement = body.pose.toBody(toGlm(callback.m_to)) / body.scale - from;
    const float length = glm::length(displacement);
    if (!(length > 0)) return std::nullopt;
    const auto hit = field.raycast({from, displacement / length, length * callback.m_hitFraction});
    if (!hit) return std::nullopt;
    const float fraction = hit->distance / length;
    if (!(fraction < callback.m_hitFraction)) return std::nullopt;
    callback.m_hitFraction = callback.reportHit(toBullet(body.pose.rotation * hit->normal), fraction, 0, -1);
    if (!(callback.m_hitFraction > fraction)) return std::nullopt;
    return fraction + zeroSetVoxels * field.voxelSize() / length;
}

/// The part of a ray behind some fraction of it.
class Behind : public btTriangleRaycastCallback {
  public:
    Behind(btTriangleRaycastCallback& ray, float fraction)
        : btTriangleRaycastCallback(ray.m_from, ray.m_to, ray.m_flags), ray_(ray), fraction_(fraction) {
        m_hitFraction = ray.m_hitFraction;
    }
    btScalar reportHit(const btVector3& normal, btScalar fraction, int part, int index) override {
        if (fraction > fraction_) ray_.m_hitFraction = ray_.reportHit(normal, fraction, part, index);
        return ray_.m_hitFraction;
    }

  private:
    btTriangleRaycastCallback& ray_;
    float fraction_;
};

/// Casts a ray by the triangles, with Bullet's own flags. Tests those behind a hit too, if the callback continues.
void castRay(const Placed& body, const MeshTree& mesh, btTriangleRaycastCallback& callback) {
    const glm::dvec3 from(body.pose.toBody(toGlm(callback.m_from)) / body.scale);
    const glm::dvec3 displacement = glm::dvec3(body.pose.toBody(toGlm(callback.m_to)) / body.scale) - from;
    const double length = glm::length(displacement);
    if (!(length > 0)) return;
    const bool oneSided = callback.m_flags & btTriangleRaycastCallback::kF_FilterBackfaces;
    const bool keepsNormal = callback.m_flags & btTriangleRaycastCallback::kF_KeepUnflippedNormal;
    for (double start = 0; start <= length * callback.m_hitFraction; start += skippedVoxels * mesh.voxelSize()) {
        const auto hit = firstHit(mesh, {from + start * (displacement / length), displacement / length,
                                         length * callback.m_hitFraction - start});
        if (!hit) return;
        const TriangleCorners corners = cornersOf(mesh.mesh(), hit->triangle);
        const glm::dvec3 normal = glm::normalize(glm::cross(corners[1] - corners[0], corners[2] - corners[0]));
        const bool isBack = glm::dot(normal, displacement) > 0;
        start += hit->along;
        if (isBack && oneSided) continue;
        const float fraction = static_cast<float>(start / length);
        if (!(fraction < callback.m_hitFraction)) return;
        const glm::vec3 reported(isBack && !keepsNormal ? -normal : normal);
        callback.m_hitFraction =
            callback.reportHit(toBullet(body.pose.rotation * reported), fraction, 0, static_cast<int>(hit->triangle));
        if (!(callback.m_hitFraction > fraction)) return;
    }
}

/// Returns false if the callback also wants what lies behind the hit.
bool report(const std::optional<CastHit>& hit, btTriangleConvexcastCallback& callback) {
    if (!hit || !(hit->fraction < callback.m_hitFraction)) return true;
    callback.m_hitFraction =
        callback.reportHit(toBullet(hit->normal), toBullet(hit->position), hit->fraction, 0, hit->triangle);
    return callback.m_hitFraction <= hit->fraction;
}

/// Casts a sphere by the mesh, or without one by the field. Returns false if neither gives the complete answer.
bool castSphere(const Placed& body, const MeshTree* mesh, float radius, btTriangleConvexcastCallback& callback) {
    const glm::vec3 from = toGlm(callback.m_convexShapeFrom.getOrigin());
    const glm::vec3 to = toGlm(callback.m_convexShapeTo.getOrigin());
    if (!mesh) {
        if (!bandFitsSphere(body, radius)) return false;
        return report(castSphereOn(body, from, to, radius, callback.m_allowedPenetration), callback);
    }
    const float reach = (radius - callback.m_allowedPenetration) / body.scale;
    const glm::vec3 start = body.pose.toBody(from) / body.scale;
    // A sphere that touches at the start may separate, or hit other triangles: Bullet tests them one by one.
    if (!(reach > 0) || touches(*mesh, start, reach)) return false;
    auto hit = castSphereOn(*mesh, start, body.pose.toBody(to) / body.scale, reach);
    if (hit) {
        hit->position = body.pose.toWorld(body.scale * hit->position);
        hit->normal = body.pose.rotation * hit->normal;
    }
    return report(hit, callback);
}

/// A sweep scaled to bodies of about one metre, since Bullet's search ends a millimetre before shapes touch.
class Enlarged : public btTriangleConvexcastCallback {
  public:
    /// @param factor   of the world
    /// @param scaling  of the incoming triangles, before
    Enlarged(btTriangleConvexcastCallback& sweep, btUniformScalingShape& shape, float factor, float scaling)
        : btTriangleConvexcastCallback(&shape, enlarged(sweep.m_convexShapeFrom, factor),
                                       enlarged(sweep.m_convexShapeTo, factor),
                                       enlarged(sweep.m_triangleToWorld, factor), 0),
          sweep_(sweep),
          factor_(factor),
          scaling_(scaling) {
        m_hitFraction = sweep.m_hitFraction;
        m_allowedPenetration = factor * sweep.m_allowedPenetration;
    }

    void processTriangle(btVector3* triangle, int part, int index) override {
        btVector3 corners[3];
        for (int i = 0; i < 3; ++i) corners[i] = factor_ * scaling_ * triangle[i];
        btTriangleConvexcastCallback::processTriangle(corners, part, index);
    }

    btScalar reportHit(const btVector3& normal, const btVector3& point, btScalar fraction, int part,
                       int index) override {
        return sweep_.reportHit(normal, point / factor_, fraction, part, index);
    }

  private:
    static btTransform enlarged(const btTransform& transform, float factor) {
        return btTransform(transform.getBasis(), factor * transform.getOrigin());
    }

    btTriangleConvexcastCallback& sweep_;
    float factor_, scaling_;
};

}  // namespace

Pose centreOfMassFrame(const Collider& collider) {
    const MassProperties& mass = collider.mass();
    const glm::quat rotation = glm::conjugate(mass.principalAxes);
    return {-(rotation * mass.centre), rotation};
}

/// The mesh in body coordinates in Bullet's own bounding volume hierarchy. It is built on first use: contacts, rays and
/// spheres do not need it, and it takes longer to build than the surface points.
class Shape::Triangles {
  public:
    const btScaledBvhTriangleMeshShape& of(const Shape& shape) {
        std::call_once(once_, [&] { build(shape); });
        return *scaled_;
    }
    /// Passes on the triangles that a shape may meet on its path.
    void cast(const Shape& shape, btTriangleConvexcastCallback& sweep) {
        of(shape);
        const btVector3 scaling = shape.getLocalScaling();
        const btTransform intoBody = sweep.m_triangleToWorld.inverse();
        const btTransform from = intoBody * sweep.m_convexShapeFrom, to = intoBody * sweep.m_convexShapeTo;
        btVector3 lower, upper;
        sweep.m_convexShape->getAabb(btTransform(to.getBasis()), lower, upper);
        if (!(from.getBasis() == to.getBasis())) {
            // Bullet considers the last rotation only; a rotating shape may need more room on its path.
            const btScalar around = sweep.m_convexShape->getAngularMotionDisc();
            lower = btVector3(-around, -around, -around);
            upper = -lower;
        }
        const float factor = castVoxel / shape.voxelSize();
        btUniformScalingShape caster(const_cast<btConvexShape*>(sweep.m_convexShape), factor);
        Enlarged enlarged(sweep, caster, factor, shape.scale());
        mesh_->performConvexcast(&enlarged, from.getOrigin() / scaling, to.getOrigin() / scaling, lower / scaling,
                                 upper / scaling);
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
        mesh_.reset(new btBvhTriangleMeshShape(array_.get(), mesh.triangles.size() <= maxQuantized));
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
      speculative_(options.speculative),
      restingFriction_(options.restingFriction),
      triangles_(std::make_unique<Triangles>()) {
    if (!collider_) throw std::invalid_argument("Shape: no collider");
    if (!std::isfinite(options.margin))
        throw std::invalid_argument("Shape: the margin is " + std::to_string(options.margin) + ", and must be finite");
    if (!(restingFriction_ >= 1) || !std::isfinite(restingFriction_))
        throw std::invalid_argument("Shape: the friction at rest is " + std::to_string(restingFriction_) +
                                    ", and must be finite and at least 1");
    // Not the type for custom concave shapes, which Bullet always takes for its own btSdfCollisionShape. Nothing else
    // in Bullet uses this type.
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
    if (!(margin >= 0) || !std::isfinite(margin))
        throw std::invalid_argument(fmt::format("Shape: the margin is {}; it must be finite and at least 0", margin));
    m_collisionMargin = margin;
}

void Shape::getAabb(const btTransform& transform, btVector3& lower, btVector3& upper) const {
    boxOf(transform, lower, upper);
    noteBox(this, transform);
}

void Shape::boxOf(const btTransform& transform, btVector3& lower, btVector3& upper) const {
    const Placed here = placed(transform);
    const Bounds& bounds = collider_->bounds();
    const btTransform frame(toBullet(here.pose.rotation), toBullet(here.pose.toWorld(scale() * bounds.centre())));
    btTransformAabb(scale() * halfSize(bounds), m_collisionMargin, frame, lower, upper);
}

void Shape::calculateLocalInertia(btScalar mass, btVector3& inertia) const {
    const MassProperties& solid = collider_->mass();
    const glm::mat3 axes(frame_.rotation);
    const glm::mat3 rotated = axes * solid.inertia * glm::transpose(axes);
    const glm::vec3 centre = frame_.toWorld(solid.centre);
    const float density = mass / static_cast<float>(solid.volume);
    // Steiner's theorem, then Bullet's simplification: the diagonal alone.
    for (int i = 0; i < 3; ++i)
        inertia[i] =
            scale() * scale() * (density * rotated[i][i] + mass * (glm::dot(centre, centre) - centre[i] * centre[i]));
}

void Shape::processAllTriangles(btTriangleCallback* callback, const btVector3& lower, const btVector3& upper) const {
    noteTriangles(*callback);
    if (auto* ray = dynamic_cast<btTriangleRaycastCallback*>(callback)) {
        const Placed here = placed(btTransform::getIdentity());
        if (const MeshTree* mesh = dataOf(collider_->exactField()).mesh.get()) return castRay(here, *mesh, *ray);
        if (const auto fraction = castRay(here, *ray)) {
            Behind behind(*ray, *fraction);
            triangles_->of(*this).processAllTriangles(&behind, lower, upper);
        }
        return;
    }
    if (auto* sweep = dynamic_cast<btTriangleConvexcastCallback*>(callback)) {
        // The margin makes contacts early; it is not part of the body.
        sweep->m_triangleCollisionMargin = 0;
        const auto* sphere = dynamic_cast<const btSphereShape*>(sweep->m_convexShape);
        const Placed here = placed(sweep->m_triangleToWorld);
        if (sphere && castSphere(here, dataOf(collider_->exactField()).mesh.get(), sphere->getRadius(), *sweep)) return;
        return triangles_->cast(*this, *sweep);
    }

    // Debug drawing asks for a box of 1e18 m, for which the hierarchy's integers are too short.
    btVector3 ownLower, ownUpper;
    boxOf(btTransform::getIdentity(), ownLower, ownUpper);
    ownLower.setMax(lower);
    ownUpper.setMin(upper);
    if (ownLower.x() > ownUpper.x() || ownLower.y() > ownUpper.y() || ownLower.z() > ownUpper.z()) return;
    triangles_->of(*this).processAllTriangles(callback, ownLower, ownUpper);
}

btScalar Shape::getContactBreakingThreshold(btScalar) const {
    return breakingVoxels * voxelSize();
}

}  // namespace bilayer::bullet
