// Both layers of one 8x8x8 block and the signed distances between them (section 3.2 and Eq. 3 of the paper).
//
// The block is taken in cubes of 4x4x4 voxels. The points of both layers that reach a cube are picked from the cells
// around it, then the voxels' nearest ones are kept in registers while all picked points are applied.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "sdf/fill/layer_samples.h"
#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// What a block is filled from.
struct LayerBlockInput {
    const LayerSamples& samples;
    glm::ivec3 inBrick;  ///< the block's first voxel in the voxels of the brick
    const FillParameters& parameters;
};

/// Both layers around a cube, seen from its middle. Memory is used again from cube to cube.
struct LayerScratch {
    struct Layer {
        std::array<std::vector<float>, 4> columns;
        std::vector<std::uint32_t> picked;
    };
    Layer inner, outer;
    std::vector<LayerSamples::Range> near;
};

/// Fills a block with signed distances [voxels]; +infinity where unknown. Returns whether any sample reaches the block;
/// else nothing is written.
/// @param triangles  if not null, receives the owners of the samples that decide
bool fillLayerBlock(const LayerBlockInput& input, LayerScratch& scratch, float* distances, std::int32_t* triangles);

}  // namespace bilayer::detail
