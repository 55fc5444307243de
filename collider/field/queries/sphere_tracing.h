// SPDX-License-Identifier: Apache-2.0
// Sphere casts against a mesh; internal. Empty space is crossed by sphere tracing (J. C. Hart, "Sphere tracing", The
// Visual Computer 12 (1996) 527-545). Near the mesh, each section of the path is tested against the triangles exactly.
// A sphere that grazes the surface thus takes no more steps than there are sections.
// Tested by tests/collider/field_rays.cpp through Field::sphereCast().
#pragma once

#include <algorithm>
#include <glm/geometric.hpp>
#include <limits>
#include <optional>

#include "collider/field/triangles/mesh_rays.h"

namespace bilayer::detail {

/// The first place of a path whose distance to a triangle is at most the radius, to 1e-7 voxels. Intended for paths of
/// a few voxels: it tests all triangles near the path, so its cost grows with the length.
std::optional<MeshHit> castSphere(const MeshTree& mesh, const Path& path, double radius) noexcept;

/// The first contact of a swept sphere with a mesh.
struct SphereHit {
    double along;         ///< distance along the centre's path [m]
    glm::dvec3 position;  ///< on the triangle [m]
    glm::dvec3 normal;    ///< from there to the centre, of unit length
    std::uint32_t triangle;
};

/// The first contact on a path of any length.
/// @param radius       [m], positive; the sphere touches nothing at the start
/// @param clearanceAt  (const glm::dvec3&) -> lower bound of the distance to the mesh; not positive where unknown [m]
template <class ClearanceAt>
std::optional<SphereHit> castSphereFar(const MeshTree& mesh, const Path& path, double radius,
                                       const ClearanceAt& clearanceAt) {
    // section length [voxels], and the max count of sections
    constexpr double pieceLength = 2, maxPieces = 4096;
    // search distance for the nearest triangle, beyond the sphere [sections]
    constexpr double lookAhead = 4;
    // absolute [voxels] and relative error of the nearest triangle's distance
    constexpr double nearestSlack = 1e-4, nearestRounding = 2e-6;

    const auto [lower, upper] = mesh.box();
    const auto section = sectionIn(path, lower - radius, upper + radius);
    if (!section) return std::nullopt;
    const double voxel = mesh.voxelSize(), length = section->path.length;
    const double piece = std::max(pieceLength * voxel, length / maxPieces), reach = lookAhead * piece;
    const auto freeDistance = [&](const glm::dvec3& centre) {
        const double known = clearanceAt(centre) - radius - nearestSlack * voxel;
        if (known >= reach) return known;
        const std::uint32_t triangle = mesh.nearest(centre, float((radius + reach) / voxel));
        if (triangle == noTriangle) return reach;
        const double distance = glm::length(mesh.featureOf(triangle, centre).offset);
        return distance * (1 - nearestRounding) - radius - nearestSlack * voxel;
    };
    for (double along = 0; along <= length;) {
        const double free = freeDistance(section->path.at(along));
        if (free > piece) {
            along += free;
            continue;
        }
        const Path next{section->path.at(along), path.direction, std::min(piece, length - along)};
        if (auto hit = castSphere(mesh, next, radius)) {
            const glm::dvec3 centre = next.at(hit->along), from = mesh.approached(centre);
            // from so far away several triangles may be equally near: take the nearest one
            if (from != centre) {
                hit->triangle = mesh.nearest(from, std::numeric_limits<float>::infinity());
                hit->position = from + mesh.featureOf(hit->triangle, from).offset;
            }
            return SphereHit{section->from + along + hit->along, hit->position, glm::normalize(centre - hit->position),
                             hit->triangle};
        }
        along += piece;
    }
    return std::nullopt;
}

}  // namespace bilayer::detail
