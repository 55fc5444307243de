// Signs of a field compared with winding numbers, and set right. Heavy: it includes OpenVDB.
#pragma once

#include <openvdb/openvdb.h>

#include <cstddef>

#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

class Progress;

/// What repairSigns() found.
struct SignRepair {
    std::size_t repaired = 0;  ///< active voxels whose sign was changed
    std::size_t refused = 0;   ///< active voxels with a wrong sign that they keep
};

/// Gives active voxels the sign of the mesh's winding number: negative where it is positive. For the field of a
/// balanced mesh by normals without conflicts; only where the mesh intersects itself are signs wrong there. Voxels on
/// the surface, up to a thousandth of a voxel, count as right. Signs are refused where the winding number is negative,
/// so that a part of the mesh is inside out, and farther from the surface than a `limit`.
///
/// Winding numbers are exact: along each column of voxels, sums of the signed crossings of triangles. On edges and
/// vertices a column counts as a hair beside them, the same for all triangles (H. Edelsbrunner, E. P. Muecke,
/// "Simulation of simplicity", ACM TOG 9 (1990)).
///
/// Up to 1024 leaves, all columns are compared. Of more, first one in five: no voxel is more than a voxel from one of
/// them, so that no wrong part of the field can hide there which holds a voxel of a distance of one voxel or more. All
/// are, if one of these is wrong. A few percent of a build.
/// @param distance  voxel centres are whole multiples of the voxel size
/// @param mesh      balanced() and valid [m]
/// @param limit     [m]
/// @param progress  polled, unless null
SignRepair repairSigns(openvdb::FloatGrid& distance, const Mesh& mesh, float limit, Progress* progress = nullptr);

}  // namespace bilayer::detail
