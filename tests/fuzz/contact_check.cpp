// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include <bilayer/collider/distance.h>
#include <bilayer/collider/shapes.h>
#include <bilayer/sdf/build.h>
#include "demos/shared/shapes.h"
#include "sdf/base/finite.h"
#include "tests/fuzz/byte_source.h"
#include "tests/fuzz/checks.h"

namespace bilayer::test {
namespace {

Collider colliderOf(const Mesh& mesh, ContactAccuracy accuracy) {
    return Collider(mesh, build(mesh, {.voxelSize = 0.1f}), {.accuracy = accuracy});
}

struct CollidedShapes {
    Collider box = colliderOf(shapes::box({0.5f, 0.3f, 0.2f}), ContactAccuracy::exactNearFeatures);
    Collider ball = colliderOf(shapes::sphere(0.4f, 2), ContactAccuracy::samples);
    Collider torus = colliderOf(shapes::torus(0.5f, 0.2f, 12, 8), ContactAccuracy::exact);
    std::vector<ContactShape> all{ContactShape(box),
                                  ContactShape(ball),
                                  ContactShape(torus),
                                  ContactShape::sphere(0.3f),
                                  ContactShape::box({0.2f, 0.3f, 0.4f}),
                                  ContactShape::capsule(0.2f, 0.3f),
                                  ContactShape::cylinder(0.2f, 0.3f),
                                  ContactShape::cone(0.3f, 0.4f),
                                  ContactShape::hull(shapes::sphere(0.3f, 1).points, 0.02f),
                                  ContactShape::plane({0.1f, 1, 0.2f}, 0.05f),
                                  ContactShape::triangles({[](const Bounds&, const auto& visitor) {
                                      visitor({glm::vec3(-1, 0, -1), glm::vec3(1, 0, 1), glm::vec3(1, 0, -1)}, 1);
                                      visitor({glm::vec3(-1, 0, -1), glm::vec3(-1, 0.2f, 1), glm::vec3(1, 0, 1)}, 2);
                                  }})};
};

/// Scales differ by at most this power of two: bodies of thousands of voxels along an edge take minutes.
constexpr float maxScalePower = 6;

/// Any quaternion, of unit length three times in four.
glm::quat rotationOf(ByteSource& bytes) {
    const glm::quat any = bytes.anyRotation();
    return bytes.byte() % 4 ? glm::normalize(any) : any;
}

bool isRefused(const PlacedShape& body) {
    return std::abs(glm::length(body.pose.rotation) - 1) > 2e-3f;
}

PlacedShape placed(const ContactShape& shape, ByteSource& bytes) {
    const std::uint8_t kind = bytes.byte();
    PlacedShape body{shape};
    if (kind & 1) body.pose.position = kind & 2 ? bytes.anyVector() : bytes.latticePoint();
    if (kind & 4) body.pose.rotation = rotationOf(bytes);
    if (kind & 16) body.scale = std::exp2(maxScalePower * bytes.lattice());
    if (kind & 64) body.motion = {bytes.anyVector(), bytes.anyVector()};
    return body;
}

bool isOrdinary(const PlacedShape& body) {
    return detail::isFinite(body.pose.position) && glm::length(body.pose.position) < 1e3f &&
           std::abs(glm::length(body.pose.rotation) - 1) < 1e-5f && body.scale > 1e-2f && body.scale < 1e2f &&
           detail::isFinite(body.motion.displacement) && detail::isFinite(body.motion.rotation) &&
           glm::length(body.motion.displacement) < 1e3f && glm::length(body.motion.rotation) < 10;
}

void requireContacts(const std::vector<Contact>& contacts) {
    for (const Contact& contact : contacts) {
        require(detail::isFinite(contact.position) && detail::isFinite(contact.normal) &&
                    std::isfinite(contact.distance) && std::isfinite(contact.approach),
                "a contact is not finite");
        require(std::abs(glm::length(contact.normal) - 1) < 1e-3f, "a contact's normal is not of unit length");
    }
}

void checkCollide(const PlacedShape& a, const PlacedShape& b, ByteSource& bytes, bool isJudged) {
    ContactOptions options;
    options.margin = bytes.flag() ? bytes.anyFloat() : 0.05f;
    options.exact = bytes.flag();
    options.reduced = bytes.flag();
    ContactCache cache;
    std::vector<Contact> first, again;
    collide(a, b, options, first, &cache);
    collide(a, b, options, again, &cache);
    if (!isJudged) return;
    requireContacts(first);
    // of reduced contacts, those of the last step are preferred
    if (!options.reduced) require(first.size() == again.size(), "a cache changes the count of contacts");
}

void checkDistance(const PlacedShape& a, const PlacedShape& b, bool isJudged) {
    const BodyDistance there = distance(a, b), back = distance(b, a);
    if (!isJudged) return;
    require(there.found && back.found, "two bodies have no distance");
    require(std::isfinite(there.distance) && detail::isFinite(there.a.position) && detail::isFinite(there.b.position),
            "a distance is not finite");
    const float length = glm::length(there.normal);
    require(std::abs(length - 1) < 1e-3f || length == 0, "a distance's normal is not of unit length");
    if (there.distance > 0 && back.distance > 0)
        require(std::abs(there.distance - back.distance) <= 1e-3f * (1 + there.distance),
                "the distance there is not that back");
}

void checkImpact(const PlacedShape& a, const PlacedShape& b, bool isJudged) {
    const Impact impact = timeOfImpact(a, b);
    if (!isJudged || !impact.found) return;
    require(impact.fraction >= 0 && impact.fraction <= 1, "an impact lies outside of the motion");
    require(detail::isFinite(impact.poseA.position) && detail::isFinite(impact.poseB.position),
            "an impact's pose is not finite");
}

}  // namespace

void checkContacts(Bytes numbers) {
    static const CollidedShapes shapes;
    ByteSource bytes(numbers);
    const unsigned colliders = 3, first = bytes.byte() % colliders, second = bytes.byte() % unsigned(shapes.all.size());
    const PlacedShape a = placed(shapes.all[first], bytes), b = placed(shapes.all[second], bytes);
    const bool isJudged = isOrdinary(a) && isOrdinary(b);
    const auto orRefused = [&](auto call) {
        try {
            call();
            require(!isRefused(a) && !isRefused(b), "a rotation that is no unit quaternion is accepted");
        } catch (const std::invalid_argument& error) {
            requirePlainError(error.what());
        }
    };
    orRefused([&] { checkCollide(a, b, bytes, isJudged); });
    orRefused([&] { checkCollide(b, a, bytes, isJudged); });
    orRefused([&] { checkDistance(a, b, isJudged); });
    orRefused([&] { checkImpact(a, b, isJudged); });
}

}  // namespace bilayer::test
