// A narrow-band field judged voxel by voxel against the truth: distances, signs, and whether the band is whole. The
// accuracy benchmark and the tests of the exact method share it.
#pragma once

#include <openvdb/openvdb.h>

#include <cstdint>
#include <string>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "tests/support/truth.h"

namespace bilayer::test {

/// What an exact field may be off by, in distance and at the borders of the band, and how near to the surface a sign
/// may be either [voxels].
inline constexpr double exactness = 1e-4;

/// The widths that a band was asked for [voxels].
struct Band {
    double exterior = 3, interior = 3;
};

/// A voxel and its true signed distance [voxels].
struct TrueVoxel {
    openvdb::Coord at;
    double distance;
};

/// What is wrong with a voxel.
enum class Fault { distance, sign, background, missing, extra };

/// A voxel at fault; distances in voxels.
struct Witness {
    Fault fault;
    openvdb::Coord at;
    double value, truth;
    bool active;

    std::string text() const;
};

/// What was found at a set of voxels.
struct Verdict {
    std::size_t checked = 0, active = 0;  ///< voxels
    double worst = 0;                     ///< largest error of |distance| at an active voxel [voxels]
    std::size_t inexact = 0;              ///< active voxels whose |distance| is off by more than `exactness`
    std::size_t wrong = 0;            ///< active voxels of the wrong sign, farther than `exactness` from the surface
    std::size_t wrongFar = 0;         ///< of these, farther than a tenth of a voxel
    std::size_t wrongBackground = 0;  ///< inactive voxels of the wrong sign
    std::size_t missing = 0;          ///< inactive, though nearer than the band's width less `exactness`
    std::size_t extra = 0;            ///< active, though farther than the band's width plus `exactness`
    std::vector<Witness> witnesses;   ///< some voxels at fault

    bool exact() const { return inexact + wrong + wrongBackground + missing + extra == 0; }
    Verdict& operator+=(const Verdict& other);
};

/// Chooses voxels to judge a field of a mesh at: all voxels in and around the mesh's box where these are no more than
/// `count`. Else about 2 * `count` of them at random: `count` active ones, and others in the leaves, next to the band,
/// near the band's true borders, at small triangles, and anywhere in the box.
std::vector<openvdb::Coord> chooseVoxels(const openvdb::FloatGrid& grid, const Mesh& mesh, const Band& band,
                                         std::size_t count, unsigned seed);

/// The true distances at voxels, on all threads of the current arena.
std::vector<TrueVoxel> trueVoxels(const Truth& truth, const std::vector<openvdb::Coord>& voxels, double voxelSize);

/// Whether signs count: they mean something only where the mesh bounds a solid.
enum class Signs { judged, ignored };

/// Judges a field at voxels. Where signs are ignored the band's widths must be equal.
Verdict judge(const openvdb::FloatGrid& grid, const Band& band, const std::vector<TrueVoxel>& voxels,
              Signs signs = Signs::judged);

}  // namespace bilayer::test
