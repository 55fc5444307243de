// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/nearby_triangles.h"

#include <bilayer/collider/contact.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <limits>

#include "collider/contact/edge_contacts.h"
#include "collider/contact/nearest_on_triangle.h"

namespace bilayer::detail {

namespace {

/// Hashes a number over all bits (S. Vigna's SplitMix64).
std::uint64_t mixed(std::uint64_t bits) {
    bits += 0x9e3779b97f4a7c15u;
    bits = (bits ^ bits >> 30) * 0xbf58476d1ce4e5b9u;
    bits = (bits ^ bits >> 27) * 0x94d049bb133111ebu;
    return bits ^ bits >> 31;
}

}  // namespace

void NearbyTriangles::add(const Triangle& triangle, std::uint64_t id) {
    const Triangle corners{inField_.toWorld(triangle[0]), inField_.toWorld(triangle[1]), inField_.toWorld(triangle[2])};
    if (!isFinite(corners)) return;
    const glm::vec3 middle = (corners[0] + corners[1] + corners[2]) / 3.f;
    float radius = 0;
    for (int i = 0; i < 3; ++i) radius = std::max(radius, glm::distance(corners[i], middle));
    if (!(field_.local.at(middle).distance <= radius + field_.maxTriangleDistance() + field_.spacing)) return;
    triangles_.push_back(corners);
    ids_.push_back(mixed(id));
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
    return std::uint32_t(mixed(triangle ^ part) % count);
}

}  // namespace bilayer::detail
