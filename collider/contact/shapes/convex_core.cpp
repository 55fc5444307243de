// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/shapes/convex_core.h"

#include <algorithm>
#include <glm/geometric.hpp>

#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

glm::vec3 ConvexCore::support(const glm::vec3& direction) const {
    return *std::max_element(vertices_.begin(), vertices_.end(), [&](const glm::vec3& a, const glm::vec3& b) {
        return glm::dot(direction, a) < glm::dot(direction, b);
    });
}

glm::vec3 ConvexCore::place(const ConvexEdge& edge, float fraction) const {
    const glm::vec3 &from = vertices_[edge.from], &to = vertices_[edge.to];
    return from + fraction * (to - from);
}

float ConvexCore::tolerance(float growth) const {
    constexpr float roundings = 1e-6f;  // of the diagonal of the body's bounding box
    Bounds box;
    for (const glm::vec3& vertex : vertices_) {
        box.add(vertex - growth);
        box.add(vertex + growth);
    }
    return roundings * glm::length(box.size());
}

}  // namespace bilayer::detail
