// SPDX-License-Identifier: Apache-2.0
// A part of a field: the blocks of a box. It is filled from the triangles near the box alone, by the code that fills
// whole fields.
// Tested by tests/sdf/field_tiles.cpp.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include <bilayer/sdf/mesh.h>
#include "sdf/base/openvdb.h"
#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// What a part needs of the whole field. The boxes end at borders of bricks, or at `unbounded` where no part follows.
struct FieldPart {
    Bounds mesh;             ///< bounds of the whole mesh
    std::uint64_t meshHash;  ///< of the whole mesh; 0: not known
    BlockBox lattice;        ///< contains all blocks of the whole field
    BlockBox own;            ///< the part's blocks
    /// The numbers in the whole mesh of the part's triangles, which ascend.
    std::span<const std::uint32_t> triangles;

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

}  // namespace bilayer::detail
