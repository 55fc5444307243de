// SPDX-License-Identifier: Apache-2.0
// The two layers of one 8x8x8 block and the signed distances between them (section 3.2 and Eq. 3 of the paper).
//
// The block is processed in cubes of 4x4x4 voxels. The layer points that reach a cube are selected from the surrounding
// cells. While these points are applied, the voxels' nearest points stay in registers.
// Tested by tests/sdf/double_layer.cpp through build().
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "sdf/fill/layer_samples.h"
#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// The input for filling a block.
struct LayerBlockInput {
    const LayerSamples& samples;
    glm::ivec3 inBrick;  ///< the block's first voxel in brick voxels
    const FillParameters& parameters;
};

/// The two layers around a cube, relative to its centre. Reuses its memory for each cube.
struct LayerScratch {
    struct Layer {
        std::array<std::vector<float>, 4> columns;
        std::vector<std::uint32_t> picked;
    };
    Layer inner, outer;
    std::vector<LayerSamples::SampleRange> near;
    std::size_t undecided = 0;  ///< voxels so far that are off the surface and equally near to both layers
};

/// Fills a block with signed distances [voxels]; +infinity where unknown. Returns whether any sample reaches the block;
/// otherwise writes nothing.
/// @param triangles  if not null, receives the triangles of the nearest samples
bool fillLayerBlock(const LayerBlockInput& input, LayerScratch& scratch, float* distances, std::int32_t* triangles);

}  // namespace bilayer::detail
