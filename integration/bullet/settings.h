// SPDX-License-Identifier: Apache-2.0
// Recommended settings for a body's field, before anything is built: voxel size, band, margin and substeps.
// docs/contacts/settings.md lists the rules.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <bilayer/sdf/inspect.h>

namespace bilayer::bullet {

/// The motion and surroundings of a body. Zero for a length, negative for `margin` and `spin`: unknown, or to be
/// recommended.
struct SceneRequirements {
    float step = 1.f / 60;  ///< time step of the simulation [s]
    float speed = 0;        ///< maximum relative speed of an impact [m/s]
    float spin = -1;        ///< maximum angular speed [rad/s]; unknown: what an impact at `speed` may give
    float thickness = 0;    ///< thickness of the thinnest wall that it meets [m]; its own walls count too
    float gap = 0;          ///< narrowest gap that it has to pass [m]
    float massRatio = 1;    ///< mass of the heaviest over the lightest of the bodies that rest on each other
    float voxelSize = 0;    ///< a voxel size to be judged, not chosen [m]
    float margin = -1;      ///< a margin to be judged, not chosen [m]
};

inline constexpr int maxSubsteps = 1'000'000;  ///< upper limit, which also stands for larger counts

/// What recommendSettings() recommends for a body, and what it costs.
struct Settings {
    float voxelSize = 0;                 ///< [m]
    float margin = 0;                    ///< ColliderOptions::margin [m]
    float exteriorWidthVoxels = 0;       ///< a whole number
    float interiorWidthVoxels = 0;       ///< a whole number
    int substeps = 1;                    ///< substeps of a step, with ShapeOptions::speculative; at most maxSubsteps
    int substepsWithoutSpeculation = 1;  ///< substeps without speculative contacts
    /// the thinner of SceneRequirements::thickness and MeshReport::commonWall [voxels]; 0: unknown
    float wallVoxels = 0;
    float splitImpulse = 0;    ///< for m_splitImpulsePenetrationThreshold [m]
    std::uint64_t voxels = 0;  ///< active voxels, approximate
    /// approximate size of the Field in memory [bytes]; a thin body may take as little as half of it
    std::uint64_t fieldBytes = 0;
    double buildSeconds = 0;            ///< approximate, on two cores of 2023 [s]
    std::vector<std::string> warnings;  ///< problems to expect with these settings, a sentence each
};

/// Recommends settings for a body from its mesh. Throws std::invalid_argument that names any value that is not
/// sensible, and for a mesh without extent.
Settings recommendSettings(const MeshReport& mesh, const SceneRequirements& scene);

}  // namespace bilayer::bullet
