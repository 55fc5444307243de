// SPDX-License-Identifier: Apache-2.0
// Contacts between a field and a half-space.
#include "collider/contact/search/half_space_contacts.h"

#include <bilayer/collider/contact.h>

#include <algorithm>
#include <glm/geometric.hpp>

#include "collider/contact/body/collider_data.h"
#include "collider/contact/search/local_field.h"
#include "sdf/base/access.h"

namespace bilayer::detail {

namespace {

// Feature number of the lowest vertex over a plane, for exact contacts: no surface point or edge has it.
constexpr std::uint32_t lowestVertex = featureOfB - 1;

}  // namespace

ContactReport collideHalfSpace(const HalfSpace& solid, const Motion& motion, const Placed& field,
                               const ContactOptions& options, std::vector<Contact>& contacts) {
    const glm::vec3& normal = solid.normal;
    const float margin = options.margin;
    ContactReport report;
    // The plane in the collider's own coordinates.
    const glm::vec3 up = glm::conjugate(field.pose.rotation) * normal;
    const float height = (solid.offset - glm::dot(normal, field.pose.position)) / field.scale;
    const float reach = margin / field.scale;
    const LocalField local(field, {}, motion, margin, false);
    const auto above = [&](const glm::vec3& point) { return glm::dot(up, point) - height; };
    const auto reject = [&](const glm::vec3& centre, float radius) {
        return above(centre) - radius > reach + local.maxDisplacement() / field.scale;
    };
    dataOf(field.collider).points().visit(reject, [&](std::uint32_t index, const SurfacePoint& point) {
        ++report.pointsTested;
        const float distance = above(point.position);
        // the points of the plane approach this one
        const float approach = local.approach(field.scale * point.position, -up, margin) / field.scale;
        if (distance > std::max(reach, approach)) return;
        const glm::vec3 position = field.pose.toWorld(field.scale * point.position);
        contacts.push_back({position, -normal, field.scale * distance, index | featureOfB, field.scale * approach, 0});
    });
    if (!options.exact || !dataOf(field.collider).body.mesh) return report;
    const auto& vertices = dataOf(field.collider).body.mesh->points;
    const auto isLower = [&](const glm::vec3& a, const glm::vec3& b) { return above(a) < above(b); };
    const auto lowest = std::min_element(vertices.begin(), vertices.end(), isLower);
    if (above(*lowest) <= reach)
        contacts.push_back({field.pose.toWorld(field.scale * *lowest), -normal, field.scale * above(*lowest),
                            lowestVertex | featureOfB, 0});
    return report;
}

}  // namespace bilayer::detail
