// SPDX-License-Identifier: Apache-2.0
// The distance between two posed bodies, and the time at which moving bodies touch.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>

#include <bilayer/collider/contact.h>
#include <bilayer/collider/query.h>

namespace bilayer {

/// Options of distance().
struct DistanceOptions {
    /// The search ends early if the separation exceeds this [m] by more than 2e-6 of the size of the larger body.
    /// Zero finds only bodies that overlap or touch. A negative limit is zero.
    float maxDistance = std::numeric_limits<float>::infinity();
};

/// How two solids lie relative to each other.
enum class Overlap {
    none,      ///< they are separated, or touch
    surfaces,  ///< their surfaces intersect
    aInsideB,  ///< A, or a component of it, lies inside B, and the surfaces do not meet
    bInsideA,  ///< the same with B inside A
};

/// A point of a body's surface, and the mesh feature that it lies on.
struct WitnessPoint {
    glm::vec3 position{0};                ///< in world coordinates [m]
    std::uint32_t triangle = noTriangle;  ///< index in Collider::mesh(); `noTriangle`: not known
    Feature feature = Feature::face;      ///< of that triangle: its face, an edge or a corner
    std::uint8_t index = 0;               ///< of the edge (from corner `index` of the triangle to the next) or corner
};

/// The answer of distance().
struct BodyDistance {
    bool found = false;               ///< false: the separation exceeds the limit; the other members are invalid
    Overlap overlap = Overlap::none;  ///< whether and how they overlap
    /// Separation of the solids, or minus the penetration depth of the deepest contact [m].
    float distance = std::numeric_limits<float>::infinity();
    WitnessPoint a;  ///< on A: the closest point, or where the penetration is measured
    WitnessPoint b;  ///< the same on B
    /// Unit vector from B to A: moving A along it separates the bodies. Zero if touching bodies define none.
    glm::vec3 normal{0};
};

/// The triangles of the last answer for a pair of bodies. A search that starts from them is fast while bodies move
/// little from call to call; the distance is the same.
struct DistanceStart {
    std::uint32_t triangleA = noTriangle;  ///< index in Collider::mesh() of A; `noTriangle`: not known
    std::uint32_t triangleB = noTriangle;  ///< the same of B
};

/// The signed distance of two bodies at any separation, between their triangle meshes (Collider::mesh()).
///
/// - Separated bodies: the distance is exact to 1e-6 of the size of the larger body.
/// - Surfaces that intersect: the penetration depth of the surface point of one body that is deepest in the other, and
///   the normal there. A larger displacement may be needed to separate the bodies.
/// - One body inside the other: the same for the deepest surface point of the inner body.
///
/// Safe from any thread, allocates nothing. The first call for a body takes some time to prepare it. Throws
/// std::invalid_argument for a rotation that is no unit quaternion.
/// @param start  null, or where the search starts; receives the triangles of the answer
BodyDistance distance(const Placed& a, const Placed& b, const DistanceOptions& options = {},
                      DistanceStart* start = nullptr);

/// The same for two shapes, at least one of them a collider.
///
/// - A convex shape or a plane is solid. Separated shapes: the distance from the mesh of the collider is exact to 1e-6
///   of the sizes of both bodies.
/// - A shape that overlaps the collider: the depth of the deepest contact of collide(), and of the vertices of either
///   body. The vertices of a rounded shape are those of its core, as deep as its radius takes them.
/// - An open surface has no inside: a collider that its triangles do not cut is separated from it.
///
/// Allocates where the shapes overlap. Throws std::invalid_argument if neither is a collider, a scale is not positive,
/// or a rotation is no unit quaternion.
BodyDistance distance(const PlacedShape& a, const PlacedShape& b, const DistanceOptions& options = {},
                      DistanceStart* start = nullptr);

/// Options of timeOfImpact().
struct ImpactOptions {
    /// Bodies touch at this separation [m]. Smaller values than 1e-5 of the size of the larger body are raised to that.
    /// 0 stands for a twentieth of the smaller voxel.
    float tolerance = 0;
    /// Finds the first penetration instead of the first touch. Bodies may start in contact, and rest, slide and roll on
    /// each other; only penetration deeper than contacts handle is found. The tolerance has no effect.
    bool penetration = false;
};

/// The answer of timeOfImpact().
struct Impact {
    bool found = false;     ///< false: the bodies do not touch in the whole motion; the other members are invalid
    float fraction = 1;     ///< of the motion until they touch, in [0, 1]
    Pose poseA;             ///< of A then
    Pose poseB;             ///< of B then
    BodyDistance distance;  ///< of the bodies then: where they touch; of a penetration only its place and normal
};

/// When two bodies touch that move from their poses by their motions. Both motions take the same time; positions change
/// at constant velocities, and rotations about the pose positions at constant angular velocities.
///
/// The bodies do not touch before, whatever their speed and however thin they are. At the time found they are as near
/// as the tolerance, or touch: bodies that pass each other within the tolerance count as touching.
/// Bodies that are as near as the tolerance at the start, or overlap, touch at the start, in whatever direction they
/// move.
///
/// By conservative advancement (B. Mirtich, "Impulse-based dynamic simulation of rigid body systems", 1996): no point
/// approaches faster than the bodies' velocities and the rotations at their radii allow. Takes a distance() for each
/// step, most of which shorten the separation by a constant factor. A motion that takes more than 10,000 of them ends
/// there, as if the bodies touched: they slide along each other by 10,000 times their separation. Throws
/// std::invalid_argument for motions that are not finite, or rotate by more than 1000 rad, and for rotations that are
/// no unit quaternions.
///
/// With ImpactOptions::penetration, points of either body are followed along their paths through the other one: the
/// surface points of a collider, the vertices and edges of other shapes. A point penetrates where it gets more than a
/// third of the smaller voxel into the other body. One that starts in contact may get deeper by 0.02 to 0.1 voxels, the
/// less the deeper it starts. The bodies are then at most half a voxel before the place where it enters. No triangles
/// are needed; what passes between surface points is not seen.
Impact timeOfImpact(const Placed& a, const Placed& b, const ImpactOptions& options = {});

/// The same for two shapes, at least one of them a collider. Throws std::invalid_argument also if neither is, and for a
/// plane or an open surface that rotates and may be touched: its far points would have no finite speed.
Impact timeOfImpact(const PlacedShape& a, const PlacedShape& b, const ImpactOptions& options = {});

}  // namespace bilayer
