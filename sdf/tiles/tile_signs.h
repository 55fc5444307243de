// SPDX-License-Identifier: Apache-2.0
// The signs of all tiles of a field. They are decided from the mesh, before any tile is built, and again from what all
// tiles have counted.
// Tested by tests/sdf/tile_signs.cpp.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>

#include "sdf/tiles/tile_build.h"
#include "sdf/tiles/triangle_source.h"

namespace bilayer::detail {

/// A mesh and the signs of its tiles.
struct SignedSource {
    std::unique_ptr<TriangleSource> source;  ///< perhaps with flipped triangles
    PartSigns signs;                         ///< without sums
};

/// Returns the signs that build() chooses for a mesh.
/// @param round            how often normals have contradicted each other, for Sign::automatic
/// @param beforeOrienting  called before what needs several times the memory of the mesh; may throw
/// Throws std::invalid_argument that names what tiles cannot do: signs of open meshes by winding numbers.
SignedSource decideSigns(Mesh mesh, const BuildOptions& options, int round,
                         const std::function<void()>& beforeOrienting);

/// The same for a mesh that is not read whole. Throws if the signs cannot be found without orienting the mesh.
SignedSource decideSigns(std::unique_ptr<TriangleSource> source, const BuildOptions& options, int round);

/// Returns the options of the tiles with these signs: a flood needs distances farther from the surface than others.
BuildOptions optionsWith(BuildOptions options, const PartSigns& signs);

/// What the counts of all tiles mean.
enum class SignVerdict {
    right,     ///< the signs are those of build()
    wrong,     ///< some must be corrected, and can be
    conflict,  ///< build() would choose other signs
};
SignVerdict judge(const SignCounts& sum);

/// Returns the sum of counts.
SignCounts sumOf(std::span<const SignCounts> counts);

/// Returns the signs of tiles that correct what they counted.
PartSigns corrected(const PartSigns& counted, const SignCounts& sum);

}  // namespace bilayer::detail
