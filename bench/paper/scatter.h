// The method that the paper takes for the truth and for its rival on one core, AWPN, as a serial program of the same
// kind: a dense grid, triangle by triangle. J. A. Baerentzen, H. Aanaes, "Signed distance computation using the angle
// weighted pseudonormal", IEEE Transactions on Visualization and Computer Graphics 11 (2005) 243-253, the paper's [33].
#pragma once

#include "bench/paper/dense.h"

namespace bilayer::paper {

/// Distances to the nearest triangle in double precision: each triangle measures the nodes of the box around it, but
/// for those that its plane says are farther than the band or than what they have. Signs by the angle-weighted
/// pseudonormal of the closest face, edge or vertex; far ones by scan conversion.
/// @param mesh  closed, oriented, welded
/// @param band  nodes nearer than this have a distance [steps]
/// Throws as validate() does, and std::invalid_argument where an edge is not one of two triangles.
DenseField scatterPseudonormal(const Mesh& mesh, const Lattice& lattice, float band);

}  // namespace bilayer::paper
