// Which contacts are kept by the directions of their normals.
#pragma once

#include <bilayer/collider/contact.h>
#include <algorithm>
#include <glm/geometric.hpp>

namespace bilayer::detail {

/// Whether a contact is kept that looks against its point's normal by this cosine.
/// @param apart  its point is of a face that does not touch yet
inline bool keeps(const ContactOptions& options, float cosine, bool apart) {
    return cosine >=
           (apart ? std::max(options.minNormalCosineApart, options.minNormalCosine) : options.minNormalCosine);
}
/// The same where the point turns with its body, and looks against the surface now, later or in between.
/// @param seen, normal  of the surface, outward, and of the point
/// @param turn          in the step, as the surface sees it [rad]
inline bool keeps(const ContactOptions& options, const glm::vec3& seen, const glm::vec3& normal, const glm::vec3& turn,
                  bool apart) {
    const auto isKept = [&](float part) {
        return keeps(options, -glm::dot(seen, glm::normalize(normal + part * glm::cross(turn, normal))), apart);
    };
    return isKept(0) || (turn != glm::vec3(0) && (isKept(0.5f) || isKept(1)));
}

}  // namespace bilayer::detail
