// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/manifolds.h"
#include <bilayer/collider/contact.h>

#include <algorithm>
#include <cmath>
#include <typeinfo>
#include <utility>

#include "collider/contact/reduction/contact_groups.h"
#include "integration/bullet/detail/convert.h"
#include "integration/bullet/detail/velocity.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

namespace {

// A contact sticks below this fraction of the friction limit. A drift along the surface beyond the second value is not
// pulled back [fractions of Continuity::sameWithin].
constexpr float stickingLimit = 0.98f, maxDrift = 0.25f;
// The time until a contact bears its full resting friction [steps], and the slip that removes it [fractions of
// Continuity::sameWithin]. It falls gradually, so that other contacts have time to take over the load. In all
// measured piles, sticking contacts slip less in one step.
constexpr float stepsOfRest = 120, slipOfRest = 0.05f;

/// The identifiers of a contact in a manifold point.
struct Identifiers {
    TriangleId a, b;
};

/// @param aIsFirst  whether A is the first body of the result
Identifiers identifiersOf(const Contact& contact, const std::optional<TriangleId>& triangle, bool aIsFirst,
                          const btManifoldResult& result) {
    const btCollisionObjectWrapper *a = result.getBody0Wrap(), *b = result.getBody1Wrap();
    if (!aIsFirst) std::swap(a, b);
    const int feature = static_cast<int>(contact.feature & ~featureOfB);
    const bool isOfB = (contact.feature & featureOfB) != 0;
    // the wrapper of a part of a compound or mesh names the part
    const auto name = [](const btCollisionObjectWrapper& wrap, int feature) {
        return wrap.m_index >= 0 ? TriangleId{wrap.m_partId, wrap.m_index} : TriangleId{0, feature};
    };
    return {triangle ? *triangle : name(*a, isOfB ? -1 : feature), name(*b, isOfB ? feature : -1)};
}

/// A new manifold point, as Bullet creates it in btManifoldResult::addContactPoint(), but without merging it with
/// others, at any distance, and without user callbacks.
btManifoldPoint pointOf(const Contact& contact, const Identifiers& of, const btPersistentManifold& manifold,
                        const btManifoldResult& result) {
    const btVector3 onB = toBullet(contact.position), normal = toBullet(contact.normal);
    const btVector3 onA = onB + contact.distance * normal;
    btManifoldPoint point(manifold.getBody0()->getWorldTransform().invXform(onA),
                          manifold.getBody1()->getWorldTransform().invXform(onB), normal, contact.distance);
    point.m_positionWorldOnA = onA;
    point.m_positionWorldOnB = onB;
    btPlaneSpace1(normal, point.m_lateralFrictionDir1, point.m_lateralFrictionDir2);
    point.m_partId0 = of.a.part;
    point.m_index0 = of.a.index;
    point.m_partId1 = of.b.part;
    point.m_index1 = of.b.index;

    const btCollisionObject *first = result.getBody0Internal(), *second = result.getBody1Internal();
    point.m_combinedFriction = gCalculateCombinedFrictionCallback(first, second);
    point.m_combinedRestitution = gCalculateCombinedRestitutionCallback(first, second);
    point.m_combinedRollingFriction = gCalculateCombinedRollingFrictionCallback(first, second);
    point.m_combinedSpinningFriction = gCalculateCombinedSpinningFrictionCallback(first, second);
    if ((first->getCollisionFlags() | second->getCollisionFlags()) &
        btCollisionObject::CF_HAS_CONTACT_STIFFNESS_DAMPING) {
        point.m_combinedContactDamping1 = gCalculateCombinedContactDampingCallback(first, second);
        point.m_combinedContactStiffness1 = gCalculateCombinedContactStiffnessCallback(first, second);
        point.m_contactPointFlags |= BT_CONTACT_FLAG_CONTACT_STIFFNESS_DAMPING;
    }
    return point;
}

/// Adds a contact to the result's manifold.
void addContact(const Contact& contact, const Identifiers& of, bool aIsFirst, btManifoldResult& result) {
    btPersistentManifold& manifold = *result.getPersistentManifold();
    manifold.setContactBreakingThreshold(std::max(contact.distance, 0.f));
    if (!isOfUser(result)) {
        manifold.addManifoldPoint(pointOf(contact, of, manifold, result));
        return;
    }
    const TriangleId &first = aIsFirst ? of.a : of.b, &second = aIsFirst ? of.b : of.a;
    result.setShapeIdentifiersA(first.part, first.index);
    result.setShapeIdentifiersB(second.part, second.index);
    result.addContactPoint(toBullet(contact.normal), toBullet(contact.position), contact.distance);
}

/// Calls the user's contact-added callback after the point has its final values. The user's data in the point is kept
/// from step to step.
void notifyAdded(btManifoldPoint& point, const btPersistentManifold& manifold, const btManifoldResult& result) {
    const btCollisionObjectWrapper *first = result.getBody0Wrap(), *second = result.getBody1Wrap();
    const auto wantsCallback = [](const btCollisionObjectWrapper& side) {
        return (side.getCollisionObject()->getCollisionFlags() & btCollisionObject::CF_CUSTOM_MATERIAL_CALLBACK) != 0;
    };
    if (!gContactAddedCallback || !(wantsCallback(*first) || wantsCallback(*second))) return;
    if (manifold.getBody0() != first->getCollisionObject()) std::swap(first, second);
    gContactAddedCallback(point, first, point.m_partId0, point.m_index0, second, point.m_partId1, point.m_index1);
}

/// Calls the user's callback for a point that existed before.
void notifyProcessed(btManifoldPoint& point, const btPersistentManifold& manifold) {
    if (!gContactProcessedCallback || point.m_lifeTime == 0) return;
    gContactProcessedCallback(point, const_cast<btCollisionObject*>(manifold.getBody0()),
                              const_cast<btCollisionObject*>(manifold.getBody1()));
}

/// The component of a vector along a surface.
btVector3 tangential(const btVector3& v, const btVector3& normal) {
    return v - normal.dot(v) * normal;
}

/// Moves a contact that rotates in the step to its predicted position. The drift in between is not slip.
void applyPrediction(btManifoldPoint& point, const PredictedContact& prediction) {
    point.m_positionWorldOnA = toBullet(prediction.onA);
    point.m_positionWorldOnB = toBullet(prediction.onB);
    point.m_normalWorldOnB = toBullet(prediction.normal);
    point.m_distance1 = prediction.distance;
    point.m_contactPointFlags &= ~BT_CONTACT_FLAG_FRICTION_ANCHOR;
}

/// State of a contact's friction anchor after a step.
struct Anchor {
    btVector3 drift;  ///< distance to pull the two anchor points back along the surface
    float slip;       ///< slip between them
};

/// The anchor after a step. Where the contact slipped, it is pulled back no farther than before. If a sticking contact
/// leaves the path along which it is pulled back, the user has moved it, or it was torn off.
Anchor anchorOf(const btManifoldPoint& point, const btVector3& before, const btPersistentManifold& manifold,
                float sameWithin) {
    const btVector3 drift = tangential(manifold.getBody0()->getWorldTransform() * point.m_localPointA -
                                           manifold.getBody1()->getWorldTransform() * point.m_localPointB,
                                       point.m_normalWorldOnB);
    // Bullet limits friction in each of its directions separately
    const float friction = std::max(std::abs(point.m_appliedImpulseLateral1), std::abs(point.m_appliedImpulseLateral2));
    const bool holds = friction < stickingLimit * point.m_combinedFriction * point.m_appliedImpulse;
    const float maxLength = holds ? maxDrift * sameWithin : std::min(maxDrift * sameWithin, float(before.length()));
    const float length = drift.length(), slip = (drift - before).length();
    const float left = before.isZero() ? 0 : std::clamp(drift.dot(before) / before.length2(), 0.f, 1.f);
    if (holds && (drift - left * before).length() > slipOfRest * sameWithin) return {btVector3(0, 0, 0), slip};
    return {length > maxLength ? maxLength / length * drift : drift, holds ? 0 : slip};
}

}  // namespace

