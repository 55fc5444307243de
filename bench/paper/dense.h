// The paper's own program, written down as it is told there: dense grids, one triangle after the other, one thread.
// What the block-wise method is compared with, in time and value by value.
//
// Y. Wu, J. Man, Z. Xie, "A double layer method for constructing signed distance fields from triangle meshes",
// Graphical Models 76 (2014) 214-223.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <vector>

#include <bilayer/sdf/build.h>

namespace bilayer::paper {

/// Nodes at `index * step`, from index (0, 0, 0) on.
struct Lattice {
    glm::ivec3 nodes{0};  ///< along each axis
    float step = 0;       ///< Delta [m]

    std::size_t count() const { return std::size_t(nodes.x) * std::size_t(nodes.y) * std::size_t(nodes.z); }
    std::size_t index(int i, int j, int k) const { return (std::size_t(i) * nodes.y + j) * nodes.z + k; }
};

/// What stands for infinity (section 3.1) [m].
inline constexpr float farAway = 1e9f;

/// The paper's parameters; the defaults are its own.
struct DenseOptions {
    float delta = 0.5f;                           ///< [steps]
    float epsilon = 1;                            ///< [steps^2]
    int neighbourhood = 2;                        ///< K
    int maxSubdivision = 32;                      ///< n_max of Algorithm 1
    Subdivision subdivision = Subdivision::rows;  ///< Algorithm 1, or Fig. 2
    bool shareRows = true;  ///< section 4.2: squares of x and y are taken once a row, not once a node
    /// A sample's nearest node is floor(place + this). A half is the paper's; the tests lean it to either side.
    float half = 0.5f;
};

/// A signed distance field on a dense lattice.
struct DenseField {
    Lattice lattice;
    std::vector<float> phi;      ///< [m]; +-farAway where no sample reaches
    std::size_t samples = 0;     ///< of all triangles
    std::size_t maxSamples = 0;  ///< of one triangle
};

/// The method as printed, but for one erratum: the scan conversion of section 3.3 sets phi(k + 1) where it ">
/// -infinity", which would overwrite all that is outside; read as "= +infinity". Two grids are kept (section 4.2).
/// Triangles without area give no sample. Throws as validate() does, and std::bad_alloc.
DenseField denseDoubleLayer(const Mesh& mesh, const Lattice& lattice, const DenseOptions& options = {});

/// Section 3.3: far nodes behind one inside, seen along z, become -farAway until the surface comes again.
void scanConvert(DenseField& field);

}  // namespace bilayer::paper
