// SPDX-License-Identifier: Apache-2.0
// Compares the signs of a field with winding numbers and corrects them. This header includes OpenVDB and is slow to
// compile.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/base/openvdb.h"
#include "sdf/sign/column_sums.h"
#include "sdf/sign/octree_cells.h"

namespace bilayer::detail {

class Progress;

/// The result of repairSigns().
struct SignRepair {
    std::size_t repaired = 0;  ///< active voxels whose sign was corrected
    std::size_t refused = 0;   ///< active voxels that keep a wrong sign

    SignRepair& operator+=(const SignRepair& more) {
        repaired += more.repaired;
        refused += more.refused;
        return *this;
    }
};

/// Gives active voxels the sign of the mesh's winding number: negative where it is positive. Applies to the field of a
/// balanced mesh, signed by normals without conflicts. Such a field is wrong only where the mesh self-intersects.
/// Voxels within 1e-3 voxel of the surface count as right. Corrections are refused where the winding number is
/// negative, because that part of the mesh is inside out. They are also refused farther from the surface than `limit`.
///
/// Winding numbers are exact: they sum the signed triangle crossings along each column of voxels. A column through an
/// edge or vertex is perturbed infinitesimally, in the same way for all triangles (H. Edelsbrunner, E. P. Muecke,
/// "Simulation of simplicity", ACM TOG 9 (1990)).
///
/// Up to 1024 leaves, all columns are compared. With more leaves, one column in five is compared first. No voxel is
/// more than one voxel from such a column, so this finds any wrong region that contains a voxel at a distance of one
/// voxel or more. If any compared column is wrong, all columns are compared. The cost is a few percent of a build.
/// @param distance  voxel centres are integer multiples of the voxel size
/// @param mesh      balanced() and valid [m]
/// @param limit     maximum distance of a corrected voxel from the surface [m]
/// @param progress  polled for cancellation, unless null
SignRepair repairSigns(openvdb::FloatGrid& distance, const Mesh& mesh, float limit, Progress* progress = nullptr);

/// Up to this many leaves, repairSigns() compares all columns at once, in milliseconds.
inline constexpr std::size_t fewLeaves = 1024;

/// Leaves whose signs are compared without the rest of the field.
struct ComparedLeaves {
    std::vector<BandLeaf*> leaves;
    double voxelSize;         ///< [m]
    const ColumnSums& below;  ///< of all crossings below `lowest`
    std::int32_t lowest;      ///< voxel
};

/// Compares leaves as repairSigns() does.
/// @param mesh     those triangles of the mesh that cross the leaves' columns from `lowest` up to the leaves
/// @param correct  whether to correct the signs; otherwise they are only counted
SignRepair compareSigns(const ComparedLeaves& leaves, const Mesh& mesh, float limit, bool everyFifthColumn,
                        bool correct, Progress* progress);

}  // namespace bilayer::detail
