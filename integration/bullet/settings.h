// What a scene asks of a body's field: voxel size, band, margin and substeps, before anything is built.
// docs/contacts.md lists the rules.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <bilayer/sdf/inspect.h>

namespace bilayer::bullet {

/// What a body is going to do. Zero for a length, negative for `margin` and `spin`: not known, or left to the advice.
struct SceneRequirements {
    float step = 1.f / 60;  ///< of the simulation [s]
    float speed = 0;        ///< that bodies meet with at most [m/s]
    float spin = -1;        ///< that they turn with at most [rad/s]; unknown: what an impact at `speed` may give
    float thickness = 0;    ///< of the thinnest wall that it meets [m]; its own count besides
    float gap = 0;          ///< narrowest clearance that it has to pass [m]
    float massRatio = 1;    ///< of the heaviest to the lightest bodies that lie on each other
    float voxelSize = 0;    ///< to be judged instead of chosen [m]
    float margin = -1;      ///< likewise [m]
};

inline constexpr int maxSubsteps = 1'000'000;  ///< stands for more as well: nobody takes as many

struct Settings {
    float voxelSize = 0;                 ///< [m]
    float margin = 0;                    ///< ColliderOptions::margin [m]
    int exteriorWidth = 0;               ///< [voxels]
    int interiorWidth = 0;               ///< [voxels]
    int substeps = 1;                    ///< of a step, with ShapeOptions::speculative; maxSubsteps at most
    int substepsWithoutSpeculation = 1;  ///< without
    float wallVoxels =
        0;  ///< the thinner of SceneRequirements::thickness and MeshReport::commonWall [voxels]; 0: unknown
    float splitImpulse = 0;        ///< for m_splitImpulsePenetrationThreshold [m]
    std::uint64_t voxels = 0;      ///< active ones, about
    std::uint64_t fieldBytes = 0;  ///< of the Field laid out, about; of thin bodies down to half of it [bytes]
    double buildSeconds = 0;       ///< on two cores of 2023, about [s]
    std::vector<std::string> warnings;
};

/// Advises on a body by its mesh. Throws std::invalid_argument that names what is no sensible number, and for a mesh
/// without extent.
Settings recommendSettings(const MeshReport& mesh, const SceneRequirements& scene);

}  // namespace bilayer::bullet
