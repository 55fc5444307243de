// Spheres on their way until they touch a mesh; internal. Through what is empty they go in strides, as J. C. Hart,
// "Sphere tracing", The Visual Computer 12 (1996) 527-545; what may be touched within the next piece of the way is
// looked at triangle by triangle, so that a sphere that grazes the surface takes no more steps than there are pieces.
#pragma once

#include <algorithm>
#include <glm/geometric.hpp>
#include <limits>
#include <optional>

#include "collider/field/mesh_rays.h"

namespace bilayer::detail {

/// Where a sphere touches a mesh.
struct SphereTouch {
    double along;         ///< the path of its centre [m]
    glm::dvec3 position;  ///< on the triangle [m]
    glm::dvec3 normal;    ///< from there to the centre, of unit length
    std::uint32_t triangle;
};

/// The first one on a path of any length.
/// @param radius       [m], positive; the sphere touches nothing at the start
/// @param clearanceAt  (const glm::dvec3&) -> how far the mesh is at least; not positive where that is not known [m]
template <class ClearanceAt>
std::optional<SphereTouch> firstTouchOnWay(const MeshTree& mesh, const Path& path, double radius,
                                           const ClearanceAt& clearanceAt) {
    // pieces [voxels], and no more than so many of them
    constexpr double pieceLength = 2, maxPieces = 4096;
    // the nearest triangle is looked for no farther than this away from the sphere [pieces]
    constexpr double lookAhead = 4;
    // what it may be off by [voxels], and as a part of its distance
    constexpr double nearestSlack = 1e-4, nearestRounding = 2e-6;

    const auto [lower, upper] = mesh.box();
    const auto part = partIn(path, lower - radius, upper + radius);
    if (!part) return std::nullopt;
    const double voxel = mesh.voxelSize(), length = part->path.length;
    const double piece = std::max(pieceLength * voxel, length / maxPieces), reach = lookAhead * piece;
    const auto freeWay = [&](const glm::dvec3& centre) {
        const double known = clearanceAt(centre) - radius - nearestSlack * voxel;
        if (known >= reach) return known;
        const std::uint32_t triangle = mesh.nearest(centre, float((radius + reach) / voxel));
        if (triangle == noTriangle) return reach;
        const double distance = glm::length(mesh.featureOf(triangle, centre).way);
        return distance * (1 - nearestRounding) - radius - nearestSlack * voxel;
    };
    for (double along = 0; along <= length;) {
        const double free = freeWay(part->path.at(along));
        if (free > piece) {
            along += free;
            continue;
        }
        const Path next{part->path.at(along), path.direction, std::min(piece, length - along)};
        if (auto hit = firstTouch(mesh, next, radius)) {
            const glm::dvec3 centre = next.at(hit->along), from = mesh.approached(centre);
            // of triangles that are equally near to a centre so far away, the nearest
            if (from != centre) {
                hit->triangle = mesh.nearest(from, std::numeric_limits<float>::infinity());
                hit->position = from + mesh.featureOf(hit->triangle, from).way;
            }
            return SphereTouch{part->from + along + hit->along, hit->position, glm::normalize(centre - hit->position),
                               hit->triangle};
        }
        along += piece;
    }
    return std::nullopt;
}

}  // namespace bilayer::detail
