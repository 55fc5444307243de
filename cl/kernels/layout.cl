// SPDX-License-Identifier: Apache-2.0
// A field laid out on a device, as in collider/field/layout/field_layout.h.
#include "common.cl"

// A block with its apron, the upper neighbours' voxels that complete its last cells.
#define STRIDE 9
#define BLOCK_FLOATS 729
// Entries of the directory that are not block numbers.
#define EMPTY_OUTSIDE -1
#define EMPTY_INSIDE -2
// Clearances: voxels along a coarse cell, coarse cells along a block, and the unit of stored distances.
#define COARSE_SIDE 4
#define COARSE_ALONG 2
#define CLEARANCE_STEPS 8

// FieldFrame of collider/field/layout/field_layout.h; metres and voxels as there.
typedef struct {
    double origin[3], perMetre;
    int blocks[3];
    float voxelSize, exteriorWidth, interiorWidth;
} Frame;

// Linear index; the last axis varies fastest.
size_t indexOf(int3 at, int3 size) {
    return ((size_t)(at.x) * size.y + at.y) * size.z + at.z;
}

int3 placeAt(uint index, int3 size) {
    const uint row = index / (uint)(size.z), slice = row / (uint)(size.y);
    return (int3)((int)(slice), (int)(row - slice * size.y), (int)(index - row * size.z));
}

// Index of a block's voxel, apron included.
size_t voxelOf(int block, int3 inBlock) {
    return (size_t)(block)*BLOCK_FLOATS + (inBlock.x * STRIDE + inBlock.y) * STRIDE + inBlock.z;
}

// Index of a coarse cell's distance to the surface. The cells of a block are contiguous, in the order of the directory.
size_t centreOf(int3 cell, int3 blocks) {
    const int3 inBlock = cell & (COARSE_ALONG - 1);
    return (indexOf(cell / COARSE_ALONG, blocks) * COARSE_ALONG + inBlock.x) * COARSE_ALONG * COARSE_ALONG +
           inBlock.y * COARSE_ALONG + inBlock.z;
}
