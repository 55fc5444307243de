// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/pair_contacts.h"

#include <BulletCollision/CollisionShapes/btStaticPlaneShape.h>

#include <algorithm>
#include <limits>

#include <bilayer/collider/contact.h>
#include <bilayer/integration/bullet/shape.h>
#include "collider/contact/search/contact_range.h"
#include "collider/contact/search/edge_probes.h"
#include "collider/contact/search/predicted_contacts.h"
#include "collider/contact/shape_contacts.h"
#include "integration/bullet/detail/convert.h"
#include "integration/bullet/detail/velocity.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

namespace {

// Tolerance of equal distances of triangles from a contact [voxels].
constexpr float sameDistance = 1e-3f;
// A contact is not predicted to move on to a triangle whose normal is farther from its own than this, relative to the
// triangle that it is on: 3 degrees (cosine).
constexpr float minPredictedCosine = 0.9986f;

bool hasTriangles(const btCollisionShape& shape) {
    return shape.isConcave() && !isField(shape) && shape.getShapeType() != STATIC_PLANE_PROXYTYPE;
}

/// The parameters for two bodies until the next step; B is a field.
Continuity continuityOf(const Side& a, const Side& b) {
    const auto restingFriction = [](const btCollisionShape& shape) {
        return isField(shape) ? static_cast<const Shape&>(shape).restingFriction() : 1;
    };
    const auto sameWithin = [](const btCollisionShape& shape) {
        return isField(shape) ? shape.getContactBreakingThreshold(gContactBreakingThreshold)
                              : std::numeric_limits<float>::max();
    };
    const auto isSpeculative = [](const Side& side) {
        return side.seconds > 0 && (!isField(*side.shape) || static_cast<const Shape&>(*side.shape).speculative());
    };
    return {.sameWithin = std::min(sameWithin(*a.shape), sameWithin(*b.shape)),
            .restingFriction = std::max(restingFriction(*a.shape), restingFriction(*b.shape)),
            .isSpeculative = isSpeculative(a) && isSpeculative(b)};
}

SteppedBody steppedBody(const Side& side) {
    const Velocity velocity = velocityOf(*side.object);
    SteppedBody body{toGlm(velocity.centre), toGlm(velocity.linear), toGlm(velocity.angular), side.seconds, {}};
    if (isField(*side.shape)) body.field.emplace(static_cast<const Shape&>(*side.shape).placed(side.transform));
    return body;
}

}  // namespace

Motion Side::motionAt(const btVector3& point) const {
    if (!(seconds > 0) || !object->isActive()) return {};
    const Velocity velocity = velocityOf(*object);
    const btVector3 displacement = seconds * (velocity.at(point) + seconds * accelerationOf(*object));
    return {toGlm(displacement), toGlm(seconds * velocity.angular)};
}

Placed Side::placed() const {
    const auto& field = static_cast<const Shape&>(*shape);
    Placed body = field.placed(transform);
    if (field.speculative()) body.motion = motionAt(toBullet(body.pose.position));
    return body;
}

float marginOf(const Side& a, const Side& b) {
    return isField(*a.shape) ? std::max(a.shape->getMargin(), b.shape->getMargin()) : b.shape->getMargin();
}

void Pair::collide(const Side& a, const Side& b) {
    find(a, b, marginOf(a, b), false);
    finish(a, b);
}

void Pair::collide(const Side& a, const Side& b, const SampledPairs& sampled, std::size_t index) {
    contacts_.clear();
    report_ = collideFound(a.placed(), b.placed(), {.margin = marginOf(a, b)}, sampled.ofA(index), sampled.ofB(index),
                           contacts_);
    finish(a, b);
    ++sampled_;
}

void Pair::test(const Side& a, const Side& b, float asked) {
    const float voxel = static_cast<const Shape&>(*b.shape).voxelSize();
    float margin = std::max(marginOf(a, b), std::min(asked, voxel));
    const float maxDistance = std::max(margin, asked);
    // a point between surface points is found by those around it, which are farther away
    const float between = probeSpacing * voxel;
    find(a, b, margin, true);
    while (contacts_.empty() && margin < maxDistance + between)
        find(a, b, margin = std::min(std::max(2 * margin, voxel), maxDistance + between), true);
    if (const float sufficient = nearest() + between; !contacts_.empty() && sufficient > margin)
        find(a, b, sufficient, true);
    std::erase_if(contacts_, [&](const Contact& contact) { return contact.distance > maxDistance; });
    finish(a, b);
}

