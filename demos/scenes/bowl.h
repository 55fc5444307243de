// Bodies of any shape fall into a bowl and come to rest on each other: bilayer's whole path from a mesh to bodies in
// Bullet.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "demos/shared/outcome.h"

namespace bilayer::demo {

/// A kind of body. Its mesh is scaled to a longest side of 0.2 m.
struct Kind {
    std::string name;
    Mesh mesh;
};

struct BowlOptions {
    std::vector<Kind> kinds;  ///< that bodies are of in turn; at least one
    int bodies = 30;          ///< the bowl is made large enough for them
    int resolution = 128;     ///< voxels along a body's longest side
    /// Of Bullet's solver, whose friction starts from nothing in each step: with 10, here and there a body of a heap
    /// that is kept awake slides on by a few voxels.
    int iterations = 40;
    float seconds = 30;      ///< at most, until all sleep
    float hold = 0;          ///< how long they are then kept awake, to see whether the heap creeps [s]
    std::uint32_t seed = 7;  ///< of the first poses
};

/// Criteria: all bodies fall asleep, none leaves the bowl; overlaps, of which 99 in 100 are below half a voxel; energy,
/// which never rises by more than 1 % of the kinetic energy's peak; creep while held, below a voxel.
Outcome bowl(const BowlOptions& options);

/// Reads a body from a file, turned from y upward to z upward, and named after the file.
Kind readKind(const std::string& path);

/// The Stanford bunny of Debian's package glmark2-data, or a knot where that is not installed.
Kind bunny();

}  // namespace bilayer::demo
