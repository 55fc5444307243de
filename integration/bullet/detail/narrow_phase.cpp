// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/narrow_phase.h"
#include <bilayer/collider/contact.h>
#include "collider/contact/collider_data.h"
#include "collider/contact/sampled_contacts.h"

#include <algorithm>
#include <glm/geometric.hpp>

#include "integration/bullet/detail/local_field.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

namespace {

// Feature number of the lowest vertex over a plane, for contact tests: no surface point or edge has it.
constexpr std::uint32_t lowestVertex = featureOfB - 1;

}  // namespace

ContactReport collideFields(const Placed& a, const Placed& b, float margin, bool exact, ContactCache& cache,
                            std::vector<Contact>& contacts) {
    ContactOptions options;
    options.margin = margin;
    options.exact = exact;
    // a contact test needs the distance of the bodies for any direction of their normals
    if (exact) {
        options.minNormalCosineApart = options.minNormalCosine;
        options.keepsObliqueEdges = true;
    }
    return collide(a, b, options, contacts, &cache);
}

ContactReport collideFields(const Placed& a, const Placed& b, float margin, std::span<const FoundPoint> ofA,
                            std::span<const FoundPoint> ofB, std::vector<Contact>& contacts) {
    ContactOptions options;
    options.margin = margin;
    return collideFound(a, b, options, ofA, ofB, contacts);
}

ContactReport collidePlane(const glm::vec3& normal, float offset, const Motion& motion, const Placed& field,
                           float margin, bool exact, std::vector<Contact>& contacts) {
    ContactReport report;
    // The plane in the collider's own coordinates.
    const glm::vec3 up = glm::conjugate(field.pose.rotation) * normal;
    const float height = (offset - glm::dot(normal, field.pose.position)) / field.scale;
    const float reach = margin / field.scale;
    const LocalField local(field, {}, motion, margin, false);
    const auto above = [&](const glm::vec3& point) { return glm::dot(up, point) - height; };
    const auto reject = [&](const glm::vec3& centre, float radius) {
        return above(centre) - radius > reach + local.maxDisplacement() / field.scale;
    };
    field.collider.data().points().visit(reject, [&](std::uint32_t index, const SurfacePoint& point) {
        ++report.pointsTested;
        const float distance = above(point.position);
        // the points of the plane approach this one
        const float approach = local.approach(field.scale * point.position, -up, margin) / field.scale;
        if (distance > std::max(reach, approach)) return;
        const glm::vec3 position = field.pose.toWorld(field.scale * point.position);
        contacts.push_back({position, -normal, field.scale * distance, index | featureOfB, field.scale * approach, 0});
    });
    if (!exact || !field.collider.data().body.mesh) return report;
    const auto& vertices = field.collider.data().body.mesh->points;
    const auto isLower = [&](const glm::vec3& a, const glm::vec3& b) { return above(a) < above(b); };
    const auto lowest = std::min_element(vertices.begin(), vertices.end(), isLower);
    if (above(*lowest) <= reach)
        contacts.push_back({field.pose.toWorld(field.scale * *lowest), -normal, field.scale * above(*lowest),
                            lowestVertex | featureOfB, 0});
    return report;
}

}  // namespace bilayer::bullet::detail
