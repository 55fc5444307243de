// SPDX-License-Identifier: Apache-2.0
// Machine parts by formula, for bodies that fit into each other: pegs, poles, chains; threads.h and gears.h hold the
// others. The meshes are closed, oriented, free of self-intersections, and have well-shaped triangles. Lengths are in
// metres. Round outer surfaces are inscribed and round inner surfaces circumscribed, so that facets never reduce a
// clearance: it is the given one, or wider by at most the sagitta of a chord of each part. Invalid dimensions throw
// std::invalid_argument.
#pragma once

#include <vector>

#include <bilayer/collider/pose.h>
#include <bilayer/sdf/mesh.h>

namespace bilayer::shapes {

/// A round peg with 45 degree chamfers: around z, from -length / 2 to length / 2.
struct Peg {
    float diameter = 8e-3f;     ///< of the matching hole [m]
    float clearance = 0.1e-3f;  ///< diametral clearance: hole minus shaft, as in ISO 286-1 [m]
    float length = 50e-3f;      ///< [m]
    float chamfer = 0.5e-3f;    ///< [m]
    int segments = 96;          ///< edges per circle, a multiple of 24
};
Mesh peg(const Peg& part = {});

/// A square block with a round hole along z that has 45 degree chamfers; from -height / 2 to height / 2.
struct HoledBlock {
    float diameter = 8e-3f;   ///< of the hole [m]
    float width = 25e-3f;     ///< of its sides [m]
    float height = 25e-3f;    ///< [m]
    float floor = 5e-3f;      ///< thickness below the hole [m]; 0: a through hole
    float chamfer = 0.5e-3f;  ///< [m]
    int segments = 96;        ///< edges per circle, a multiple of 24
};
Mesh holedBlock(const HoledBlock& part = {});

/// A pole with a round top on a round foot: around z, from 0 to height.
struct Pole {
    float radius = 20e-3f;      ///< [m]
    float height = 400e-3f;     ///< including the foot [m]
    float footRadius = 80e-3f;  ///< [m]
    float footHeight = 10e-3f;  ///< [m]
    int segments = 48;          ///< edges per circle, a multiple of 24
};
Mesh pole(const Pole& part = {});

/// Returns the poses of the links of a chain that hangs from the origin along -z, the first link at the origin. A link
/// is a torus, as made by torus(major, minor). Each link is rotated by 90 degrees relative to the previous one.
/// @param slack  separation of neighbours [m]; at 0 they touch
/// Throws std::invalid_argument if neighbours are not linked.
std::vector<Pose> chain(int links, float major, float minor, float slack = 0);

}  // namespace bilayer::shapes
