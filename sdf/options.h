// How a field is to be built.
#pragma once

#include <functional>
#include <stdexcept>

namespace bilayer {

struct MeshReport;

/// How a triangle is divided into the parts whose barycentres are sampled.
enum class Subdivision {
    rows,       ///< Algorithm 1 of the paper: n rows, n (n + 1) / 2 samples
    recursive,  ///< Fig. 2 of the paper: by halves and quarters until the area is below epsilon
};

/// The parameters of the double layer method; the defaults are the paper's.
struct DoubleLayerOptions {
    float delta = 0.5f;       ///< distance of each layer from the surface [voxels], in [0.1, 4]
    float epsilon = 1.0f;     ///< area that one sample stands for [voxels^2], in [1e-4, 1e4]
    int neighbourhood = 2;    ///< K: a sample reaches at least K + 1/2 voxels, and farther if the band asks, in 1..64
    int maxSubdivision = 32;  ///< n_max: most rows of samples in one piece of a triangle, in 1..1024
    Subdivision subdivision = Subdivision::rows;
    /// true: triangles for which Algorithm 1 would leave gaps (too large for n_max rows, or slivers) are first cut into
    /// pieces, thin ones sampled along their length, and K grows with the band, so that the band is complete. false:
    /// the paper to the letter, n clamped to n_max and a cube of (2K + 1)^3 voxels around each sample, gaps included.
    bool fillGaps = true;
};

/// How distances are found.
enum class Method {
    exact,         ///< samples find the triangles that can be nearest, triangles decide: exact.h
    doubleLayer,   ///< the paper's: distances of two layers of samples
    pseudonormal,  ///< a bounding hierarchy, asked at each voxel; sign by the angle-weighted pseudonormal
    prism,         ///< the paper's rival [11]: prisms around triangles; on OpenCL devices only, leaks at creases
};

/// How signs are found. The double layer and the prism method have their own and ignore this.
enum class Sign {
    automatic,  ///< normals if the mesh is closed and oriented, else what suits it: chooseSign() in sign.h
    normals,    ///< angle-weighted pseudonormal of the closest feature; components inside out are turned around first
    winding,    ///< generalized winding number above a half: inside
    flood,      ///< what cannot be reached from outside through gaps wider than `gap`: inside
};

/// What the widths of the band are given in.
enum class BandUnit {
    voxels,
    world,  ///< metres: the band keeps its place when the voxel size changes
};

struct BuildOptions {
    /// Edge of a voxel [m]; must be given, at least 2e-5: a mesh in metres of a part of a millimetre is to be scaled
    /// first, by 1000 to millimetres.
    float voxelSize = 0;
    // a band of w voxels costs time with the cube of w: hundreds take minutes
    float exteriorWidth = 3;  ///< every voxel with 0 <= distance < this is active [bandUnit], in (0, 1000] voxels
    float interiorWidth = 3;  ///< every voxel with -this < distance < 0 is active [bandUnit], in (0, 1000] voxels
    BandUnit bandUnit = BandUnit::voxels;
    Method method = Method::exact;
    Sign sign = Sign::automatic;
    float gap = 2;  ///< Sign::flood closes gaps up to this wide [voxels], in [0, 100]
    /// true: solids that overlap are one: walls inside of their union are no surface, distances inside are to its outer
    /// surface (unite.h), and winding numbers tell the signs. Triangles are numbered as outwardMesh() (sign.h) has them
    /// then. For Method::exact and pseudonormal; a mesh that needs Sign::flood keeps all walls.
    bool unite = false;
    /// What inspect() said of this very mesh, where that is known. Sign::automatic then takes winding numbers at once
    /// for a closed mesh that intersects itself, and need not compare signs where it does not. Null: not known.
    const MeshReport* inspected = nullptr;
    DoubleLayerOptions doubleLayer{};
    bool triangles = false;  ///< also keep the nearest triangle of each active voxel
    int threads = 0;         ///< most threads to use; 0: all
    /// Called now and then, from any thread but one at a time, with the part done (0..1); false cancels the build.
    std::function<bool(float)> progress{};
};

/// Thrown by build() when `BuildOptions::progress` returned false.
struct Cancelled : std::runtime_error {
    Cancelled() : std::runtime_error("cancelled") {}
};

}  // namespace bilayer
