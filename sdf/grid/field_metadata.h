// SPDX-License-Identifier: Apache-2.0
// The metadata of a field: how it was built, from what, and how its signs were found.
// Tested by tests/sdf/build.cpp through build().
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>
#include <bilayer/sdf/options.h>
#include "sdf/base/openvdb.h"

namespace bilayer::detail {

/// The signs of a field and how they were found.
struct FieldSigns {
    std::string name, reason;
    std::size_t conflicts = 0;  ///< voxels on both sides, and contradictory neighbour pairs
    std::size_t undecided = 0;  ///< voxels whose nearest normals cancel out, or that are equally near to both layers
};

/// Sets the name, transform and metadata of a distance grid.
/// @param origin, meshHash  of the mesh that build() was given
/// @param options  with widths in voxels, here and below
void describe(openvdb::FloatGrid& grid, const glm::dvec3& origin, std::uint64_t meshHash, const BuildOptions& options,
              const FieldSigns& signs);

/// Throws std::invalid_argument if the options and the mesh are not those of an existing field.
void checkFieldOf(const LevelSet& field, const Mesh& mesh, const BuildOptions& options);

/// Returns whether a field is as build() made it, with signs by normals and without conflicts.
bool hasCleanNormalSigns(const LevelSet& field, const BuildOptions& options);

}  // namespace bilayer::detail