void Pair::commit(const btCollisionObject& a, const btCollisionObject& b, float seconds, btManifoldResult& result) {
    const ReducedContacts& reduced = reduction_.reduced();
    manifolds_.write(reduced.patches, details_, a, b, seconds, continuity_, result);
    ++statistics_.pairs;
    statistics_.contactsFound += found_;
    for (const ContactPatch& patch : reduced.patches) statistics_.contactsKept += patch.count;
    statistics_.reductionError = std::max(statistics_.reductionError, reduced.reductionError);
    statistics_.beyondBand += static_cast<int>(report_.beyondBand);
    statistics_.sampled += sampled_;
    isReady_ = false;
}

float Pair::nearest() const {
    float minDistance = std::numeric_limits<float>::max();
    for (const Contact& contact : contacts_) minDistance = std::min(minDistance, contact.distance);
    return minDistance;
}

void Pair::find(const Side& a, const Side& b, float margin, bool exact) {
    contacts_.clear();
    const bool follows = static_cast<const Shape&>(*b.shape).speculative();
    ContactOptions options{.margin = margin, .exact = exact};
    if (!isField(*a.shape)) {
        const Motion motion = follows ? a.motion() : Motion{};
        report_ = collideShape({otherShape(*a.shape), toPose(a.transform), 1, motion}, b.placed(), options, contacts_);
        return;
    }
    // a contact test needs the distance of the bodies for any direction of their normals
    if (exact) {
        options.minNormalCosineApart = options.minNormalCosine;
        options.keepsObliqueEdges = true;
    }
    report_ = collideWithin(ContactRange::band, a.placed(), b.placed(), options, contacts_, &cache_);
}

void Pair::finish(const Side& a, const Side& b) {
    found_ = static_cast<int>(contacts_.size());
    reduction_.update(contacts_, toPose(a.transform), toPose(b.transform), relativeRotation(a.motion(), b.motion()));
    continuity_ = continuityOf(a, b);
    details_.clear();
    const SteppedBody bodyA = steppedBody(a), bodyB = steppedBody(b);
    const PredictedContacts predictions(bodyA, bodyB, continuity_.sameWithin, continuity_.isSpeculative);
    for (const ContactPatch& patch : reduction_.reduced().patches)
        for (int i = 0; i < patch.count; ++i)
            details_.push_back({predictions.predict(patch.contacts[i]), std::nullopt});
    if (hasTriangles(*a.shape)) useTriangles(static_cast<const btConcaveShape&>(*a.shape), a.transform, b.placed());
    isReady_ = true;
    sampled_ = 0;
}

void Pair::useTriangles(const btConcaveShape& mesh, const btTransform& transform, const Placed& field) {
    std::vector<MeshPlace> places;
    for (const ContactPatch& patch : reduction_.reduced().patches)
        for (int i = 0; i < patch.count; ++i) {
            const Contact& contact = patch.contacts[i];
            places.push_back(
                {toBullet(contact.position + contact.distance * contact.normal), toBullet(contact.normal)});
        }
    const std::size_t count = places.size();
    for (const ContactDetails& details : details_)
        if (const auto& predicted = details.prediction)
            places.push_back({toBullet(predicted->onA), toBullet(predicted->normal)});
    const Field& of = field.collider.field();
    const float voxel = field.scale * of.voxelSize(), reach = voxel + field.scale * of.interiorWidth();
    const auto triangles = trianglesAt(mesh, transform, places, reach, sameDistance * voxel);
    for (std::size_t i = 0, atEnd = count; i < count; ++i) {
        const auto& here = triangles[i];
        if (here) details_[i].triangle = here->id;
        if (!details_[i].prediction) continue;
        const auto& there = triangles[atEnd++];
        if (!there || there->cosine < minPredictedCosine * (here ? here->cosine : 1)) details_[i].prediction.reset();
    }
}

ContactShape Pair::otherShape(const btCollisionShape& shape) {
    if (!shape.isConvex()) return contactShapeOf(shape);
    const auto& convex = static_cast<const btConvexShape&>(shape);
    if (!convex_ || !convex_->represents(convex)) convex_.emplace(convex);
    return convex_->contactShape();
}

}  // namespace bilayer::bullet::detail
