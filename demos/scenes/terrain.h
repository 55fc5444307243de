// Bodies slide without friction over waves of triangles, the ground of games and robotics: what holds them back there
// are contacts with edges that are none, known as ghost collisions.
#pragma once

#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct TerrainOptions {
    float height = 0.01f;      ///< amplitude of the waves, which are 3 and 4.8 m long [m]
    float cell = 0.25f;        ///< edge of the squares that the ground is divided into, two triangles each [m]
    bool heightField = false;  ///< the ground is a btHeightfieldTerrainShape; else a btBvhTriangleMeshShape
    float speed = 2;           ///< at the start [m/s]
    float seconds = 3;
    float stepsPerSecond = 240;
    float voxelSize = 0.0125f;  ///< of all bodies, which are 0.3 to 0.7 m large [m]
};

/// Criteria: after a quarter of a second in which bodies settle, each is as fast as a point without friction that keeps
/// its energy, within 2 %; no contact leaves the normals of the triangles around it by more than 5 degrees; no body
/// overlaps the ground by half a voxel; energy never rises by 1 %.
Outcome terrain(const TerrainOptions& options);

}  // namespace bilayer::demo
