// SPDX-License-Identifier: Apache-2.0
// Options for building a field.
// Tested by tests/sdf/build.cpp.
#pragma once

#include <functional>
#include <stdexcept>

namespace bilayer {

struct MeshReport;

/// How a triangle is subdivided. Each part gets one sample, at its barycentre.
enum class Subdivision {
    rows,       ///< Algorithm 1 of the paper: n rows, n (n + 1) / 2 samples
    recursive,  ///< Fig. 2 of the paper: halves and quarters until the area is below epsilon
};

/// Parameters of the double layer method, in voxels. Defaults, and the names delta and epsilon, are the paper's.
struct DoubleLayerOptions {
    float delta = 0.5f;       ///< distance of each layer from the surface [voxels], in [0.1, 4]
    float epsilon = 1.0f;     ///< area per sample [voxels^2], in [1e-4, 1e4]
    int neighbourhood = 2;    ///< K: a sample reaches K + 1/2 voxels, or more if the band requires it, in 1..64
    int maxSubdivision = 32;  ///< n_max: maximum rows of samples in one piece of a triangle, in 1..1024
    Subdivision subdivision = Subdivision::rows;  ///< how triangles are cut into samples
    /// true: fills the gaps that Algorithm 1 leaves at slivers and at triangles too large for n_max rows. Such
    /// triangles are first cut into pieces, thin pieces are sampled along their length, and K grows with the band. The
    /// band is then complete.
    /// false: follows the paper exactly. n is clamped to n_max, a sample affects a cube of (2K + 1)^3 voxels, and gaps
    /// remain.
    bool fillGaps = true;
};

/// How distances are computed.
enum class Method {
    exact,         ///< samples find the candidate triangles, exact triangle distances decide
    doubleLayer,   ///< the paper's method: distances to two layers of samples
    pseudonormal,  ///< BVH query at each voxel; sign from the angle-weighted pseudonormal
    prism,         ///< prisms around triangles ([11] in the paper); OpenCL only, leaks at creases
};

/// How the inside is found. The double layer and the prism method have their own signs and ignore this.
enum class Sign {
    automatic,  ///< normals if the mesh is closed and oriented, else the method that suits the mesh
    normals,    ///< angle-weighted pseudonormal of the closest feature; flips inside-out components first
    winding,    ///< inside: generalized winding number above one half
    flood,      ///< inside: not reachable from outside through gaps wider than `gapVoxels`
};

/// Options of build().
struct BuildOptions {
    /// Edge length of a voxel [m], required, at least 2e-5. Scale a smaller mesh first, for example by 1000 from metres
    /// to millimetres.
    float voxelSize = 0;
    // Build time grows with the cube of the width in voxels: hundreds of voxels take minutes.
    // Divide a width in metres by voxelSize.
    float exteriorWidthVoxels = 3;  ///< voxels with 0 <= distance < this are active, in (0, 1000]
    float interiorWidthVoxels = 3;  ///< voxels with -this < distance < 0 are active, in (0, 1000]
    Method method = Method::exact;  ///< how distances are computed
    Sign sign = Sign::automatic;    ///< how the inside is found
    float gapVoxels = 2;            ///< Sign::flood closes gaps up to this width, in [0, 100]
    /// true: builds the union of overlapping solids. Walls inside the union are ignored, distances inside refer to
    /// the union's outer surface, and winding numbers give the signs. Triangle indices then refer to the mesh with its
    /// outward orientation.
    /// Requires Method::exact or Method::pseudonormal. A mesh that needs Sign::flood keeps all walls.
    bool unite = false;
    /// The report of inspect() for this mesh; null: not available. With it, Sign::automatic selects winding numbers at
    /// once for a closed mesh that self-intersects, and skips the sign comparison for one that does not.
    const MeshReport* inspected = nullptr;
    DoubleLayerOptions doubleLayer{};  ///< of Method::doubleLayer
    bool triangles = false;            ///< also store the nearest triangle of each active voxel
    int threads = 0;                   ///< maximum thread count; 0: all
    /// Called repeatedly with the completed fraction (0..1), from any thread but never concurrently. Return false to
    /// cancel.
    std::function<bool(float)> progress{};
};

/// Thrown by build() after `BuildOptions::progress` returned false.
struct Cancelled : std::runtime_error {
    /// Its what() is "cancelled".
    Cancelled() : std::runtime_error("cancelled") {}
};

}  // namespace bilayer