bool isOfUser(const btManifoldResult& result) {
    return typeid(result) != typeid(btManifoldResult);
}

struct Manifolds::Step {
    float seconds;
    Velocity a, b;
    btVector3 gain;  ///< velocity change by the forces on the bodies, of B relative to A [m/s]
    bool aIsFirst;   ///< whether A is the first body of the result
    const Continuity& continuity;
    btManifoldResult& result;

    Step(const btCollisionObject& a, const btCollisionObject& b, float seconds, const Continuity& continuity,
         btManifoldResult& result)
        : seconds(seconds),
          a(velocityOf(a)),
          b(velocityOf(b)),
          gain(seconds * (accelerationOf(b) - accelerationOf(a))),
          aIsFirst(result.getBody0Internal() == &a),
          continuity(continuity),
          result(result) {}

    /// Sets the restitution of a speculative contact. The solver subtracts the remaining separation from the speed of a
    /// bounce. So a body that reaches the surface in this step bounces as if it touched already, and one that only
    /// comes nearer keeps its velocity. A body that rests, or comes no faster than its weight accelerates it in two
    /// steps, does not bounce.
    void bounce(btManifoldPoint& point) const {
        if (!(seconds > 0 && point.m_distance1 > 0 && point.m_combinedRestitution > 0) || point.m_appliedImpulse > 0)
            return;
        const btVector3& normal = point.m_normalWorldOnB;
        const float speed = normal.dot(b.at(point.m_positionWorldOnB) - a.at(point.m_positionWorldOnA));
        const float gained = normal.dot(gain);
        if (speed <= 2 * std::abs(gained)) return;
        if (point.m_distance1 <= seconds * (speed + gained))
            point.m_distance1 = 0;
        else
            point.m_combinedRestitution = 0;
    }
};

