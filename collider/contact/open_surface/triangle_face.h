// SPDX-License-Identifier: Apache-2.0
// The face of a triangle: its plane, and where points are over it.
// Tested by tests/bullet/sliding.cpp through bullet::Dispatcher.
#pragma once

#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <optional>

#include "collider/contact/body/surface_points.h"
#include "collider/contact/open_surface/open_surface.h"

namespace bilayer::detail {

/// Triangles whose conormals enclose more than 179.9 degrees (cosine) are coplanar, without an edge between them.
inline constexpr float flatEdge = -0.9999985f;

struct TriangleFace {
    Triangle corners;
    std::array<glm::vec3, 3> outwards;
    /// At an edge that is a crease: along the other triangle, out of it across the edge. Nothing at flat edges and at
    /// borders.
    std::array<std::optional<glm::vec3>, 3> outwardsOfOthers;
    glm::vec3 up;

    /// The face of a triangle, without its neighbours; nothing for a triangle without area.
    static std::optional<TriangleFace> of(const Triangle& corners) {
        const glm::vec3 square = glm::cross(corners[1] - corners[0], corners[2] - corners[0]);
        const float area = glm::length(square);
        if (!(area > 0)) return std::nullopt;
        TriangleFace face{corners, {}, {}, square / area};
        for (int i = 0; i < 3; ++i)
            face.outwards[i] = glm::normalize(glm::cross(corners[(i + 1) % 3] - corners[i], square));
        return face;
    }

    void findNeighbours(const Adjacency& adjacency, std::uint32_t triangle) {
        for (int i = 0; i < 3; ++i) {
            const auto neighbour = adjacency.neighbourOf(triangle, i);
            if (neighbour && glm::dot(*neighbour, outwards[i]) < -flatEdge) outwardsOfOthers[i] = -*neighbour;
        }
    }

    /// Whether a point is farther than this beyond the edges.
    bool isOutside(const glm::vec3& place, float distance) const {
        for (int i = 0; i < 3; ++i)
            if (glm::dot(outwards[i], place - corners[i]) > distance) return true;
        return false;
    }
    /// The same, but not for a point below a crease and over neither triangle: it has passed both.
    bool isOutsideAboveCreases(const glm::vec3& place, float distance) const {
        for (int i = 0; i < 3; ++i) {
            const glm::vec3 offset = place - corners[i];
            if (glm::dot(outwards[i], offset) > distance &&
                !(outwardsOfOthers[i] && isBelowCrease(i, offset, distance)))
                return true;
        }
        return false;
    }
    /// The normal on the side that a surface point faces.
    glm::vec3 normalFacing(const SurfacePoint& point) const { return glm::dot(up, point.normal) < 0 ? -up : up; }
    float heightOf(const glm::vec3& place) const { return std::abs(glm::dot(up, place - corners[0])); }

  private:
    bool isBelowCrease(int edge, const glm::vec3& offset, float distance) const {
        const glm::vec3& outward = *outwardsOfOthers[edge];
        const float rise = -glm::dot(outward, up);
        return glm::dot(outward, offset) > -distance && std::copysign(1.f, rise) * glm::dot(up, offset) < distance;
    }
};

}  // namespace bilayer::detail
