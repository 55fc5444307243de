// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/smooth_ground.h"

#include <BulletCollision/CollisionShapes/btConcaveShape.h>
#include <LinearMath/btAabbUtil2.h>

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include <bilayer/integration/bullet/shape.h>

#include "collider/contact/body/collider_data.h"
#include "collider/contact/open_surface/smooth_edge_angle.h"
#include "integration/bullet/detail/body_sweep.h"
#include "integration/bullet/detail/compound.h"
#include "integration/bullet/detail/contact_shapes.h"
#include "integration/bullet/detail/convert.h"
#include "integration/bullet/detail/leaf_shapes.h"
#include "integration/bullet/detail/pair_contacts.h"
#include "integration/bullet/detail/velocity.h"
#include "sdf/base/access.h"

namespace bilayer::bullet::detail {

namespace {

// Impacts up to this multiple of the energy that edges of the ground and of the body can take from it are given back. A
// block touches several edges at once and rocks, and a ball hops from facet to facet: their later impacts take what
// earlier ones caused.
constexpr float maxEnergyRatio = 8;
// A body that is slower along the ground than this may be at rest [speeds that gravity adds in a step].
constexpr float groundRestSpeed = 2;
// Approach velocities below this fraction of the speed along the ground are rounding.
constexpr float minSlope = 1e-3f;
// Slope beyond the steepest smooth edge.
const float maxSmoothSlope = std::tan(std::acos(smoothEdgeCosine));
// Maximum change of a body's kinetic energy in a step, relative.
constexpr float maxChange = 0.5f;

bool isTriangles(const btCollisionShape& shape) {
    const int type = shape.getShapeType();
    return shape.isConcave() && type != FAST_CONCAVE_MESH_PROXYTYPE && type != STATIC_PLANE_PROXYTYPE;
}

/// Whether an object consists of triangles and does not move, even if it is kinematic.
bool isGround(const btCollisionObject& object) {
    const auto isOther = [](const btCollisionShape& leaf, const btTransform&) { return !isTriangles(leaf); };
    if (!object.isStaticOrKinematicObject() ||
        anyLeafShape(*object.getCollisionShape(), btTransform::getIdentity(), isOther))
        return false;
    const Velocity velocity = velocityOf(object);
    return velocity.linear.isZero() && velocity.angular.isZero();
}

/// How far a body flies beyond a smooth edge before it lands, at most its own size [m].
btVector3 flightOf(const btRigidBody& body, float size) {
    const float speed = body.getLinearVelocity().length(), gravity = body.getGravity().length();
    const float flown = 2 * speed * speed * maxSmoothSlope / gravity;
    return speed > 0 ? (flown < size ? flown : size) / speed * body.getLinearVelocity() : btVector3(0, 0, 0);
}

/// The maximum angle between faces at the smooth edges in the bounding box of a body, and behind it as far as it flies
/// beyond an edge [rad].
/// @param at  pose of the shape with the edges
float edgeAngleUnder(const btRigidBody& body, const btCollisionShape& shape, const btTransform& at) {
    btVector3 lower, upper;
    body.getCollisionShape()->getAabb(at.inverse() * body.getWorldTransform(), lower, upper);
    const btVector3 behind = at.getBasis().transpose() * -flightOf(body, (upper - lower).length());
    lower.setMin(lower + behind);
    upper.setMax(upper + behind);
    std::vector<Triangle> triangles;
    const auto add = [&](const Triangle& triangle, std::uint64_t) {
        const btVector3 corners[] = {toBullet(triangle[0]), toBullet(triangle[1]), toBullet(triangle[2])};
        if (TestTriangleAgainstAabb2(corners, lower, upper)) triangles.push_back(triangle);
    };
    openSurfaceOf(static_cast<const btConcaveShape&>(shape)).visit({toGlm(lower), toGlm(upper)}, add);
    return maxSmoothEdgeAngle(triangles);
}

/// The same of an object of triangles.
float edgeAngleUnder(const btRigidBody& body, const btCollisionObject& ground) {
    float angle = 0;
    visitLeafShapes(*ground.getCollisionShape(), ground.getWorldTransform(),
                    [&](const btCollisionShape& leaf, const btTransform& at) {
                        angle = std::max(angle, edgeAngleUnder(body, leaf, at));
                    });
    return angle;
}

/// The maximum angle at the smooth edges of a field's triangle at a place, in the axes of its shape [rad].
float edgeAngleOf(const Shape& field, const btVector3& place) {
    const ColliderData& data = dataOf(field.collider());
    const Placed placed = field.placed(btTransform::getIdentity());
    const glm::vec3 inField = glm::conjugate(placed.pose.rotation) * (toGlm(place) - placed.pose.position);
    return data.body.mesh ? smoothEdgeAngleAt(data.meshTree(), inField / placed.scale) : 0;
}

/// The same of a body's own surface at a place, in the body's axes [rad].
float edgeAngleOf(const btRigidBody& body, const btVector3& place) {
    float angle = 0;
    visitLeafShapes(*body.getCollisionShape(), btTransform::getIdentity(),
                    [&](const btCollisionShape& leaf, const btTransform& at) {
                        if (isField(leaf))
                            angle = std::max(angle, edgeAngleOf(static_cast<const Shape&>(leaf), at.inverse() * place));
                    });
    return angle;
}

}  // namespace

/// Twice the energy per mass of the fall of a body that has tipped over an edge. Its weight accelerates its rotation
/// with the distance of its centre from the edge, until it has turned by the angle. `arm` stands for its radius of
/// gyration about the edge.
float FacetImpact::tipping(float angle) const {
    const float slope = std::tan(angle), beyondEdge = std::cbrt(6 * arm * arm * slope * speed * speed / gravity);
    return gravity > 0 ? 2 * gravity * std::min(beyondEdge, arm) * slope : 0;
}

float FacetImpact::loss(float angle) const {
    const float deflected = speed * std::tan(angle);
    const float tipped = std::min((mobility - 1) * tipping(angle), rotationSpeed * rotationSpeed);
    const float caused = maxEnergyRatio * mobility * deflected * deflected + tipped, approach = before * before;
    return -0.5f * impulse * (before + after) * (caused < approach ? caused / approach : 1);
}

float FacetFriction::loss(float angle) const {
    const float tangent = std::tan(angle);
    return before.length() < tangent * tangent * speed ? -0.5f * impulse.dot(before + after) : 0;
}

void SmoothGround::beforeStep() {
    before_.record(
        world_, [](btCollisionObject& object) { return activeDynamicBody(object) ? velocityOf(object) : Velocity{}; });
}

float SmoothGround::edgeAngleUnder(const Ground& ground) {
    const auto [angle, isNew] = edgeAngles_.try_emplace(ground, 0.f);
    if (isNew) angle->second = detail::edgeAngleUnder(*ground.first, *ground.second);
    return angle->second;
}

float SmoothGround::lossIn(const btPersistentManifold& manifold, const Ground& ground, float seconds) {
    const btRigidBody& body = *ground.first;
    const Velocity* before = before_.find(body);
    if (!before) return 0;
    const bool bodyIsFirst = manifold.getBody0() == &body;
    const float rotation = before->angular.length() * seconds;
    // The centre has moved since the contacts were found, but their positions have not.
    const Velocity after{before->centre, body.getLinearVelocity(), body.getAngularVelocity()};
    float loss = 0;
    for (int i = 0; i < manifold.getNumContacts(); ++i) {
        const btManifoldPoint& point = manifold.getContactPoint(i);
        if (!(point.m_appliedImpulse > 0)) continue;
        const btVector3 place = bodyIsFirst ? point.getPositionWorldOnA() : point.getPositionWorldOnB();
        const btVector3 normal = (bodyIsFirst ? 1.f : -1.f) * point.m_normalWorldOnB;
        const auto along = [&](const btVector3& v) { return v - normal.dot(v) * normal; };
        const btVector3 pointBefore = before->at(place), pointAfter = after.at(place);
        const FacetImpact impact{point.m_appliedImpulse,
                                 normal.dot(pointBefore),
                                 normal.dot(pointAfter),
                                 along(before->linear).length(),
                                 body.computeImpulseDenominator(place, normal) / body.getInvMass(),
                                 (place - before->centre).length(),
                                 -normal.dot(body.getGravity()),
                                 normal.dot(pointBefore - before->linear)};
        if (impact.speed < groundRestSpeed * seconds * body.getGravity().length()) continue;
        if (!(std::abs(impact.before) > minSlope * impact.speed)) continue;
        const float own = edgeAngleOf(body, bodyIsFirst ? point.m_localPointA : point.m_localPointB);
        const float angle = edgeAngleUnder(ground) + (own > 0 ? own + rotation : 0);
        loss += impact.loss(angle);
        if (!(own > 0)) continue;
        const btVector3 friction = point.m_appliedImpulseLateral1 * point.m_lateralFrictionDir1 +
                                   point.m_appliedImpulseLateral2 * point.m_lateralFrictionDir2;
        loss +=
            FacetFriction{(bodyIsFirst ? 1.f : -1.f) * friction, along(pointBefore), along(pointAfter), impact.speed}
                .loss(angle);
    }
    return loss;
}

/// The energy returns to the linear velocity. Rotation about the vertical gets none of it.
void SmoothGround::afterStep(float seconds) {
    std::unordered_map<btRigidBody*, float> losses;
    for (int m = 0; m < world_.getDispatcher()->getNumManifolds(); ++m) {
        const btPersistentManifold& manifold = *world_.getDispatcher()->getManifoldByIndexInternal(m);
        const btCollisionObject *object = manifold.getBody0(), *ground = manifold.getBody1();
        if (object->isStaticOrKinematicObject()) std::swap(object, ground);
        btRigidBody* const body = activeDynamicBody(const_cast<btCollisionObject&>(*object));
        if (!body || !isGround(*ground)) continue;
        if (holdsField(*body->getCollisionShape())) losses[body] += lossIn(manifold, {body, ground}, seconds);
    }
    for (const auto& [body, loss] : losses) {
        const float kinetic = 0.5f * body->getLinearVelocity().length2() / body->getInvMass();
        if (loss == 0 || !(kinetic > 0)) continue;
        const float change = std::clamp(loss / kinetic, -maxChange, maxChange);
        body->setLinearVelocity(std::sqrt(1 + change) * body->getLinearVelocity());
    }
    before_.clear();
    edgeAngles_.clear();
}

}  // namespace bilayer::bullet::detail
