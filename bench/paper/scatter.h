// SPDX-License-Identifier: Apache-2.0
// AWPN, the method that the paper uses as ground truth and as its rival on one core. A serial program of the same kind:
// a dense grid, triangle by triangle. J. A. Baerentzen, H. Aanaes, "Signed distance computation using the angle
// weighted pseudonormal", IEEE Transactions on Visualization and Computer Graphics 11 (2005) 243-253, the paper's [33].
#pragma once

#include "bench/paper/dense.h"

namespace bilayer::paper {

/// Distances to the nearest triangle in double precision. Each triangle visits the nodes of the box around it. It skips
/// nodes whose distance to its plane exceeds the band or their current distance. Signs come from the angle-weighted
/// pseudonormal of the closest face, edge or vertex; far signs from scan conversion.
/// @param mesh  closed, oriented, welded
/// @param band  nodes nearer than this have a distance [steps]
/// Throws as validate() does, and std::invalid_argument for an edge that does not have exactly two triangles.
DenseField scatterPseudonormal(const Mesh& mesh, const Lattice& lattice, float band);

}  // namespace bilayer::paper
