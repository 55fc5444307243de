// SPDX-License-Identifier: Apache-2.0
// The paper's program as published: dense grids, triangle by triangle, single-threaded. It is the reference of the
// block-wise method in time and values.
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

/// Value that stands for infinity (section 3.1) [m].
inline constexpr float farAway = 1e9f;

/// The paper's parameters, with its defaults.
struct DenseOptions {
    float delta = 0.5f;                           ///< [steps]
    float epsilon = 1;                            ///< [steps^2]
    int neighbourhood = 2;                        ///< K
    int maxSubdivision = 32;                      ///< n_max of Algorithm 1
    Subdivision subdivision = Subdivision::rows;  ///< Algorithm 1, or Fig. 2
    bool shareRows = true;  ///< section 4.2: computes squares of x and y once per row, not once per node
    /// The nearest node of a sample is floor(position + this). The paper uses one half; the tests shift it slightly
    /// either way.
    float half = 0.5f;
};

/// A signed distance field on a dense lattice.
struct DenseField {
    Lattice lattice;
    std::vector<float> phi;      ///< [m]; +-farAway where no sample reaches
    std::size_t samples = 0;     ///< of all triangles
    std::size_t maxSamples = 0;  ///< maximum of one triangle
};

/// The method as printed, except for one erratum. The scan conversion of section 3.3 sets phi(k + 1) where it is ">
/// -infinity", which would overwrite everything outside; the code reads it as "= +infinity". Two grids are kept
/// (section 4.2). Triangles without area produce no samples. Throws as validate() does, and std::bad_alloc.
DenseField denseDoubleLayer(const Mesh& mesh, const Lattice& lattice, const DenseOptions& options = {});

/// Section 3.3: along z, far nodes after an inside node become -farAway until the next surface crossing.
void scanConvert(DenseField& field);

}  // namespace bilayer::paper
