// From filled blocks to grids. Heavy: it includes OpenVDB.
#pragma once

#include <oneapi/tbb/enumerable_thread_specific.h>
#include <openvdb/openvdb.h>

#include <array>
#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

#include <bilayer/sdf/grids.h>
#include "sdf/leaf/band.h"
#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// Which voxels on the six faces of a block are inside: lower x, y, z, then upper x, y, z. The bits of a face run in
/// the order of the block's voxels.
using FaceBits = std::array<std::uint64_t, 6>;

/// Collects filled blocks as leaves and joins them into trees; where a leaf goes follows from its origin, so no thread
/// changes the result.
class Assembler {
  public:
    /// What becomes of a block without a voxel of the band, all on one side.
    enum class Plain {
        keep,  ///< it tells the side of the space around it
        drop,  ///< that follows from its neighbours, as bands wider than a voxel surround all of the surface
    };

    /// @param triangles  whether blocks bring their nearest triangles
    /// @param progress   polled while leaves are joined
    Assembler(const BandWidths& widths, bool triangles, Plain plain, Progress& progress)
        : widths_(widths), wantTriangles_(triangles), plain_(plain), progress_(progress) {}

    /// Takes blocks over. Safe from any thread.
    void take(const FilledBlocks& blocks);

    /// Takes a copy of the leaves of an earlier result whose origins `keep` accepts; called from all threads at once.
    void copy(const Grids& from, const std::function<bool(const openvdb::Coord&)>& keep);

    /// The level set of all blocks, with the signs of the space between them. Call once, after the last block. Throws
    /// Cancelled.
    openvdb::FloatGrid::Ptr distances();

    /// The nearest triangles of its active voxels; null unless asked for. Call once. Throws Cancelled.
    openvdb::Int32Grid::Ptr triangles();

    /// Counts the neighbouring voxels in what distances() gave that are on different sides of the surface without room
    /// for it between them: their distances together exceed a voxel. None in the field of a closed, oriented mesh that
    /// does not meet itself. Only pairs in different blocks count: what contradicts itself inside a block is known to
    /// completeSides() in links.h. The space outside all blocks must be outside.
    std::size_t conflicts(const openvdb::FloatGrid& distances) const;

  private:
    using Leaf = openvdb::FloatTree::LeafNodeType;
    using TriangleLeaf = openvdb::Int32Tree::LeafNodeType;
    struct Collected {
        std::unique_ptr<Leaf> leaf;
        FaceBits faces;
        bool plain;  // all on one side, and nothing of it in the band
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
    PerThread<Collected> leaves_;
    PerThread<std::unique_ptr<TriangleLeaf>> triangleLeaves_;
    std::vector<FaceBits> faces_;  // of each leaf; its transient data is the index
};

}  // namespace bilayer::detail
