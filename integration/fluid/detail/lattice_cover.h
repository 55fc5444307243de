// SPDX-License-Identifier: Apache-2.0
// Whether a body is wide enough for the voxels of a lattice, wherever the lattice falls.
#pragma once

#include <glm/vec3.hpp>

#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {
class Progress;
}

namespace bilayer::fluid::detail {

/// A wide place of a body: a ball inside, into which no triangle reaches.
struct WidePlace {
    double widthVoxels = 0;  ///< diameter of the ball; 0: nothing is inside
    glm::dvec3 centre{0};    ///< [voxels]
};

/// A ball of this width holds a voxel's centre wherever the lattice falls, and so does every body that contains it
/// [voxels].
inline constexpr double coveringWidthVoxels = 2.17;

/// Tests whether every lattice of voxels has a voxel inside of a body. Points are inside if their winding number is
/// above one half. The answers depend on the body, its rotation and its size in voxels, not on its position. The mesh
/// must be valid and face outward (see orient()).
class LatticeCover {
  public:
    /// Keeps a reference to the mesh.
    /// @param mesh      in voxels
    /// @param progress  polled for cancellation, unless null
    LatticeCover(const Mesh& mesh, bilayer::detail::Progress* progress) : mesh_(mesh), progress_(progress) {}

    /// Whether the body holds a voxel's centre wherever the lattice falls. Tries 64 lattices, a quarter of a voxel
    /// apart along each axis. Any other lattice is at most 0.22 voxels away from one of these. So in each of the 64, a
    /// voxel must be that deep inside. A plate along the lattice is thus wide enough from 1.44 voxels on.
    bool isComplete() const;

    /// The widest place that hill climbing from some of the triangles finds. The body may have a wider one.
    WidePlace widestPlace() const;

  private:
    const Mesh& mesh_;
    bilayer::detail::Progress* progress_;
};

}  // namespace bilayer::fluid::detail
