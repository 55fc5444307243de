// SPDX-License-Identifier: Apache-2.0
// Builds a narrow-band signed distance field from a triangle mesh.
//
// Method: Y. Wu, J. Man, Z. Xie, "A double layer method for constructing signed distance fields from triangle meshes",
// Graphical Models 76 (2014) 214-223. docs/method.md describes the implementation and its differences from the paper.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>
#include <bilayer/sdf/options.h>

namespace bilayer {

namespace detail {
struct Access;
struct DeviceFiller;
}  // namespace detail

/// A device that fills the blocks of a field. openclFiller() in cl/filler.h makes one; build() uses the CPU by default.
/// Cheap to copy.
class BlockFiller {
  public:
    const std::string& backend() const;  ///< "opencl"
    const std::string& device() const;   ///< the device's name

  private:
    friend struct detail::Access;
    explicit BlockFiller(detail::DeviceFiller filler);

    std::shared_ptr<const detail::DeviceFiller> data_;
};

/// Builds the signed distance field of a mesh. The bytes of the result do not depend on the thread count.
/// @param filler  the device that fills the blocks; null: the CPU, by TBB
///
/// Throws std::invalid_argument that names the invalid option or triangle, Cancelled, and what the filler throws.
LevelSet build(const Mesh& mesh, const BuildOptions& options, const BlockFiller* filler = nullptr);
/// The same by a device.
LevelSet build(const Mesh& mesh, const BuildOptions& options, const BlockFiller& filler);

/// Updates the field of a mesh after some of its triangles have moved. Fills only the blocks within reach of the old or
/// new positions of those triangles, and copies all others. The bytes equal those of build(newMesh, options).
///
/// An update requires all of the following; otherwise rebuild() builds the whole field:
/// - Method::exact;
/// - Sign::normals, or Sign::automatic where it selects normals;
/// - widths of more than one voxel;
/// - a field as build() made it, not swept or rounded since, without sign conflicts;
/// - no union (BuildOptions::unite);
/// - at most half of the triangles in `moved`.
/// @param old      the field of `oldMesh`, built with the same options
/// @param newMesh  has as many triangles as `oldMesh`
/// @param moved    indices of all triangles with a corner that moved, in any order; may contain others
///
/// Throws as build() does. Also throws std::invalid_argument if:
/// - the field belongs to another mesh, voxel size, method or width;
/// - the field lacks the nearest triangles that the options request;
/// - the triangle counts differ;
/// - an index is out of range;
/// - a triangle has moved but is not in `moved` (the error names the first one).
LevelSet rebuild(const LevelSet& old, const Mesh& oldMesh, const Mesh& newMesh, std::span<const std::uint32_t> moved,
                 const BuildOptions& options);

/// Returns the voxel size that puts `resolution` voxels along the longest side of the mesh's bounds [m]. Throws
/// std::invalid_argument for a resolution that is not positive or a mesh without extent.
float voxelSizeFor(const Mesh& mesh, float resolution);

}  // namespace bilayer
