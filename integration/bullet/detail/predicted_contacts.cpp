// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/predicted_contacts.h"
#include "collider/contact/collider_data.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include <bilayer/collider/contact.h>
#include <bilayer/integration/bullet/shape.h>
#include "collider/contact/surface_query.h"
#include "integration/bullet/detail/convert.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

namespace {

// Points that rotation moves by less than this are not predicted [fractions of Continuity::sameWithin].
constexpr float minDisplacement = 0.05f;
// Maximum rotation of a prediction [rad]. Without speculative contacts, the points that take over are known only up to
// a margin. A rotation then lifts no point off the surface by more than the second value [fractions of
// Continuity::sameWithin].
constexpr float maxRotation = 0.5f, maxLift = 0.25f;
// Predicted contacts touch slightly too early. Otherwise the points around the lowest one of a wheel penetrate by the
// error of a step, and throw it up when they touch. The first value is a fraction of the curvature of their paths, the
// second its limit [fractions of Continuity::sameWithin].
constexpr float earlyFraction = 0.1f, maxEarly = 0.05f;
// Minimum cosine between the field's and the contact's normals. Below it, the contact is that of an edge, and the field
// gives no information about it.
constexpr float sameNormal = 0.95f;
// Below this cosine, the field there belongs to another face.
constexpr float likeNormal = 0.8f;

btVector3 rotated(const btVector3& arm, const btVector3& spin, float seconds) {
    const float speed = spin.length();
    return speed * seconds != 0 ? arm.rotate(spin / speed, speed * seconds) : arm;
}

/// The surface of a body near a point.
struct Surface {
    btVector3 normal;
    float distance;
};

/// The surface of a contact at one point, evaluated at a nearby point: by the field's samples, or as a plane.
std::optional<Surface> surfaceAt(const Side& side, const Surface& contact, const btVector3& place,
                                 const btVector3& nearby) {
    const Surface plane{contact.normal, contact.distance + contact.normal.dot(nearby - place)};
    if (!isField(*side.shape)) return plane;
    const Placed body = side.placed();
    const Field& field = body.collider.field();
    const auto sampleAt = [&](const btVector3& point) -> std::optional<SurfaceSample> {
        const glm::vec3 at = body.pose.toBody(toGlm(point)) / body.scale;
        const Sample sample = field.sample(at);
        if (!sample.inBand) return std::nullopt;
        return surfaceSampleAt(field, at, sample, body.collider.data().isExactAt(at));
    };
    // at the height of the contact, since thin walls have another side deeper down
    const float rise = contact.normal.dot(nearby - place);
    const auto here = sampleAt(place), there = sampleAt(nearby - rise * contact.normal);
    if (!here || !there) return std::nullopt;
    const auto inWorld = [&](const glm::vec3& normal) { return toBullet(body.pose.rotation * normal); };
    if (!(inWorld(here->normal).dot(contact.normal) > sameNormal)) return plane;
    const btVector3 normal = inWorld(there->normal);
    const float alike = normal.dot(contact.normal);
    if (!(alike > likeNormal)) return std::nullopt;
    return Surface{normal, contact.distance + body.scale * (there->distance - here->distance) + alike * rise};
}

}  // namespace

PredictedContacts::PredictedContacts(const Side& a, const Side& b, const Continuity& continuity)
    : a_{a, velocityOf(*a.object)}, b_{b, velocityOf(*b.object)}, continuity_(continuity) {}

/// The time in which a body rotates a point no farther than the contacts are known.
float PredictedContacts::maxSeconds(const MovingSide& body, const btVector3& place) const {
    const float arm = (place - body.velocity.centre).length();
    const float maxAngle =
        continuity_.isSpeculative ? maxRotation : std::sqrt(2 * maxLift * continuity_.sameWithin / arm);
    return maxAngle / body.velocity.angular.length();  // infinite without rotation
}

std::optional<PredictedContact> PredictedContacts::predict(const Contact& contact) const {
    // contacts that touch stay where they are: behind a wheel, they would push it on
    if (contact.turningRadius < 0 || contact.distance <= 0) return std::nullopt;
    const bool isOfB = contact.feature & featureOfB;
    const MovingSide &own = isOfB ? b_ : a_, &other = isOfB ? a_ : b_;
    const Velocity &velocity = own.velocity, &otherVelocity = other.velocity;
    const btVector3 fromB = toBullet(contact.normal), outward = isOfB ? -fromB : fromB;
    // the centre of the sphere that a vertex is rounded by rotates
    const float radius = contact.turningRadius, height = contact.distance + radius;
    const btVector3 onB = toBullet(contact.position), middle = onB + (isOfB ? radius : height) * outward;
    const btVector3 arm = middle - velocity.centre, otherArm = middle - otherVelocity.centre;

    const float seconds = std::min({own.side.seconds, maxSeconds(own, middle), maxSeconds(other, middle)});
    const float displacement = seconds * velocity.angular.cross(arm).length(),
                otherDisplacement = seconds * otherVelocity.angular.cross(otherArm).length();
    if (!(std::max(displacement, otherDisplacement) > minDisplacement * continuity_.sameWithin)) return std::nullopt;

    // Seen from the other body's centre, it moves along that body's surface; the solver handles the motion towards it.
    const btVector3 armAtEnd = rotated(arm, velocity.angular, seconds),
                    relativeVelocity = velocity.linear - otherVelocity.linear;
    const float separatingSpeed = outward.dot(relativeVelocity);
    const btVector3 otherArmAtEnd =
        otherArm + armAtEnd - arm + seconds * (relativeVelocity - separatingSpeed * outward);
    const auto surface = surfaceAt(other.side, {outward, height}, middle,
                                   otherVelocity.centre + rotated(otherArmAtEnd, otherVelocity.angular, -seconds));
    if (!surface) return std::nullopt;
    const btVector3 normal = rotated(surface->normal, otherVelocity.angular, seconds);
    const btVector3 ownAtEnd = velocity.centre + armAtEnd - radius * normal,
                    otherAtEnd = otherVelocity.centre + otherArmAtEnd - surface->distance * normal;
    const float accounted = seconds * normal.dot(velocity.at(ownAtEnd) - otherVelocity.at(otherAtEnd)),
                remaining = surface->distance - radius + seconds * separatingSpeed - accounted;
    const float curvature = seconds * velocity.angular.length() * displacement,
                earlyBy = std::min(maxEarly * continuity_.sameWithin, earlyFraction * curvature);
    const float distance = std::max(remaining - earlyBy, 0.f);
    if (isOfB) return PredictedContact{otherAtEnd, ownAtEnd, -normal, distance};
    return PredictedContact{ownAtEnd, otherAtEnd, normal, distance};
}

}  // namespace bilayer::bullet::detail
