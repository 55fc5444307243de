// SPDX-License-Identifier: Apache-2.0
// Contacts between two shapes, one of them a collider.
#include "collider/contact/shape_contacts.h"

#include <bilayer/collider/contact.h>

#include <fmt/format.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <stdexcept>
#include <variant>

#include "collider/contact/open_surface/triangle_contacts.h"
#include "collider/contact/reduction/contact_reduction.h"
#include "collider/contact/reduction/finite_contacts.h"
#include "collider/contact/search/convex_contacts.h"
#include "collider/contact/search/half_space_contacts.h"
#include "collider/contact/shapes/placed_shapes.h"
#include "collider/contact/shapes/shape_data.h"
#include "sdf/base/access.h"
#include "sdf/base/unit_tolerance.h"

namespace bilayer {

using namespace detail;

namespace {

/// The world in units of a length.
struct Units {
    float length;

    Pose into(const Pose& pose) const { return {pose.position / length, pose.rotation}; }
    Motion into(const Motion& motion) const { return {motion.displacement / length, motion.rotation}; }
    Placed into(const Placed& body) const {
        return {body.collider, into(body.pose), body.scale / length, into(body.motion)};
    }
};

HalfSpace inWorld(const HalfSpace& solid, const Pose& pose) {
    const glm::vec3 normal = pose.rotation * solid.normal;
    return {normal, solid.offset + glm::dot(normal, pose.position)};
}

/// The contact as seen with the bodies in the other order.
Contact swappedContact(Contact contact) {
    contact.position += contact.distance * contact.normal;
    contact.normal = -contact.normal;
    contact.feature ^= featureOfB;
    return contact;
}

}  // namespace

/// Contacts are found in units of the shape's scale, in which the shape has its own size.
ContactReport detail::collideShape(const PlacedShape& a, const Placed& b, const ContactOptions& asked,
                                   std::vector<Contact>& contacts) {
    ContactOptions options = asked;
    const Units units{a.scale};
    const Placed field = units.into(b);
    const Pose pose = units.into(a.pose);
    const Motion motion = units.into(a.motion);
    options.margin /= units.length;
    const std::size_t first = contacts.size();
    ContactReport report;
    const auto& shape = dataOf(a.shape).shape;
    if (const auto* convex = std::get_if<Convex>(&shape))
        report = collideConvex(*convex, pose, motion, field, options, contacts);
    else if (const auto* solid = std::get_if<HalfSpace>(&shape))
        report = collideHalfSpace(inWorld(*solid, pose), motion.about(pose.position, glm::vec3(0)), field, options,
                                  contacts);
    else
        report = collideTriangles(std::get<OpenSurface>(shape), pose, motion, field, options, contacts);
    for (std::size_t i = first; i < contacts.size(); ++i) {
        Contact& contact = contacts[i];
        contact.position *= units.length;
        contact.distance *= units.length;
        contact.approach *= units.length;
        if (contact.roundingRadius > 0) contact.roundingRadius *= units.length;
    }
    return report;
}

void detail::requireUnitRotation(const Pose& pose) {
    const float length = glm::length(pose.rotation);
    if (std::abs(length - 1) > unitTolerance)
        throw std::invalid_argument(
            fmt::format("the rotation of a pose must be a unit quaternion, and has the length {:g}", length));
}

Order detail::orderOf(const PlacedShape& a, const PlacedShape& b) {
    for (const PlacedShape* body : {&a, &b}) {
        if (!(body->scale > 0) || !std::isfinite(body->scale))
            throw std::invalid_argument("the scale of a shape must be positive and finite");
        requireUnitRotation(body->pose);
    }
    const bool isA = a.shape.collider(), isB = b.shape.collider();
    if (!isA && !isB) throw std::invalid_argument("at least one of the two shapes must be a collider");
    return {isA && isB, isA};
}

ContactReport collide(const PlacedShape& a, const PlacedShape& b, const ContactOptions& options,
                      std::vector<Contact>& contacts, ContactCache* cache) {
    const Order order = orderOf(a, b);
    if (order.both) return collide(placed(a), placed(b), options, contacts, cache);
    const std::size_t first = contacts.size();
    const ContactReport report =
        order.isSwapped ? collideShape(b, placed(a), options, contacts) : collideShape(a, placed(b), options, contacts);
    if (order.isSwapped)
        for (std::size_t i = first; i < contacts.size(); ++i) contacts[i] = swappedContact(contacts[i]);
    removeNonFinite(contacts, first);
    if (options.reduced) reduceFrom(first, contacts, a.pose, b.pose, relativeRotation(a.motion, b.motion), cache);
    return report;
}

}  // namespace bilayer
