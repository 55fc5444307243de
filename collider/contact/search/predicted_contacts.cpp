// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/search/predicted_contacts.h"

#include <algorithm>
#include <cmath>

#include "collider/contact/body/collider_data.h"
#include "collider/contact/search/surface_query.h"
#include "sdf/base/access.h"

namespace bilayer::detail {

namespace {

// Points that rotation moves by less than this are not predicted [fractions of sameWithin].
constexpr float minDisplacement = 0.05f;
// Maximum rotation of a prediction [rad]. Without speculative contacts, the points that take over are known only up to
// a margin. A rotation then lifts no point off the surface by more than the second value [fractions of
// sameWithin].
constexpr float maxPredictedRotation = 0.5f, maxLift = 0.25f;
// Predicted contacts touch slightly too early. Otherwise the points around the lowest one of a wheel penetrate by the
// error of a step, and throw it up when they touch. The first value is a fraction of the curvature of their paths, the
// second its limit [fractions of sameWithin].
constexpr float earlyFraction = 0.1f, maxEarly = 0.05f;
// Minimum cosine between the field's and the contact's normals. Below it, the contact is that of an edge, and the field
// gives no information about it.
constexpr float sameNormal = 0.95f;
// Below this cosine, the field there belongs to another face.
constexpr float likeNormal = 0.8f;

glm::vec3 rotated(const glm::vec3& arm, const glm::vec3& spin, float seconds) {
    const float speed = glm::length(spin), angle = speed * seconds;
    if (angle == 0) return arm;
    const glm::vec3 axis = spin * (1 / speed), along = axis * glm::dot(axis, arm);
    return along + (arm - along) * std::cos(angle) + glm::cross(axis, arm) * std::sin(angle);
}

/// The surface of a contact at one point, evaluated at a nearby point: by the field's samples, or as a plane.
std::optional<SurfaceSample> surfaceAt(const SteppedBody& of, const SurfaceSample& contact, const glm::vec3& place,
                                       const glm::vec3& nearby) {
    const SurfaceSample plane{contact.distance + glm::dot(contact.normal, nearby - place), contact.normal};
    if (!of.field) return plane;
    const Placed& body = *of.field;
    const Field& field = body.collider.field();
    const auto sampleAt = [&](const glm::vec3& point) -> std::optional<SurfaceSample> {
        const glm::vec3 at = body.pose.toBody(point) / body.scale;
        const Sample sample = field.sample(at);
        if (!sample.inBand) return std::nullopt;
        return surfaceSampleAt(field, at, sample, dataOf(body.collider).isExactAt(at));
    };
    // at the height of the contact, since thin walls have another side deeper down
    const float rise = glm::dot(contact.normal, nearby - place);
    const auto here = sampleAt(place), there = sampleAt(nearby - rise * contact.normal);
    if (!here || !there) return std::nullopt;
    const auto inWorld = [&](const glm::vec3& normal) { return body.pose.rotation * normal; };
    if (!(glm::dot(inWorld(here->normal), contact.normal) > sameNormal)) return plane;
    const glm::vec3 normal = inWorld(there->normal);
    const float alike = glm::dot(normal, contact.normal);
    if (!(alike > likeNormal)) return std::nullopt;
    return SurfaceSample{contact.distance + body.scale * (there->distance - here->distance) + alike * rise, normal};
}

}  // namespace

/// The time in which a body rotates a point no farther than the contacts are known.
float PredictedContacts::maxSeconds(const SteppedBody& body, const glm::vec3& place) const {
    const float arm = glm::distance(place, body.centre);
    const float maxAngle = isSpeculative_ ? maxPredictedRotation : std::sqrt(2 * maxLift * sameWithin_ / arm);
    return maxAngle / glm::length(body.angular);  // infinite without rotation
}

std::optional<PredictedContact> PredictedContacts::predict(const Contact& contact) const {
    // contacts that touch stay where they are: behind a wheel, they would push it on
    if (contact.roundingRadius < 0 || contact.distance <= 0) return std::nullopt;
    const bool isOfB = contact.feature & featureOfB;
    const SteppedBody &own = isOfB ? b_ : a_, &other = isOfB ? a_ : b_;
    const glm::vec3 outward = isOfB ? -contact.normal : contact.normal;
    // the centre of the sphere that a vertex is rounded by rotates
    const float radius = contact.roundingRadius, height = contact.distance + radius;
    const glm::vec3 middle = contact.position + (isOfB ? radius : height) * outward;
    const glm::vec3 arm = middle - own.centre, otherArm = middle - other.centre;

    const float seconds = std::min({own.seconds, maxSeconds(own, middle), maxSeconds(other, middle)});
    const float displacement = seconds * glm::length(glm::cross(own.angular, arm)),
                otherDisplacement = seconds * glm::length(glm::cross(other.angular, otherArm));
    if (!(std::max(displacement, otherDisplacement) > minDisplacement * sameWithin_)) return std::nullopt;

    // Seen from the other body's centre, it moves along that body's surface; the solver handles the motion towards it.
    const glm::vec3 armAtEnd = rotated(arm, own.angular, seconds), relativeVelocity = own.linear - other.linear;
    const float separatingSpeed = glm::dot(outward, relativeVelocity);
    const glm::vec3 otherArmAtEnd =
        otherArm + armAtEnd - arm + seconds * (relativeVelocity - separatingSpeed * outward);
    const auto surface =
        surfaceAt(other, {height, outward}, middle, other.centre + rotated(otherArmAtEnd, other.angular, -seconds));
    if (!surface) return std::nullopt;
    const glm::vec3 normal = rotated(surface->normal, other.angular, seconds);
    const glm::vec3 ownAtEnd = own.centre + armAtEnd - radius * normal,
                    otherAtEnd = other.centre + otherArmAtEnd - surface->distance * normal;
    const float accounted = seconds * glm::dot(normal, own.velocityAt(ownAtEnd) - other.velocityAt(otherAtEnd)),
                remaining = surface->distance - radius + seconds * separatingSpeed - accounted;
    const float curvature = seconds * glm::length(own.angular) * displacement,
                earlyBy = std::min(maxEarly * sameWithin_, earlyFraction * curvature);
    const float distance = std::max(remaining - earlyBy, 0.f);
    if (isOfB) return PredictedContact{otherAtEnd, ownAtEnd, -normal, distance};
    return PredictedContact{ownAtEnd, otherAtEnd, normal, distance};
}

}  // namespace bilayer::detail
