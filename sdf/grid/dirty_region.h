// What a part of a mesh that moves can change of its field: the cells of space that the triangles which moved reach,
// from where they were or from where they are.
#pragma once

#include <openvdb/openvdb.h>

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>

#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

/// Throws std::invalid_argument if the numbers of triangles differ, an index is out of range, or a triangle has other
/// corners without being in `moved` (the first one is named). The meshes must be valid.
void checkMoved(const Mesh& before, const Mesh& after, std::span<const std::uint32_t> moved);

/// A set of cells of a lattice.
class DirtyRegion {
  public:
    /// The cells within reach of the triangles.
    /// @param side   of a cell [voxels], a power of two
    /// @param reach  how far from a triangle a voxel may lie [voxels]
    DirtyRegion(const Mesh& before, const Mesh& after, std::span<const std::uint32_t> moved, double voxelsPerUnit,
                float reach, int side);

    /// Whether a cube of voxels has part in any of the cells; its side is a power of two and its first voxel a multiple
    /// of that.
    bool any(const glm::ivec3& first, int side) const;

  private:
    void add(const Mesh& mesh, const glm::uvec3& triangle, double voxelsPerUnit, double reach,
             openvdb::tree::ValueAccessor<openvdb::MaskTree>& cells) const;

    int shift_;
    openvdb::MaskTree cells_;  // a voxel a cell
};

}  // namespace bilayer::detail
