// Pegs fall into holes that are hardly wider than they are: each is dropped aside of its hole and aslant, and must find
// its way over the chamfers down to the floor.
#pragma once

#include <bilayer/sdf/mesh_io.h>
#include <filesystem>
#include <vector>

#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct PegsOptions {
    std::vector<float> clearances{1e-3f, 0.5e-3f, 0.2e-3f, 0.1e-3f, 0.05e-3f};  ///< of each peg [m]
    float friction = 0.1f;
    float aside = 0.2e-3f;  ///< from the hole's axis at the start, beyond half the clearance [m]
    float tilt = 0.5f;      ///< at the start [degrees]
    float seconds = 3;      ///< at most, until all are down
    float stepsPerSecond = 480;
    int iterations = 100;       ///< of Bullet's solver
    float voxelSize = 0.2e-3f;  ///< [m]
    /// Where peg and plate of the Factory data set lie, see hasFactoryPeg(): they are played too, the plate on a table
    /// which is the hole's floor. Empty: parts by formula alone.
    std::filesystem::path factory{};
};

/// Whether a folder holds `factory_round_peg_8mm_tight.obj` and `factory_round_hole_8mm_subdiv_3x.obj`: a clearance of
/// 0.1 mm. The plate is open by cracks along its edges, so that winding numbers tell its inside.
bool hasFactoryPeg(const std::filesystem::path& folder);

/// Criteria: all pegs come down to the floor; none overlaps its block by half its clearance. Throws
/// what readMesh() throws.
Outcome pegs(const PegsOptions& options);

}  // namespace bilayer::demo
