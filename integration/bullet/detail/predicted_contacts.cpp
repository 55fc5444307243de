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

// What goes no farther than this by its body's turn is left where it is [parts of the distance within which contacts
// are the same].
constexpr float hardlyTurned = 0.05f;
// Bodies are looked at after a turn of this at most [rad]. Where they are not swept, the points that take over are
// known only up to a margin: a turn then takes none off the surface by more than this [parts of that distance].
constexpr float maxRotation = 0.5f, turnsOff = 0.25f;
// It is met a bit too early: else the points around the lowest one of a wheel get in by what a step is off, and throw
// it up when they touch [parts of the bend of their ways], at most [parts of that distance].
constexpr float earlier = 0.1f, maxEarly = 0.05f;
// Where a field looks another way than a contact by more than this cosine tells, it says nothing about it: that is one
// of an edge.
constexpr float sameNormal = 0.95f;
// and where it looks another way there by more than this, that is another face.
constexpr float likeNormal = 0.8f;

btVector3 turned(const btVector3& arm, const btVector3& spin, float seconds) {
    const float speed = spin.length();
    return speed * seconds != 0 ? arm.rotate(spin / speed, speed * seconds) : arm;
}

/// The surface of a body at a place near it.
struct Surface {
    btVector3 normal;
    float distance;
};

/// That of a contact at some place, seen from another one nearby: by the field's samples, or as a plane.
std::optional<Surface> surfaceAt(const Side& side, const Surface& contact, const btVector3& place,
                                 const btVector3& nearby) {
    const Surface plane{contact.normal, contact.distance + contact.normal.dot(nearby - place)};
    if (!isField(*side.shape)) return plane;
    const Placed body = side.placed();
    const Field& field = body.collider.field();
    const auto touchAt = [&](const btVector3& point) -> std::optional<SurfaceSample> {
        const glm::vec3 at = body.pose.toBody(toGlm(point)) / body.scale;
        const Sample sample = field.sample(at);
        if (!sample.inBand) return std::nullopt;
        return surfaceSampleAt(field, at, sample, body.collider.data().isExactAt(at));
    };
    // as high as the contact, since deeper down thin walls have another side
    const float rise = contact.normal.dot(nearby - place);
    const auto here = touchAt(place), there = touchAt(nearby - rise * contact.normal);
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

/// In which a body turns a place by no more than is known of what comes after.
float PredictedContacts::maxSeconds(const Body& body, const btVector3& place) const {
    const float arm = (place - body.velocity.centre).length();
    const float most = continuity_.isSwept ? maxRotation : std::sqrt(2 * turnsOff * continuity_.sameWithin / arm);
    return most / body.velocity.angular.length();  // infinite where nothing turns
}

std::optional<PredictedContact> PredictedContacts::ahead(const Contact& contact) const {
    // what touches is where it is: put behind a wheel, it would push it on
    if (contact.turningRadius < 0 || contact.distance <= 0) return std::nullopt;
    const bool isOfB = contact.feature & featureOfB;
    const Body &own = isOfB ? b_ : a_, &other = isOfB ? a_ : b_;
    const Velocity &velocity = own.velocity, &its = other.velocity;
    const btVector3 fromB = toBullet(contact.normal), outward = isOfB ? -fromB : fromB;
    // what turns is the middle of the ball that a corner is rounded by
    const float radius = contact.turningRadius, height = contact.distance + radius;
    const btVector3 onB = toBullet(contact.position), middle = onB + (isOfB ? radius : height) * outward;
    const btVector3 arm = middle - velocity.centre, itsArm = middle - its.centre;

    const float seconds = std::min({own.side.seconds, maxSeconds(own, middle), maxSeconds(other, middle)});
    const float way = seconds * velocity.angular.cross(arm).length(),
                itsWay = seconds * its.angular.cross(itsArm).length();
    if (!(std::max(way, itsWay) > hardlyTurned * continuity_.sameWithin)) return std::nullopt;

    // From the other body's centre it goes along that one's surface; towards it, that is the solver's business.
    const btVector3 armThen = turned(arm, velocity.angular, seconds), passing = velocity.linear - its.linear;
    const float leaving = outward.dot(passing);
    const btVector3 itsArmThen = itsArm + armThen - arm + seconds * (passing - leaving * outward);
    const auto surface =
        surfaceAt(other.side, {outward, height}, middle, its.centre + turned(itsArmThen, its.angular, -seconds));
    if (!surface) return std::nullopt;
    const btVector3 normal = turned(surface->normal, its.angular, seconds);
    const btVector3 ownThen = velocity.centre + armThen - radius * normal,
                    otherThen = its.centre + itsArmThen - surface->distance * normal;
    const float seen = seconds * normal.dot(velocity.at(ownThen) - its.at(otherThen)),
                left = surface->distance - radius + seconds * leaving - seen;
    const float bend = seconds * velocity.angular.length() * way,
                early = std::min(maxEarly * continuity_.sameWithin, earlier * bend);
    const float distance = std::max(left - early, 0.f);
    if (isOfB) return PredictedContact{otherThen, ownThen, -normal, distance};
    return PredictedContact{ownThen, otherThen, normal, distance};
}

}  // namespace bilayer::bullet::detail
