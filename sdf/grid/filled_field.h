// SPDX-License-Identifier: Apache-2.0
// The grids of a field, from the last filled block to the result.
// Tested by tests/sdf/build.cpp through build().
#pragma once

#include <cstdint>
#include <memory>

#include <bilayer/sdf/mesh.h>
#include <bilayer/sdf/options.h>
#include "sdf/base/openvdb.h"
#include "sdf/grid/assemble.h"
#include "sdf/grid/field_metadata.h"
#include "sdf/grid/field_part.h"

namespace bilayer::detail {

/// The grids of a field that has been filled, or of a part of it, and its signs.
struct FilledField {
    openvdb::FloatGrid::Ptr distance;
    openvdb::Int32Grid::Ptr triangle;  ///< null unless the options ask for it
    FieldSigns signs;
    FilledPart part;  ///< but for its grids and conflicts

    /// Replaces the grids by those of an assembler.
    void join(Assembler& assembler, float voxelSize);

    /// Removes what lies outside the part, once its signs are known. Keeps what its neighbours need.
    void trim(const FieldPart& own);

    /// Returns the grids with their metadata. Call it once.
    std::shared_ptr<Grids> finish(const Mesh& mesh, std::uint64_t meshHash, const BuildOptions& options);
};

}  // namespace bilayer::detail
