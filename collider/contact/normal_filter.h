// The filter of contacts by their normals.
#pragma once

#include <bilayer/collider/contact.h>
#include <algorithm>
#include <glm/geometric.hpp>

namespace bilayer::detail {

/// Whether a contact passes, by the cosine between the reversed surface normal and the point's normal.
/// @param apart  the point belongs to a face and does not touch yet
inline bool keeps(const ContactOptions& options, float cosine, bool apart) {
    return cosine >=
           (apart ? std::max(options.minNormalCosineApart, options.minNormalCosine) : options.minNormalCosine);
}
/// The same for a point that rotates with its body. The contact passes if the point opposes the surface at the start,
/// the middle or the end of the step.
/// @param seen, normal  outward normals of the surface and of the point
/// @param turn          rotation in the step relative to the surface [rad]
inline bool keeps(const ContactOptions& options, const glm::vec3& seen, const glm::vec3& normal, const glm::vec3& turn,
                  bool apart) {
    const auto isKept = [&](float part) {
        return keeps(options, -glm::dot(seen, glm::normalize(normal + part * glm::cross(turn, normal))), apart);
    };
    return isKept(0) || (turn != glm::vec3(0) && (isKept(0.5f) || isKept(1)));
}

}  // namespace bilayer::detail
