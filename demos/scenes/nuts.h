// Nuts run down their bolts by gravity, or a multiple of it: a turn must take them down by a pitch, and friction that
// holds the nut in theory must hold it here. After Y. Narang and others, "Factory: fast contact for robotic assembly",
// RSS 2022.
#pragma once

#include <bilayer/sdf/mesh_io.h>
#include <filesystem>
#include <vector>

#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct NutsOptions {
    int pairs = 16;
    std::vector<float> frictions{0, 0.01f, 0.05f, 0.1f};  ///< of the pairs in turn
    float turns = 10;                                     ///< the nuts that run make
    float seconds = 5;                                    ///< at most
    float clearance = 50e-6f;                             ///< of the threads [m], see shapes::Thread
    float weights = 1;                                    ///< gravity on the nuts, in multiples of their own weight
    int segments = 96;                                    ///< of the threads, a multiple of 24
    /// At 480, nuts without friction turn by more than a facet of their threads in a step after some turns, and hop in
    /// their play now and then. So do nuts under ten times their weight at 600: a turn's advance is off by 1.2 % then.
    /// Those that stay creep by the step, 1e-4 degrees each.
    float stepsPerSecond = 720;
    int iterations = 100;       ///< of Bullet's solver
    float voxelSize = 0.3e-3f;  ///< [m]
    /// Where the bolt and the nut of the Factory data set lie, see hasFactoryThread(): they are played instead.
    /// They make `factoryTurns` at most. Empty: parts by formula.
    std::filesystem::path factory{};
};

/// More than these, and a nut comes to the head of Factory's bolt.
inline constexpr float factoryTurns = 3;

/// Whether a folder holds `factory_bolt_m16_loose.obj` and `factory_nut_m16_loose_subdiv_3x.obj`: M16, 0.1 mm of play
/// between flanks. The nut is open by cracks along the edges of its hexagon, so that winding numbers tell its inside.
bool hasFactoryThread(const std::filesystem::path& folder);

/// Criteria: the advance of each turn is the thread's pitch within 1 %; nuts run that friction does not hold in theory,
/// gaining speed evenly, and those that it holds stay; no overlap of half a voxel. Throws what readMesh() throws.
Outcome nuts(const NutsOptions& options);

}  // namespace bilayer::demo