Manifolds::~Manifolds() {
    for (btPersistentManifold* manifold : manifolds_) dispatcher_.releaseManifold(manifold);
}

void Manifolds::write(std::span<const ContactPatch> patches, std::span<const ContactDetails> details,
                      const btCollisionObject& a, const btCollisionObject& b, float seconds,
                      const Continuity& continuity, btManifoldResult& result) {
    // At least one manifold: users expect one for a pair that overlaps.
    while (manifolds_.size() < std::max<std::size_t>(patches.size(), 1))
        manifolds_.push_back(dispatcher_.getNewManifold(&a, &b));
    written_.resize(manifolds_.size());

    takeOldPoints();
    const Step step(a, b, seconds, continuity, result);
    for (std::size_t m = 0, at = 0; m < manifolds_.size(); ++m) {
        std::span<const Contact> contacts;
        if (m < patches.size()) contacts = std::span(patches[m].contacts).first(std::size_t(patches[m].count));
        fill(m, contacts, details.subspan(at, contacts.size()), step);
        at += contacts.size();
    }
    for (const auto& [point, written] : old_)
        if (point.m_userPersistentData && gContactDestroyedCallback)
            gContactDestroyedCallback(point.m_userPersistentData);
}

void Manifolds::takeOldPoints() {
    old_.clear();
    for (std::size_t m = 0; m < manifolds_.size(); ++m)
        for (int i = 0; i < manifolds_[m]->getNumContacts(); ++i) {
            btManifoldPoint& point = manifolds_[m]->getContactPoint(i);
            old_.push_back({point, writtenAs(point, m)});
            point.m_userPersistentData = nullptr;
        }
}

