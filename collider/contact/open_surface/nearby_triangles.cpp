// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/open_surface/nearby_triangles.h"

#include <bilayer/collider/contact.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <limits>

#include "collider/contact/search/edge_contacts.h"
#include "collider/contact/shapes/nearest_on_triangle.h"
#include "sdf/base/hash.h"

namespace bilayer::detail {

void NearbyTriangles::add(const Triangle& triangle, std::uint64_t id) {
    const Triangle corners{inField_.toWorld(triangle[0]), inField_.toWorld(triangle[1]), inField_.toWorld(triangle[2])};
    if (!isFinite(corners)) return;
    const glm::vec3 middle = (corners[0] + corners[1] + corners[2]) / 3.f;
    float radius = 0;
    for (int i = 0; i < 3; ++i) radius = std::max(radius, glm::distance(corners[i], middle));
    if (!(field_.local.at(middle).distance <= radius + field_.maxTriangleDistance() + field_.spacing)) return;
    triangles_.push_back(corners);
    ids_.push_back(splitMix64(id));
}

float NearbyTriangles::distance(const glm::vec3& place) const {
    float minDistance = std::numeric_limits<float>::max();
    for (const Triangle& corners : triangles_) {
        const glm::vec3 nearest = nearestOnTriangle(place, corners[0], corners[1], corners[2]);
        minDistance = std::min(minDistance, glm::distance(nearest, place));
    }
    return minDistance;
}

std::uint32_t NearbyTriangles::featureOf(std::uint64_t triangle, std::uint32_t part) {
    constexpr std::uint32_t count = featureOfB - (2u << probeBits);
    return std::uint32_t(splitMix64(triangle ^ part) % count);
}

}  // namespace bilayer::detail
