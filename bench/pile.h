// SPDX-License-Identifier: Apache-2.0
// A pile of bodies in Bullet. The bodies and their initial poses are the same for every rival.
#pragma once

#include <memory>
#include <vector>

#include <bilayer/collider/mass.h>
#include <bilayer/collider/pose.h>
#include <bilayer/sdf/level_set.h>
#include "bench/rivals.h"
#include "demos/shared/exact_distance.h"

namespace bilayer::bench {

/// Bodies of one shape. The origin is the centre of mass; the axes are the principal ones.
struct Form {
    Mesh mesh;
    Bounds box;
    btCollisionShape* shape = nullptr;
    MassProperties mass;
    std::unique_ptr<demo::Specimen> specimen;  ///< measures the penetration of these bodies

    /// @param shape  of the mesh
    Form(Mesh mesh, btCollisionShape& shape, double spacing);
};

struct Member {
    const Form* form = nullptr;
    float mass = 0;  ///< 0: static [kg]
    Pose pose{};
};

struct PileOptions {
    float stepsPerSecond = 240;
    double seconds = 4;
    double timeLimit = 60;  ///< maximum wall-clock time of a run, which then ends [s]
    int measuredFrames = 40;
};

/// Where the time of a step goes [ms], and what it is spent on.
struct StepParts {
    double broadPhase = 0;  ///< boxes, and the pairs whose boxes overlap
    double contacts = 0;    ///< of these pairs, until Bullet's manifolds hold them
    double solver = 0;      ///< Bullet's, with its islands
    double points = 0;      ///< count of contact points in the manifolds
};

/// Result of a run.
struct PileRun {
    std::vector<double> stepMs;         ///< time of each step [ms]
    std::vector<StepParts> parts;       ///< of each step
    std::vector<double> kineticEnergy;  ///< after each step [J]
    std::vector<double> penetrations;   ///< overlapping pairs in the measured frames, by the meshes [m]
    int awakeBodies = 0;                ///< bodies at the end that are too fast to fall asleep
    double simulated = 0;               ///< [s]
    DeviceTimes device;                 ///< of all steps, if a device samples the points
};

/// Lets the bodies fall. Sleeping is disabled, so each step does its full work.
PileRun play(const Rival& rival, const std::vector<Member>& members, const PileOptions& options);

}  // namespace bilayer::bench
