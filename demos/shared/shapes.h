// SPDX-License-Identifier: Apache-2.0
// Closed, oriented meshes by formula for demos, tests and benchmarks. Lengths are in metres, centred on the origin.
#pragma once

#include <cstddef>
#include <glm/vec2.hpp>
#include <vector>

#include <bilayer/sdf/mesh.h>

namespace bilayer::shapes {

/// Count of triangles of the circular box in Wu, Man, Xie (2014): 1369.77 K, where K is 1024.
inline constexpr std::size_t paperCircularBox = 1402644;

/// A box with 12 * cells^2 triangles.
Mesh box(const glm::vec3& halfExtents, int cells = 1);

/// An icosahedron subdivided `levels` times, with vertices on the sphere: 20 * 4^levels triangles.
Mesh sphere(float radius, int levels = 4);

/// A torus around z: `major` from the axis to the tube's centre, `minor` the tube's radius.
Mesh torus(float major, float minor, int around = 96, int across = 48);

/// A tube of radius `thickness` along the (p, q) torus knot around z: the p = 2, q = 3 knot is the trefoil.
Mesh torusKnot(int p, int q, float radius, float thickness, int along = 600, int across = 32);

/// The solid of revolution of a profile (radius >= 0, height) around z. The profile runs counter-clockwise, with the
/// radius to the right and the height up. Points of radius 0 become poles.
Mesh revolve(const std::vector<glm::vec2>& profile, int segments = 96);

/// A solid cylinder and a solid cone around z, from -height / 2 to height / 2 (apex on top).
Mesh cylinder(float radius, float height, int segments = 96);
Mesh cone(float radius, float height, int segments = 96);

/// An open bowl around z with a round rim: a spherical shell of outer radius `radius` and thickness `wall` that opens
/// upward. The centre of the sphere is the origin.
/// @param opening  angle between the bottom and the rim at the sphere's centre [rad]; a hemisphere by default
/// @param foot     radius of a flat solid foot below it, half a wall high; 0: no foot
Mesh bowl(float radius, float wall, int segments = 128, float opening = 1.57079633f, float foot = 0);

/// A round box with a lid, carved all over with a relief that repeats around z. It replaces the circular box of Wu,
/// Man, Xie (2014), which is not public. Its triangles have similar sizes. It is free of self-intersections for any
/// count of triangles: the top is a height field above the rim, and each horizontal slice of the wall is star-shaped.
/// @param triangles  approximate count: within 2 % from 10^4 on
/// @param radius     of the lid; the box is 1.28 times as high
/// Throws std::invalid_argument for fewer than 100 triangles.
Mesh carvedBox(std::size_t triangles = paperCircularBox, float radius = 1);

/// Approximate count of triangles of the sphere of Table 5 in Wu, Man, Xie (2014): 3.21 K, which is 3,288 there.
inline constexpr std::size_t paperSphere = 3210;

/// A unit sphere of triangles with similar shapes and different areas. A uniform sphere is transformed by a Moebius
/// map, which preserves angles, so that triangles are small around one pole and large around the other.
/// @param triangles  exact count; even, at least 100
/// @param deviation  standard deviation of their areas [m^2]
/// Throws std::invalid_argument for too few triangles, and for a deviation that no such map reaches.
Mesh unevenSphere(float deviation, std::size_t triangles = paperSphere);

/// A translated mesh, and a mesh with reversed orientation.
Mesh moved(Mesh mesh, const glm::vec3& by);
Mesh flipped(Mesh mesh);

/// Several meshes merged into one.
Mesh join(const std::vector<Mesh>& meshes);

}  // namespace bilayer::shapes
