// SPDX-License-Identifier: Apache-2.0
// OpenVDB's grids for the sources of this project. Declares as extern what OpenVDB's library has compiled, so that it
// is not compiled again.
//
// Every file that creates a grid would compile the virtual functions of its tree: reading, writing, counting, ten
// seconds for each type of grid. The library has them for the types that openvdb::initialize() registers.
// Tested by tests/sdf/vdb_io.cpp.
#pragma once

#include <openvdb/openvdb.h>

#include <glm/vec3.hpp>

// The signatures are those of version 10; the thread sanitizer does not see into the library.
#if OPENVDB_LIBRARY_MAJOR_VERSION_NUMBER == 10 && defined(OPENVDB_USE_EXPLICIT_INSTANTIATION) && defined(__GNUC__) && \
    !defined(__SANITIZE_THREAD__)
#define BILAYER_COMPILED_TREE(Root)                                                                                   \
    extern template bool openvdb::tree::Tree<Root>::evalLeafBoundingBox(openvdb::CoordBBox&) const;                   \
    extern template bool openvdb::tree::Tree<Root>::evalActiveVoxelBoundingBox(openvdb::CoordBBox&) const;            \
    extern template bool openvdb::tree::Tree<Root>::evalActiveVoxelDim(openvdb::Coord&) const;                        \
    extern template bool openvdb::tree::Tree<Root>::evalLeafDim(openvdb::Coord&) const;                               \
    extern template void openvdb::tree::Tree<Root>::readTopology(std::istream&, bool);                                \
    extern template void openvdb::tree::Tree<Root>::writeTopology(std::ostream&, bool) const;                         \
    extern template void openvdb::tree::Tree<Root>::readBuffers(std::istream&, bool);                                 \
    extern template void openvdb::tree::Tree<Root>::readBuffers(std::istream&, const openvdb::CoordBBox&, bool);      \
    extern template void openvdb::tree::Tree<Root>::readNonresidentBuffers() const;                                   \
    extern template void openvdb::tree::Tree<Root>::writeBuffers(std::ostream&, bool) const;                          \
    extern template void openvdb::tree::Tree<Root>::print(std::ostream&, int) const;                                  \
    extern template void openvdb::tree::Tree<Root>::clipUnallocatedNodes();                                           \
    extern template openvdb::Index32 openvdb::tree::Tree<Root>::unallocatedLeafCount() const;                         \
    extern template openvdb::Index32 openvdb::tree::Tree<Root>::leafCount() const;                                    \
    extern template openvdb::Index32 openvdb::tree::Tree<Root>::nonLeafCount() const;                                 \
    extern template std::vector<openvdb::Index32> openvdb::tree::Tree<Root>::nodeCount() const;                       \
    extern template openvdb::Index64 openvdb::tree::Tree<Root>::activeLeafVoxelCount() const;                         \
    extern template openvdb::Index64 openvdb::tree::Tree<Root>::inactiveLeafVoxelCount() const;                       \
    extern template openvdb::Index64 openvdb::tree::Tree<Root>::activeVoxelCount() const;                             \
    extern template openvdb::Index64 openvdb::tree::Tree<Root>::inactiveVoxelCount() const;                           \
    extern template openvdb::Index64 openvdb::tree::Tree<Root>::activeTileCount() const;                              \
    extern template openvdb::Index64 openvdb::tree::Tree<Root>::memUsage() const;                                     \
    extern template void openvdb::tree::Tree<Root>::getIndexRange(openvdb::CoordBBox&) const;                         \
    extern template openvdb::TreeBase::Ptr openvdb::tree::Tree<Root>::copy() const;                                   \
    extern template openvdb::Metadata::Ptr openvdb::tree::Tree<Root>::getBackgroundValue() const;                     \
    extern template openvdb::GridBase::Ptr openvdb::Grid<openvdb::tree::Tree<Root>>::copyGrid();                      \
    extern template openvdb::GridBase::ConstPtr openvdb::Grid<openvdb::tree::Tree<Root>>::copyGrid() const;           \
    extern template openvdb::GridBase::Ptr openvdb::Grid<openvdb::tree::Tree<Root>>::copyGridWithNewTree() const;     \
    extern template openvdb::GridBase::ConstPtr openvdb::Grid<openvdb::tree::Tree<Root>>::copyGridReplacingMetadata(  \
        const openvdb::MetaMap&) const;                                                                               \
    extern template openvdb::GridBase::ConstPtr openvdb::Grid<openvdb::tree::Tree<Root>>::copyGridReplacingTransform( \
        openvdb::math::Transform::Ptr) const;                                                                         \
    extern template openvdb::GridBase::Ptr openvdb::Grid<openvdb::tree::Tree<Root>>::deepCopyGrid() const;            \
    extern template bool openvdb::Grid<openvdb::tree::Tree<Root>>::empty() const;                                     \
    extern template void openvdb::Grid<openvdb::tree::Tree<Root>>::clear();                                           \
    extern template void openvdb::Grid<openvdb::tree::Tree<Root>>::pruneGrid(float);                                  \
    extern template void openvdb::Grid<openvdb::tree::Tree<Root>>::clip(const openvdb::CoordBBox&);                   \
    extern template openvdb::Index64 openvdb::Grid<openvdb::tree::Tree<Root>>::activeVoxelCount() const;              \
    extern template openvdb::CoordBBox openvdb::Grid<openvdb::tree::Tree<Root>>::evalActiveVoxelBoundingBox() const;  \
    extern template openvdb::Coord openvdb::Grid<openvdb::tree::Tree<Root>>::evalActiveVoxelDim() const;              \
    extern template openvdb::Index64 openvdb::Grid<openvdb::tree::Tree<Root>>::memUsage() const;                      \
    extern template void openvdb::Grid<openvdb::tree::Tree<Root>>::setTree(openvdb::TreeBase::Ptr);                   \
    extern template void openvdb::Grid<openvdb::tree::Tree<Root>>::newTree();                                         \
    extern template void openvdb::Grid<openvdb::tree::Tree<Root>>::readTopology(std::istream&);                       \
    extern template void openvdb::Grid<openvdb::tree::Tree<Root>>::writeTopology(std::ostream&) const;                \
    extern template void openvdb::Grid<openvdb::tree::Tree<Root>>::readBuffers(std::istream&);                        \
    extern template void openvdb::Grid<openvdb::tree::Tree<Root>>::readBuffers(std::istream&,                         \
                                                                               const openvdb::CoordBBox&);            \
    extern template void openvdb::Grid<openvdb::tree::Tree<Root>>::readNonresidentBuffers() const;                    \
    extern template void openvdb::Grid<openvdb::tree::Tree<Root>>::writeBuffers(std::ostream&) const;                 \
    extern template void openvdb::Grid<openvdb::tree::Tree<Root>>::print(std::ostream&, int) const;
#else
#define BILAYER_COMPILED_TREE(Root)
#endif

BILAYER_COMPILED_TREE(openvdb::BoolTree::RootNodeType)
BILAYER_COMPILED_TREE(openvdb::MaskTree::RootNodeType)
BILAYER_COMPILED_TREE(openvdb::Int32Tree::RootNodeType)
BILAYER_COMPILED_TREE(openvdb::FloatTree::RootNodeType)
BILAYER_COMPILED_TREE(openvdb::DoubleTree::RootNodeType)
BILAYER_COMPILED_TREE(openvdb::Vec3STree::RootNodeType)

namespace bilayer::detail {

/// Returns a voxel's index as OpenVDB has it.
inline openvdb::Coord coordOf(const glm::ivec3& voxel) {
    return {voxel.x, voxel.y, voxel.z};
}

}  // namespace bilayer::detail
