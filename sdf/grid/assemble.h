// SPDX-License-Identifier: Apache-2.0
// Assembles filled blocks into grids. Expensive to include: it includes OpenVDB.
// Tested by tests/sdf/build.cpp through build().
#pragma once

#include <oneapi/tbb/enumerable_thread_specific.h>
#include <array>
#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

#include <bilayer/sdf/grids.h>
#include "sdf/base/openvdb.h"
#include "sdf/grid/field_part.h"
#include "sdf/leaf/band.h"
#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// The inside voxels on the six faces of a block: lower x, y, z, then upper x, y, z. The bits of a face are in the
/// order of the block's voxels.
using FaceBits = std::array<std::uint64_t, 6>;

/// Collects filled blocks as leaves and joins them into trees. The origin of a leaf determines its place, so the result
/// does not depend on the threads.
class Assembler {
  public:
    /// What to do with a block that has no voxel in the band and lies entirely on one side.
    enum class Plain {
        keep,  ///< keep it: it determines the sign of the space around it
        drop,  ///< drop it: its neighbours determine the sign, since bands wider than a voxel surround the whole
               ///< surface
    };

    /// @param triangles  whether blocks include their nearest triangles
    /// @param progress   polled while leaves are joined
    /// @param part      the part of the field that is filled; null: all of it
    Assembler(const BandWidths& widths, bool triangles, Plain plain, Progress& progress,
              const FieldPart* part = nullptr)
        : widths_(widths), wantTriangles_(triangles), plain_(plain), progress_(progress), part_(part) {}

    /// Adds filled blocks. Thread-safe.
    void take(const FilledBlocks& blocks);

    /// Copies the leaves of an earlier result, or of a part, whose origins satisfy `keep`, which is called concurrently
    /// from all threads.
    void copy(const Grids& from, const std::function<bool(const openvdb::Coord&)>& keep);

    /// Builds the level set of all blocks, with signs in the space between them. Call it once, after the last block. A
    /// part keeps its blocks without a voxel in the band: the merged field finds signs from them. Throws Cancelled.
    openvdb::FloatGrid::Ptr distances();
    /// The same for grids read from files, with their background values outside and inside as they are stored [m].
    openvdb::FloatGrid::Ptr distances(float exterior, float interior);

    /// Builds the grid of nearest triangles of the active voxels; null unless requested. Call it once. Throws
    /// Cancelled.
    openvdb::Int32Grid::Ptr triangles();

    /// Counts the sign conflicts in the result of distances(): pairs of neighbouring voxels on different sides whose
    /// distances sum to more than one voxel, so that no surface fits between them. The field of a closed, oriented mesh
    /// without self-intersections has none. Only pairs in different blocks count; completeSides() in sign_propagation.h
    /// reports the conflicts within a block. The space outside of all blocks must be outside. A part counts the pairs
    /// whose lower voxel is its own.
    std::size_t conflicts(const openvdb::FloatGrid& distances) const;

  private:
    using Leaf = openvdb::FloatTree::LeafNodeType;
    using TriangleGridLeaf = openvdb::Int32Tree::LeafNodeType;
    struct Collected {
        std::unique_ptr<Leaf> leaf;
        FaceBits faces;
        bool plain;  // entirely on one side, with no voxel in the band
    };
    struct Branch;
    template <class Item>
    using PerThread = tbb::enumerable_thread_specific<std::vector<Item>>;

    std::vector<Branch> branches();
    void grow(Branch& branch, float background);

    BandWidths widths_;
    bool wantTriangles_;
    Plain plain_;
    Progress& progress_;
    const FieldPart* part_;
    PerThread<Collected> leaves_;
    PerThread<std::unique_ptr<TriangleGridLeaf>> triangleLeaves_;
    std::vector<FaceBits> faces_;             // of each leaf; the leaf's transient data is the index
    std::vector<openvdb::Coord> largeTiles_;  // origins of those of the tree's largest nodes that may be inside
};

}  // namespace bilayer::detail
