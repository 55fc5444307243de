// From a triangle mesh to a narrow-band signed distance field.
//
// Method: Y. Wu, J. Man, Z. Xie, "A double layer method for constructing signed distance fields from triangle meshes",
// Graphical Models 76 (2014) 214-223. docs/method.md tells how it is done here and where it departs from the paper.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>
#include <bilayer/sdf/options.h>

namespace bilayer {

namespace detail {
struct FillJob;
}

/// Fills the blocks of a field on some device: openclFiller() in cl/filler.h makes one. Without it the processor does.
struct BlockFiller {
    std::string backend;  ///< "opencl"
    std::string device;   ///< the device's name
    /// Throws what the device's trouble calls for; the build then ends with it.
    std::function<void(const detail::FillJob&)> fill;
};

/// What a build took: the seconds of its parts, and blocks.
struct BuildTimes {
    double tiles = 0;     ///< triangles to tiles of samples, or the choice of the way to signs
    double fill = 0;      ///< binning into blocks, distances
    double assemble = 0;  ///< leaves into the tree, far signs, signs by winding number or flood
    double total = 0;
    /// Blocks of 8x8x8 voxels whose distances were computed, over again for each go at the signs; rebuild() copies all
    /// others.
    std::size_t filledBlocks = 0;
};

/// Builds the field of a mesh. The bytes of the result do not depend on the number of threads.
/// @param filler  where the blocks are filled; null: TBB
/// @param times   if not null, receives what it took
/// Throws std::invalid_argument that names the option or triangle at fault, Cancelled, and what the filler throws.
LevelSet build(const Mesh& mesh, const BuildOptions& options, const BlockFiller* filler = nullptr,
               BuildTimes* times = nullptr);
LevelSet build(const Mesh& mesh, const BuildOptions& options, const BlockFiller& filler, BuildTimes* times = nullptr);

/// Builds the field of a mesh of which a part has moved, from the field before: only the blocks that the moved
/// triangles reach from their old or new places are filled, all others are copied. The bytes are those of
/// build(newMesh, options).
///
/// That needs Method::exact, Sign::normals (or automatic, where it comes to normals), widths of more than a voxel, and
/// a field as it was built (not swept or rounded since) in which nothing contradicted itself. For all else, for unions
/// (BuildOptions::unite), and where most triangles have moved, it builds in full.
/// @param old      the field of `oldMesh`, built with the same options
/// @param newMesh  as many triangles as `oldMesh`
/// @param moved    indices of all triangles with a corner that moved, in any order; more do no harm
/// Throws as build() does, and std::invalid_argument if the field is of another mesh, voxel size, method or width, or
/// lacks the nearest triangles that the options ask for; if the numbers of triangles differ; if an index is out of
/// range; if a triangle has other corners without being in `moved` (the first one is named).
LevelSet rebuild(const LevelSet& old, const Mesh& oldMesh, const Mesh& newMesh, std::span<const std::uint32_t> moved,
                 const BuildOptions& options, BuildTimes* times = nullptr);

/// The voxel size that puts `resolution` voxels along the longest side of the mesh's bounds [m].
/// Throws std::invalid_argument for a resolution that is not positive or a mesh without extent.
float voxelSizeFor(const Mesh& mesh, float resolution);

}  // namespace bilayer
