// SPDX-License-Identifier: Apache-2.0
// Bodies slide without friction, or roll, over a wavy triangle mesh, the typical ground of games and robotics. Contacts
// with internal edges, known as ghost collisions, would slow them down, and so would impacts on shallow edges.
#pragma once

#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct TerrainOptions {
    float height = 0.01f;      ///< amplitude of the waves, whose wavelengths are 3 and 4.8 m [m]
    float cell = 0.25f;        ///< edge of the squares of two triangles each that form the ground [m]
    bool heightField = false;  ///< the ground is a btHeightfieldTerrainShape; otherwise a btBvhTriangleMeshShape
    bool rolls = false;        ///< only the ball and the capsule, which roll with friction; otherwise six bodies slide
    bool smoothGround = true;  ///< as in bullet::ExtensionOptions
    float speed = 2;           ///< initial speed [m/s]
    float seconds = 3;
    float stepsPerSecond = 240;
    float voxelSize = 0.0125f;  ///< of all bodies, whose sizes are 0.3 to 0.7 m [m]
};

/// Criteria, after a quarter of a second in which bodies settle:
/// - The speed of each body is that of a frictionless point with constant energy, within 2 %. It is computed from the
///   kinetic energy, of which bodies that turn or roll have a part in their rotation.
/// - No contact normal is more than 5 degrees outside of the normals of the triangles around it.
/// - No body penetrates the ground by half a voxel.
/// - Energy never rises by 1 %.
Outcome terrain(const TerrainOptions& options);

}  // namespace bilayer::demo
