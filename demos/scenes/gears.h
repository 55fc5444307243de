// A train of spur gears, the first one driven, the last one braked: teeth that mesh by contact alone must keep the
// ratio that their numbers say.
#pragma once

#include <bilayer/sdf/mesh_io.h>
#include <filesystem>
#include <vector>

#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct GearsOptions {
    std::vector<int> teeth{18, 36, 24, 48};  ///< of each gear; at least two
    float turns = 10;                        ///< of the first gear
    float speed = 5;                         ///< of the first gear [rad/s]
    float load = 0.1f;                       ///< the torque that brakes the last gear [N m]
    float backlash = 0.1e-3f;                ///< between the teeth, see shapes::Gear [m]
    float stepsPerSecond = 480;
    int iterations = 100;       ///< of Bullet's solver
    float voxelSize = 0.3e-3f;  ///< [m]
    /// Where the gear of the Factory data set lies, see hasFactoryGear(): two of it are played instead. Empty: gears by
    /// formula.
    std::filesystem::path factory{};
};

/// Whether a folder holds `factory_gear_medium.ply`: 40 teeth of module 1 mm, on a hub.
bool hasFactoryGear(const std::filesystem::path& folder);

/// Criteria: over all turns each gear's angle has the ratio to the first one's that their teeth say, within 0.5 %; at
/// no time is a gear off by half a tooth; no overlap of half a voxel. Throws what readMesh() throws.
Outcome gears(const GearsOptions& options);

}  // namespace bilayer::demo
