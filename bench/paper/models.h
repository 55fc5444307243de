// The paper's models and the grids that they are put into.
//
// Its grids of 72, 126, 251, 501 and 715 nodes along a side are 5 / 0.07, 5 / 0.04, 5 / 0.02, 5 / 0.01 and 5 / 0.007
// steps, and one node more; its grids of 834, 1001, 1251 and 1667 nodes along y are 5 / 0.006 to 5 / 0.003. So the box
// is a cube of side 5, and a longer grid has a finer step along y.
#pragma once

#include <optional>
#include <string>

#include "bench/paper/dense.h"

namespace bilayer::paper {

/// Side of the box that holds every model [m].
inline constexpr float boxSide = 5;

/// Nodes between the model and the end of the grid: K + 1 of the default K.
inline constexpr int marginNodes = 3;

/// A model that is there.
struct Model {
    std::string name;    ///< "bunny"
    std::string origin;  ///< where it is from, for the page
    Mesh mesh;
};

/// "bunny", "dragon", "circular box" or "screwdriver"; nothing if it is not here. Looks in the folder of the corpus
/// (the environment variable BILAYER_MESHES names another one), then in `fetched`.
/// @param fetched  the folder that ./run paper puts public meshes into
std::optional<Model> findModel(const std::string& name, const std::string& fetched);

/// The paper's grid of so many nodes along x, y and z.
Lattice latticeOf(const glm::ivec3& nodes);
inline Lattice latticeOf(int nodes) {
    return latticeOf(glm::ivec3(nodes));
}

/// The mesh in the middle of a grid, as large as the margin lets it be.
Mesh fitted(Mesh mesh, const Lattice& lattice);

/// The same, but stretched along each axis: as a grid of unlike steps over a cube sees it.
Mesh stretched(Mesh mesh, const Lattice& lattice);

/// The sphere of Table 5, which does not say how large it is: it fills the grid as other models do.
/// @param areaVariance  Eq. 5 [m^4]
Mesh unevenSphere(double areaVariance, const Lattice& lattice);

/// What the block-wise builder is asked for: nodes of the lattice are its voxels.
BuildOptions optionsFor(const Lattice& lattice, Method method, float halfWidth, int threads = 0);

}  // namespace bilayer::paper
