// SPDX-License-Identifier: Apache-2.0
// The paper's models and grids.
//
// Its grids of 72, 126, 251, 501 and 715 nodes along a side are 5 / 0.07, 5 / 0.04, 5 / 0.02, 5 / 0.01 and 5 / 0.007
// steps, plus one node. Its grids of 834, 1001, 1251 and 1667 nodes along y are 5 / 0.006 to 5 / 0.003. So the box is a
// cube of side 5, and a longer grid has a finer step along y.
#pragma once

#include <optional>
#include <string>

#include "bench/paper/dense.h"

namespace bilayer::paper {

/// Side of the box that holds every model [m].
inline constexpr float boxSide = 5;

/// Nodes between the model and the border of the grid: K + 1 for the default K.
inline constexpr int marginNodes = 3;

/// An available model.
struct Model {
    std::string name;    ///< "bunny"
    std::string origin;  ///< its origin, for the page
    Mesh mesh;
};

/// Finds "bunny", "dragon", "circular box" or "screwdriver"; returns nothing if it is absent. Searches the folder of
/// the corpus first (the environment variable BILAYER_MESHES overrides it), then `fetched`.
/// @param fetched  the folder into which ./run paper downloads public meshes
std::optional<Model> findModel(const std::string& name, const std::string& fetched);

/// The paper's grid of this many nodes along x, y and z.
Lattice latticeOf(const glm::ivec3& nodes);
inline Lattice latticeOf(int nodes) {
    return latticeOf(glm::ivec3(nodes));
}

/// The mesh centred in a grid, as large as the margin allows.
Mesh fitted(Mesh mesh, const Lattice& lattice);

/// The same, but scaled separately along each axis: as a grid of different steps over a cube sees it.
Mesh stretched(Mesh mesh, const Lattice& lattice);

/// The sphere of Table 5. The paper does not give its size; it fills the grid as other models do.
/// @param areaVariance  Eq. 5 [m^4]
Mesh unevenSphere(double areaVariance, const Lattice& lattice);

/// Options of the block-wise builder: its voxels are the nodes of the lattice.
BuildOptions optionsFor(const Lattice& lattice, Method method, float halfWidth, int threads = 0);

}  // namespace bilayer::paper
