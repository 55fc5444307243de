// SPDX-License-Identifier: Apache-2.0
// Bodies of any shape fall into a bowl and come to rest in a pile: the complete path from a mesh to bodies in Bullet.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "demos/shared/outcome.h"

namespace bilayer::demo {

/// A kind of body. Its mesh is scaled to a longest side of 0.2 m.
struct Kind {
    std::string name;
    Mesh mesh;
};

struct BowlOptions {
    std::vector<Kind> kinds;  ///< bodies use these in turn; at least one
    int bodies = 30;          ///< the size of the bowl is adapted to the count
    int resolution = 128;     ///< voxels along a body's longest side
    /// Iterations of Bullet's solver, whose friction starts from zero in each step. With 10, a few bodies of a pile
    /// that is kept awake slide on by a few voxels.
    int iterations = 40;
    float seconds = 30;      ///< max duration; ends when all bodies sleep
    float hold = 0;          ///< how long bodies are then kept awake, to measure the drift of the pile [s]
    std::uint32_t seed = 7;  ///< of the initial poses
};

/// Criteria:
/// - All bodies fall asleep, and none leaves the bowl.
/// - 99 % of the penetrations are below half a voxel.
/// - Energy never rises by more than 1 % of the peak kinetic energy.
/// - Drift while kept awake is below one voxel.
Outcome bowl(const BowlOptions& options);

/// Reads a body from a file, rotated from y up to z up, and names it after the file.
Kind readKind(const std::string& path);

/// The Stanford bunny of Debian's package glmark2-data, or a knot if the package is not installed.
Kind bunny();

}  // namespace bilayer::demo
