// Bodies in a fluid's own voxels.
#pragma once

#include <openvdb/openvdb.h>

#include <bilayer/integration/fluid/placement.h>
#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>

namespace bilayer::fluid::detail {

/// The signed distances of a mesh that has been placed in the world, in voxels of another grid: exact ones, as build()
/// finds them, however the body was stretched and turned. Signs are found as by Sign::automatic.
/// @param voxels       cubes, not mirrored, of any size and wherever they lie
/// @param width        of the band to either side [m]
/// @param uniteSolids  as BuildOptions::unite
/// Throws std::invalid_argument for a placement as check() does, one beyond the range of OpenVDB's coordinates, voxels
/// that are no cubes or mirrored, a mesh with a hole wider than two voxels (opening.h), one without an inside
/// (Sign::flood would have to tell it), wherever the voxels lie; and what build() refuses, a band of more memory than
/// the machine has among it.
openvdb::FloatGrid::Ptr regrid(const Mesh& mesh, const Placement& placement, const openvdb::math::Transform& voxels,
                               float width, bool uniteSolids = true);

/// The same for a field. One that lies in these very voxels already is copied; of another one the zero set is
/// extracted, which rounds off creases by a part of a voxel of the field, and its distances are exact again: its band
/// may be as narrow as a voxel. Throws std::invalid_argument as well if the band is narrower than that, or the field
/// has no surface.
openvdb::FloatGrid::Ptr regrid(const LevelSet& field, const Placement& placement,
                               const openvdb::math::Transform& voxels, float width);

/// Throws std::invalid_argument if no voxel of a band is inside: its body may be closed and lie between them.
void requireInside(const openvdb::FloatGrid& band);

}  // namespace bilayer::fluid::detail
