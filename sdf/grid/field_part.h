// SPDX-License-Identifier: Apache-2.0
// A part of a field: the blocks of a box. It is filled from the triangles near the box alone, by the code that fills
// whole fields.
// Tested by tests/sdf/field_tiles.cpp.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include <bilayer/sdf/mesh.h>
#include <bilayer/sdf/options.h>
#include "sdf/base/openvdb.h"
#include "sdf/leaf/blocks.h"
#include "sdf/sign/column_sums.h"
#include "sdf/sign/sign_choice.h"
#include "sdf/sign/sign_repair.h"

namespace bilayer {

struct Grids;

}  // namespace bilayer

namespace bilayer::detail {

/// What is done where the normals of a closed mesh contradict its winding number.
enum class NormalsCheck { none, count, correct };

/// How the parts of a field find their signs. This is decided once, for all of them.
struct PartSigns {
    Sign method = Sign::normals;       ///< or `winding`, of a closed mesh, or `flood`, which leaves distances unsigned
    std::string reason = asRequested;  ///< as chooseSign() states it
    std::string name{};                ///< of the method in the metadata; empty: that of `method`
    NormalsCheck check = NormalsCheck::none;
    /// The sums of all crossings below the part, of the columns of all blocks that it fills. Needed by `winding` and
    /// by a check.
    const ColumnSums* below = nullptr;
};

/// How many signs of a part's leaves contradict winding numbers.
struct ComparedSigns {
    std::size_t leaves = 0;      ///< except those without a voxel in the band and all on one side
    SignRepair everyFifth, all;  ///< in one column of five; in all columns
};

/// What a part needs of the whole field. The boxes end at borders of bricks, or at `unbounded` where no part follows.
struct FieldPart {
    Bounds mesh;             ///< bounds of the whole mesh
    std::uint64_t meshHash;  ///< of the whole mesh; 0: not known
    BlockBox lattice;        ///< contains all blocks of the whole field
    BlockBox own;            ///< the part's blocks
    /// The numbers in the whole mesh of the part's triangles, in ascending order.
    std::span<const std::uint32_t> triangles;
    PartSigns signs{};

    /// Returns the blocks to fill: the part's own, and the next layer above it along each axis. Pairs of voxels across
    /// a border are compared by the lower one of two parts, so every pair is compared once.
    BlockBox filled() const;
};

/// Sides of the surface on which some voxels lie.
struct VoxelSides {
    bool outside = false, inside = false;
};
/// On the faces of a box: lower x, y, z, then upper x, y, z.
using FaceSides = std::array<VoxelSides, 6>;

/// A part of a field when it is filled.
struct FilledPart {
    std::shared_ptr<Grids> grids;    ///< possibly without any leaf
    std::size_t conflicts = 0;       ///< with a conflict, the signs are not those of the whole field
    ComparedSigns compared{};        ///< if the part checks its normals
    FaceSides faces{};               ///< faceSides()
    openvdb::FloatTree::Ptr border;  ///< borderOf()
};

/// Gives the space between the leaves of a part its sign, as far as the part fills. Any leaf determines the sign of all
/// space that is connected to it, and in a box each such space is connected to some leaf, if there is one.
/// @param exterior, interior  values of space [m]
void floodPart(openvdb::FloatTree& tree, const FieldPart& part, float exterior, float interior);

/// Returns on which sides the outermost voxels of the part's own box lie. Call this after floodPart().
FaceSides faceSides(const openvdb::FloatTree& tree, const FieldPart& part);

/// Returns the first voxels above the part's own box, which the cells between its last blocks and the next ones need.
/// All other values are those of space. Call this after floodPart() and before trimToPart().
openvdb::FloatTree::Ptr borderOf(const openvdb::FloatTree& tree, const FieldPart& part);

/// Removes what lies outside the part's own box.
void trimToPart(openvdb::FloatTree& tree, const FieldPart& part);

/// Replaces the numbers of triangles by those in the whole mesh.
void renumber(openvdb::Int32Tree& tree, const FieldPart& part);

/// Removes the triangles of voxels without an active distance. These were active for the wider of the two widths of the
/// band, and lie outside of it on their final side.
void keepActive(openvdb::Int32Tree& triangles, const openvdb::FloatTree& distances);

}  // namespace bilayer::detail
