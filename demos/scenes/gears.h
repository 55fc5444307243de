// SPDX-License-Identifier: Apache-2.0
// A train of spur gears, the first one driven, the last one braked. Teeth that mesh by contact alone must maintain the
// gear ratio.
#pragma once

#include <bilayer/sdf/mesh_io.h>
#include <filesystem>
#include <vector>

#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct GearsOptions {
    std::vector<int> teeth{18, 36, 24, 48};  ///< of each gear; at least two
    float turns = 10;                        ///< revolutions of the first gear
    float speed = 5;                         ///< of the first gear [rad/s]
    float load = 0.1f;                       ///< braking torque on the last gear [N m]
    float backlash = 0.1e-3f;                ///< between the teeth, see shapes::Gear [m]
    float stepsPerSecond = 480;
    int iterations = 100;       ///< of Bullet's solver
    float voxelSize = 0.3e-3f;  ///< [m]
    /// Folder with the gear of the Factory data set, see hasFactoryGear(): the scene then uses two of it. Empty: gears
    /// by formula.
    std::filesystem::path factory{};
};

/// Returns whether a folder contains `factory_gear_medium.ply`: 40 teeth of module 1 mm, on a hub.
bool hasFactoryGear(const std::filesystem::path& folder);

/// Criteria: over all revolutions, the ratio of each gear's angle to the first gear's equals the ratio of their teeth
/// within 0.5 %. At no time is a gear off by half a tooth. No penetration reaches half a voxel. Throws what readMesh()
/// throws.
Outcome gears(const GearsOptions& options);

}  // namespace bilayer::demo
