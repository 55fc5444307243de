// From filled blocks to grids. Heavy: it includes OpenVDB.
#pragma once

#include <oneapi/tbb/enumerable_thread_specific.h>
#include <openvdb/openvdb.h>

#include <cstddef>
#include <memory>
#include <vector>

#include "sdf/band.h"
#include "sdf/blocks.h"

namespace bilayer {

/// Collects filled blocks as leaves and joins them into trees; where a leaf goes follows from its origin, so no thread
/// changes the result.
class Assembler {
  public:
    /// @param triangles  whether blocks bring their nearest triangles
    Assembler(const BandWidths& widths, bool triangles) : widths_(widths), wantTriangles_(triangles) {}

    /// Takes blocks over. Safe from any thread.
    void take(const FilledBlocks& blocks);

    /// The level set of all blocks, with the signs of the space between them. Call once, after the last block.
    openvdb::FloatGrid::Ptr distances();

    /// The nearest triangles of its active voxels; null unless asked for. Call once.
    openvdb::Int32Grid::Ptr triangles();

  private:
    template <class Leaf>
    using PerThread = tbb::enumerable_thread_specific<std::vector<std::unique_ptr<Leaf>>>;
    using Leaf = openvdb::FloatTree::LeafNodeType;
    using TriangleLeaf = openvdb::Int32Tree::LeafNodeType;

    BandWidths widths_;
    bool wantTriangles_;
    PerThread<Leaf> leaves_;
    PerThread<TriangleLeaf> triangleLeaves_;
};

/// Counts the neighbouring voxels on different sides of the surface that have no room for it between them: their
/// distances together exceed a voxel. None in the field of a closed, oriented mesh that does not meet itself. Only
/// pairs in different blocks count: inside a block sides agree by construction. The space outside all blocks must be
/// outside.
std::size_t countConflicts(const openvdb::FloatGrid& grid);

}  // namespace bilayer
