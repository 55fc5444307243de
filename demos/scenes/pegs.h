// SPDX-License-Identifier: Apache-2.0
// Pegs fall into holes that are only slightly wider than they are. Each peg is dropped off-centre and tilted, and must
// slide over the chamfers down to the floor.
#pragma once

#include <bilayer/sdf/mesh_io.h>
#include <filesystem>
#include <vector>

#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct PegsOptions {
    std::vector<float> clearances{1e-3f, 0.5e-3f, 0.2e-3f, 0.1e-3f, 0.05e-3f};  ///< one per peg [m]
    float friction = 0.1f;
    float offset = 0.2e-3f;  ///< initial offset from the hole's axis, in addition to half the clearance [m]
    float tilt = 0.5f;       ///< initial tilt [degrees]
    float seconds = 3;       ///< max duration; ends when all pegs are down
    float stepsPerSecond = 480;
    int iterations = 100;       ///< of Bullet's solver
    float voxelSize = 0.2e-3f;  ///< [m]
    /// Folder with the peg and plate of the Factory data set, see hasFactoryPeg(): the scene then uses these too, with
    /// the plate on a table that is the hole's floor. Empty: parts by formula only.
    std::filesystem::path factory{};
};

/// Returns whether a folder contains `factory_round_peg_8mm_tight.obj` and `factory_round_hole_8mm_subdiv_3x.obj`, with
/// a clearance of 0.1 mm. The plate's mesh has cracks along its edges, so that winding numbers determine its inside.
bool hasFactoryPeg(const std::filesystem::path& folder);

/// Criteria: all pegs reach the floor. No peg penetrates its block by half its clearance. Throws what readMesh()
/// throws.
Outcome pegs(const PegsOptions& options);

}  // namespace bilayer::demo
