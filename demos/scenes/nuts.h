// SPDX-License-Identifier: Apache-2.0
// Nuts run down their bolts under gravity or a multiple of it. One revolution must advance a nut by one pitch, and
// friction that holds the nut in theory must hold it here. After Y. Narang and others, "Factory: fast contact for
// robotic assembly", RSS 2022.
#pragma once

#include <bilayer/sdf/mesh_io.h>
#include <filesystem>
#include <vector>

#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct NutsOptions {
    int pairs = 16;
    std::vector<float> frictions{0, 0.01f, 0.05f, 0.1f};  ///< used by the pairs in turn
    float turns = 10;                                     ///< revolutions of the running nuts
    float seconds = 5;                                    ///< max duration
    float clearance = 50e-6f;                             ///< of the threads [m], see shapes::Thread
    float weights = 1;                                    ///< load on the nuts, in multiples of their weight
    int segments = 96;                                    ///< of the threads, a multiple of 24
    /// At 480, nuts without friction rotate by more than a facet of their threads per step after some revolutions, and
    /// occasionally hop in their play. At 600, nuts under ten times their weight do the same: the advance per
    /// revolution is then off by 1.2 %. Nuts that stick drift by 1e-4 degrees per step.
    float stepsPerSecond = 720;
    int iterations = 100;       ///< of Bullet's solver
    float voxelSize = 0.3e-3f;  ///< [m]
    /// Folder with the bolt and the nut of the Factory data set, see hasFactoryThread(): the scene then uses these,
    /// with at most `factoryTurns` revolutions. Empty: parts by formula.
    std::filesystem::path factory{};
};

/// Max revolutions before a nut reaches the head of Factory's bolt.
inline constexpr float factoryTurns = 3;

/// Returns whether a folder contains `factory_bolt_m16_loose.obj` and `factory_nut_m16_loose_subdiv_3x.obj`: M16, with
/// 0.1 mm of play between flanks. The nut's mesh has cracks along the edges of its hexagon, so that winding numbers
/// determine its inside.
bool hasFactoryThread(const std::filesystem::path& folder);

/// Criteria: the advance per revolution is the thread's pitch within 1 %. Nuts that friction does not hold in theory
/// run with uniform acceleration, and those that it holds stay. No penetration reaches half a voxel. Throws what
/// readMesh() throws.
Outcome nuts(const NutsOptions& options);

}  // namespace bilayer::demo
