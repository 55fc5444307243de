// Both layers of one 8x8x8 block and the signed distances between them (section 3.2 and Eq. 3 of the paper).
//
// The block is taken in cubes of 4x4x4 voxels, whose squared distances to both layers stay in registers while all runs
// of samples that reach the cube are applied. Large groups of runs are left out where none of their samples can be
// nearer than what the others gave.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "sdf/blocks.h"
#include "sdf/layer_samples.h"

namespace bilayer {

/// What reaches a block.
struct LayerBlockInput {
    std::span<const std::uint32_t> reaching;  ///< indices of groups
    const LayerSamples& samples;
    glm::vec3 inBrick;  ///< the block's first voxel in the voxels of the brick
    const FillParameters& parameters;
};

/// Groups of a block in columns, and those of each of its cubes. Memory is used again from block to block.
struct LayerScratch {
    std::vector<float> columns;
    std::vector<std::uint32_t> groups;
};

/// Fills a block with signed distances [voxels]; +infinity where unknown.
/// @param triangles  if not null, receives the owners of the samples that decide
void fillLayerBlock(const LayerBlockInput& input, LayerScratch& scratch, float* distances, std::int32_t* triangles);

}  // namespace bilayer
