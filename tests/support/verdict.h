// SPDX-License-Identifier: Apache-2.0
// Compares a narrow-band field voxel by voxel with the ground truth: distances, signs, and completeness of the band.
// Shared by the accuracy benchmark and the tests of the exact method.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/base/openvdb.h"
#include "tests/support/truth.h"

namespace bilayer::test {

/// Tolerance of an exact field, in distance and at the borders of the band. A sign may be wrong only within this
/// distance of the surface [voxels].
inline constexpr double exactness = 1e-4;

/// The requested widths of a band [voxels].
struct Band {
    double exterior = 3, interior = 3;
};

/// A voxel and its true signed distance [voxels].
struct TrueVoxel {
    openvdb::Coord at;
    double distance;
};

/// Kinds of faulty voxels.
enum class Fault { distance, sign, background, missing, extra };

/// A faulty voxel; distances in voxels.
struct Witness {
    Fault fault;
    openvdb::Coord at;
    double value, truth;
    bool active;

    std::string text() const;
};

/// Result of a comparison.
struct Verdict {
    std::size_t checked = 0, active = 0;  ///< voxels
    double worst = 0;                     ///< maximum error of |distance| at an active voxel [voxels]
    std::size_t inexact = 0;              ///< active voxels whose |distance| error exceeds `exactness`
    std::size_t wrong = 0;            ///< active voxels of the wrong sign, farther than `exactness` from the surface
    std::size_t wrongFar = 0;         ///< of these, farther than 0.1 voxels
    std::size_t wrongBackground = 0;  ///< inactive voxels of the wrong sign
    std::size_t missing = 0;          ///< inactive, though nearer than the band's width minus `exactness`
    std::size_t extra = 0;            ///< active, though farther than the band's width plus `exactness`
    std::vector<Witness> witnesses;   ///< some faulty voxels

    bool exact() const { return inexact + wrong + wrongBackground + missing + extra == 0; }
    Verdict& operator+=(const Verdict& other);
};

/// Chooses voxels at which a field of a mesh is checked: all voxels in and around the mesh's box if these are no more
/// than `count`. Otherwise about 2 * `count` voxels at random: `count` active ones, and others in the leaves, next to
/// the band, near the band's true borders, at small triangles, and anywhere in the box.
std::vector<openvdb::Coord> chooseVoxels(const openvdb::FloatGrid& grid, const Mesh& mesh, const Band& band,
                                         std::size_t count, unsigned seed);

/// The true distances at voxels, on all threads of the current arena.
std::vector<TrueVoxel> trueVoxels(const Truth& truth, const std::vector<openvdb::Coord>& voxels, double voxelSize);

/// Whether signs are checked. They are defined only where the mesh bounds a solid.
enum class Signs { judged, ignored };

/// Compares a field with the truth at voxels. If signs are ignored, the band's widths must be equal.
Verdict judge(const openvdb::FloatGrid& grid, const Band& band, const std::vector<TrueVoxel>& voxels,
              Signs signs = Signs::judged);

}  // namespace bilayer::test
