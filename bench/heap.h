// A heap of bodies in Bullet: the same bodies at the same poses, whatever some of them collide by.
#pragma once

#include <memory>
#include <vector>

#include <bilayer/collider/contact.h>
#include <bilayer/collider/mass.h>
#include <bilayer/collider/pose.h>
#include "bench/rivals.h"
#include "demos/shared/exact_distance.h"

namespace bilayer::bench {

/// Bodies of one form: its origin is the centre of mass, its axes are the principal ones.
struct Form {
    Mesh mesh;
    Bounds box;
    btCollisionShape* shape = nullptr;
    MassProperties mass;
    std::unique_ptr<demo::Specimen> specimen;  ///< measures them

    /// @param shape  of the mesh
    Form(Mesh mesh, btCollisionShape& shape, double spacing);
};

struct Member {
    const Form* form = nullptr;
    float mass = 0;  ///< 0: it never moves [kg]
    Pose pose{};
};

struct HeapOptions {
    float stepsPerSecond = 240;
    double seconds = 4;
    double patience = 60;  ///< ends a run that has not got as far after so many seconds of waiting
    int measuredFrames = 40;
};

/// What became of a heap.
struct HeapRun {
    std::vector<double> stepMs;         ///< what each step took [ms]
    std::vector<double> kineticEnergy;  ///< after each step [J]
    std::vector<double> penetrations;   ///< of pairs that overlap, by the meshes, in the frames measured [m]
    int restless = 0;                   ///< bodies at the end that are too fast to fall asleep
    double simulated = 0;               ///< [s]
};

/// Lets the bodies fall. None may sleep, so that each step does all the work there is.
HeapRun play(const Rival& rival, const std::vector<Member>& members, const HeapOptions& options);

}  // namespace bilayer::bench