void Manifolds::fill(std::size_t m, std::span<const Contact> contacts, std::span<const ContactDetails> details,
                     const Step& step) {
    btPersistentManifold* manifold = manifolds_[m];
    const bool touched = manifold->getNumContacts() > 0;
    manifold->setNumContacts(0);
    step.result.setPersistentManifold(manifold);
    for (std::size_t n = 0; n < contacts.size(); ++n) {
        const Identifiers of = identifiersOf(contacts[n], details[n].triangle, step.aIsFirst, step.result);
        addContact(contacts[n], of, step.aIsFirst, step.result);
    }
    const bool notifies = !isOfUser(step.result);
    for (int i = 0; i < manifold->getNumContacts(); ++i) {
        const auto n = std::size_t(i);
        btManifoldPoint& point = manifold->getContactPoint(i);
        Written& written = written_[m][n];
        written = inherit(*manifold, i, step.continuity);
        if (notifies) notifyAdded(point, *manifold, step.result);
        if (point.m_contactMotion1 != 0 || point.m_contactMotion2 != 0) releaseAnchor(*manifold, point, written);
        const bool isUnchanged = point.m_normalWorldOnB == toBullet(contacts[n].normal);
        if (details[n].prediction && isUnchanged) applyPrediction(point, *details[n].prediction);
        step.bounce(point);
        notifyProcessed(point, *manifold);
    }
    manifold->setContactBreakingThreshold(step.continuity.sameWithin);
    const bool touches = manifold->getNumContacts() > 0;
    if (notifies && !touched && touches && gContactStartedCallback) gContactStartedCallback(manifold);
    if (touched && !touches && gContactEndedCallback) gContactEndedCallback(manifold);
}

Manifolds::Written Manifolds::writtenAs(const btManifoldPoint& point, std::size_t manifold) const {
    for (const Written& written : written_[manifold])
        if (written.ofA == point.m_localPointA && written.ofB == point.m_localPointB) return written;
    return {};
}

/// Releases the anchor: the user moves one surface along the other, so former contact points drift apart as intended.
void Manifolds::releaseAnchor(const btPersistentManifold& manifold, btManifoldPoint& point, Written& written) {
    point.m_contactPointFlags &= ~BT_CONTACT_FLAG_FRICTION_ANCHOR;
    point.m_positionWorldOnA -= written.drift;
    point.m_localPointA = manifold.getBody0()->getWorldTransform().invXform(point.m_positionWorldOnA);
    written = {point.m_localPointA, point.m_localPointB};
}

Manifolds::Written Manifolds::inherit(btPersistentManifold& manifold, int index, const Continuity& continuity) {
    const float sameWithin = continuity.sameWithin;
    btManifoldPoint& point = manifold.getContactPoint(index);
    point.m_contactPointFlags |= BT_CONTACT_FLAG_FRICTION_ANCHOR;
    float nearest = sameWithin * sameWithin;
    auto source = old_.end();
    for (auto it = old_.begin(); it != old_.end(); ++it) {
        const float squared = std::min((it->point.m_localPointA - point.m_localPointA).length2(),
                                       (it->point.m_localPointB - point.m_localPointB).length2());
        if (squared < nearest && it->point.m_normalWorldOnB.dot(point.m_normalWorldOnB) > sameDirection)
            nearest = squared, source = it;
    }
    if (source == old_.end()) return {point.m_localPointA, point.m_localPointB};
    const auto& [old, written] = *source;
    point.m_appliedImpulse = old.m_appliedImpulse;
    point.m_appliedImpulseLateral1 = old.m_appliedImpulseLateral1;
    point.m_appliedImpulseLateral2 = old.m_appliedImpulseLateral2;
    point.m_prevRHS = old.m_prevRHS;
    point.m_lifeTime = old.m_lifeTime + 1;
    point.m_userPersistentData = old.m_userPersistentData;
    const Anchor anchor = anchorOf(old, written.drift, manifold, sameWithin);
    point.m_positionWorldOnA += tangential(anchor.drift, point.m_normalWorldOnB);
    point.m_localPointA = manifold.getBody0()->getWorldTransform().invXform(point.m_positionWorldOnA);
    const float gained = anchor.slip > 0 ? -anchor.slip / (slipOfRest * sameWithin) : 1 / stepsOfRest;
    const float rest = std::clamp(written.rest + gained, 0.f, 1.f);
    point.m_combinedFriction *= 1 + rest * (continuity.restingFriction - 1);
    *source = old_.back();
    old_.pop_back();
    const btVector3 drift = tangential(point.m_positionWorldOnA - point.m_positionWorldOnB, point.m_normalWorldOnB);
    return {point.m_localPointA, point.m_localPointB, drift, rest};
}

}  // namespace bilayer::bullet::detail
