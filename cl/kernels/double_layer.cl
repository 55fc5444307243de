// SPDX-License-Identifier: Apache-2.0
// The double layer method on a device: the samples of sdf/fill/layer_samples.h, applied as in sdf/fill/layer_block.cpp.
//
// -D TRIANGLES=1 also stores the triangle of the nearest sample. -D PAPER_CUBE=1 replaces the ball around a sample by
// the paper's cube of (2 K + 1)^3 voxels.
#include "layer_cubes.cl"

// Memory that an item writes a block to: a group uses its own, until it is known that the block is kept.
#if ITEMS > 1
#define BLOCK_MEMORY local
#else
#define BLOCK_MEMORY global
#endif

// Writes a slice of a cube into its block.
void storeSlice(Lanes values, int slice, int3 inBlock, BLOCK_MEMORY float* block) {
#if ITEMS > 1
    (void)(slice);
    const int item = (int)(ITEM % ITEMS_PER_CUBE);
    BLOCK_MEMORY float* corner =
        block + ((inBlock.x + item / 2) * BLOCK_SIDE + inBlock.y + item % 2 * 2) * BLOCK_SIDE + inBlock.z;
    vstore4(values.lo, 0, corner);
    vstore4(values.hi, 0, corner + BLOCK_SIDE);
#else
    BLOCK_MEMORY float* corner = block + ((inBlock.x + slice) * BLOCK_SIDE + inBlock.y) * BLOCK_SIDE + inBlock.z;
    *(BLOCK_MEMORY float4*)(corner) = values.s0123;
    *(BLOCK_MEMORY float4*)(corner + BLOCK_SIDE) = values.s4567;
    *(BLOCK_MEMORY float4*)(corner + 2 * BLOCK_SIDE) = values.s89ab;
    *(BLOCK_MEMORY float4*)(corner + 3 * BLOCK_SIDE) = values.scdef;
#endif
}

#if LANES == 16
#define asLanes as_float16
#else
#define asLanes as_float8
#endif

// The mesh, and the triangles that reach the bricks of a batch.
typedef struct {
    global const float* points;
    global const uint* triangles;
    Grid grid;
    global const uint *cellOfBrick, *triangleOffsets, *partOffsets, *list;
    uint firstBrick;
    Layers layers;
} Bricks;

// The samples of a brick in columns, unsorted and sorted, and the first one of each cell.
typedef struct {
    global float *unsorted, *sorted;
    global uint* begins;
    uint stride;
} Samples;

// Output slots of blocks that hold distances. The origin of an empty slot is NO_BLOCK.
typedef struct {
    global int* origins;
    global float* distances;
    global int* triangles;
    global uint* counters;
} FilledBlocks;

enum { FILLED_BLOCKS };

// Working memory of a group.
typedef struct {
#if ITEMS > 1
    SelectedSamples samples;
    float values[BLOCK_VOXELS] __attribute__((aligned(64)));
#if TRIANGLES
    float owners[BLOCK_VOXELS] __attribute__((aligned(64)));
#endif
    uint slot, anyKnown;
#else
    Points inner, outer;
#endif
} Scratch;

uint blocksPerBrick(const Grid* grid) {
    return 1u << 3 * (grid->shift - BLOCK_SHIFT);
}

uint cursorsOf(const Grid* grid) {
    const SampleCells cells = cellsFor(grid);
    return (uint)(cells.size * cells.size * cells.size + 2);
}

// Converts a brick of the batch to sorted samples. `count` is 0 before.
void prepareBrick(const Bricks* bricks, uint brick, const Samples* samples, SHARED uint* count, SHARED uint* sums) {
    const uint b = bricks->firstBrick + brick, cursors = cursorsOf(&bricks->grid);
    const Grid* grid = &bricks->grid;
    const int3 coordinates = brickAt(grid, bricks->cellOfBrick[b]);
    const Limits limits = limitsOf(grid, coordinates);
    const double3 origin = convert_double3(coordinates * (1 << grid->shift));
    SampleOutput output = {samples->unsorted, samples->stride,     samples->begins, count, origin,
                           cellsFor(grid),    bricks->layers.delta};
    for (uint i = ITEM; i < cursors; i += ITEMS) output.cursors[i] = 0;
    BARRIER;
    sampleTriangles(&output, grid, bricks->points, bricks->triangles, bricks->list, bricks->triangleOffsets[b],
                    bricks->triangleOffsets[b + 1], &limits);
    BARRIER;
    sortSamples(&output, *count, samples->sorted, sums);
}

// The first voxel of a block in its brick.
int3 firstVoxel(const Grid* grid, uint block) {
    const int bits = grid->shift - BLOCK_SHIFT, last = (1 << bits) - 1, n = (int)(block);
    return BLOCK_SIDE * (int3)(n >> 2 * bits, n >> bits & last, n & last);
}

// The first voxel of a cube in its block.
int3 cubeInBlock(int cube) {
    return CUBE_SIDE * (int3)(cube / 4, cube / 2 % 2, cube % 2);
}

// Fills a block of a brick, or on a GPU this item's part of it. `selected` has counts of selected points: one of each
// layer, on a GPU one of samples. Returns whether any of the distances is known.
INLINED uint fillBlock(const Input* input, int3 inBrick, SHARED Scratch* work, SHARED uint* selected,
                       BLOCK_MEMORY float* values, BLOCK_MEMORY float* owners) {
    uint known = 0;
    for (int cube = 0; cube < CUBES; ++cube) {
#if ITEMS > 1
        const int3 inBlock = cubeInBlock((int)(ITEM / ITEMS_PER_CUBE)), selection = inBrick;
        const Voxels v = ownVoxels(inBrick.x + inBlock.x);
        Cube around = {.input = input, .voxels = &v, .samples = &work->samples, .selected = selected};
#else
        const int3 inBlock = cubeInBlock(cube), selection = inBrick + inBlock;
        const Voxels v = ownVoxels(inBrick.x + inBlock.x);
        Cube around = {.input = input,
                       .voxels = &v,
                       .inner = {&work->inner, selected},
                       .outer = {&work->outer, selected + 1}};
#endif
        const bool any = fillCube(&around, inBrick + inBlock, selection);
        UNROLLED for (int i = 0; i < SLICES; ++i) {
            Lanes distances = INFINITY;
            IntLanes nearest = -1;
            if (any) known |= combine(&around, i, &input->layers, &distances, &nearest);
            storeSlice(distances, i, inBlock, values);
#if TRIANGLES
            storeSlice(asLanes(nearest), i, inBlock, owners);
#else
            (void)(owners);
#endif
        }
    }
    return known;
}

void storeOrigin(const Bricks* bricks, uint brick, int3 inBrick, uint slot, global int* origins) {
    const int3 coordinates = brickAt(&bricks->grid, bricks->cellOfBrick[bricks->firstBrick + brick]);
    vstore3(coordinates * (1 << bricks->grid.shift) + inBrick, slot, origins);
}

#if ITEMS > 1

// Converts bricks to sorted samples. Work-groups take the bricks one after another.
GROUP_KERNEL void prepareBricks(global const float* points, global const uint* triangles, Grid grid,
                                global const uint* cellOfBrick, global const uint* triangleOffsets,
                                global const uint* partOffsets, global const uint* list, uint firstBrick,
                                uint brickCount, global float* unsorted, global float* sorted, global uint* begins,
                                uint stride, global uint* next, Layers layers) {
    SHARED uint taken, count, sums[ITEMS];
    const Bricks bricks = {points,      triangles, grid,       cellOfBrick, triangleOffsets,
                           partOffsets, list,      firstBrick, layers};
    while (takeBrick(next, &taken, &count) < brickCount) {
        const uint first = firstSample(partOffsets, firstBrick, taken);
        const Samples samples = {unsorted + first, sorted + first, begins + taken * cursorsOf(&grid), stride};
        prepareBrick(&bricks, taken, &samples, &count, sums);
    }
}

// A group fills a block of a brick.
GROUP_KERNEL void fillBlocks(Grid grid, global const uint* cellOfBrick, global const uint* partOffsets, uint firstBrick,
                             global float* sorted, global uint* begins, uint stride, Layers layers,
                             global int* origins, global float* distances, global int* nearestTriangles,
                             global uint* counters) {
    SHARED Scratch work;
    SHARED uint selected[1];
    const uint perBrick = blocksPerBrick(&grid), brick = (uint)(get_group_id(0)) / perBrick;
    const Bricks bricks = {0, 0, grid, cellOfBrick, 0, partOffsets, 0, firstBrick, layers};
    const Input input = {sorted + firstSample(partOffsets, firstBrick, brick),
                         stride,
                         begins + brick * cursorsOf(&grid),
                         cellsFor(&grid),
                         layers};
    const int3 inBrick = firstVoxel(&grid, (uint)(get_group_id(0)) % perBrick);
    if (!hasSamples(&input, inBrick)) return;
#if TRIANGLES
    local float* const owners = work.owners;
#else
    (void)(nearestTriangles);
    local float* const owners = 0;
#endif
    const uint known = fillBlock(&input, inBrick, &work, selected, work.values, owners);
    BARRIER;
    if (ITEM == 0) work.anyKnown = 0;
    BARRIER;
    if (known) work.anyKnown = 1;
    BARRIER;
    if (!work.anyKnown) return;
    if (ITEM == 0) {
        work.slot = atomic_inc(counters + FILLED_BLOCKS);
        storeOrigin(&bricks, brick, inBrick, work.slot, origins);
    }
    BARRIER;
    for (uint i = ITEM; i < BLOCK_VOXELS / LANES; i += ITEMS) {
        const size_t offset = (size_t)(work.slot) * (BLOCK_VOXELS / LANES) + i;
        storeGlobalLanes(vloadLanes(i, work.values), offset, distances);
#if TRIANGLES
        storeGlobalLanes(vloadLanes(i, owners), offset, (global float*)(nearestTriangles));
#endif
    }
}

#else

// Blocks of a brick that are given slots together: a bit for each.
#define BLOCKS_AT_ONCE 64

// Fills those blocks of a brick that may hold distances, BLOCKS_AT_ONCE from `first` on, in adjacent slots.
INLINED void fillBlocksFrom(const Bricks* bricks, uint brick, uint first, const Input* input,
                            const FilledBlocks* filled, Scratch* work) {
    const Grid* grid = &bricks->grid;
    ulong nonEmpty = 0;
    for (uint i = 0; i < BLOCKS_AT_ONCE; ++i) nonEmpty |= (ulong)(hasSamples(input, firstVoxel(grid, first + i))) << i;
    const uint count = (uint)(popcount(nonEmpty));
    uint slot = atomic_add(filled->counters + FILLED_BLOCKS, count), selected[2];
    const uint end = slot + count;
    for (; nonEmpty != 0; nonEmpty &= nonEmpty - 1) {
        const int3 inBrick = firstVoxel(grid, first + 63 - (uint)(clz(nonEmpty & -nonEmpty)));
        const size_t offset = (size_t)(slot)*BLOCK_VOXELS;
        if (!fillBlock(input, inBrick, work, selected, filled->distances + offset,
                       (global float*)(filled->triangles) + offset))
            continue;
        storeOrigin(bricks, brick, inBrick, slot, filled->origins);
        ++slot;
    }
    for (; slot < end; ++slot) vstore3((int3)(NO_BLOCK), slot, filled->origins);
}

// Does both steps at once. Each group has space for `samplesPerGroup` samples of a brick, which stays in the
// processor's cache. For each byte, `orders` has the positions of its bits.
GROUP_KERNEL void fillBricks(global const float* points, global const uint* triangles, Grid grid,
                             global const uint* cellOfBrick, global const uint* triangleOffsets,
                             global const uint* partOffsets, global const uint* list, uint firstBrick, uint brickCount,
                             global float* unsorted, global float* sorted, global uint* begins, uint stride,
                             global uint* next, Layers layers, uint samplesPerGroup, global const ulong* orders,
                             global int* origins, global float* distances, global int* nearestTriangles,
                             global uint* counters) {
    uint taken, count, sums[ITEMS];
    Scratch work;
    const Bricks bricks = {points,      triangles, grid,       cellOfBrick, triangleOffsets,
                           partOffsets, list,      firstBrick, layers};
    const uint group = (uint)(get_group_id(0)), first = group * samplesPerGroup, perBrick = blocksPerBrick(&grid);
    const Samples samples = {unsorted + first, sorted + first, begins + group * cursorsOf(&grid), stride};
    const Input input = {samples.sorted, stride, samples.begins, cellsFor(&grid), layers, orders};
    const FilledBlocks filled = {origins, distances, nearestTriangles, counters};
    while (takeBrick(next, &taken, &count) < brickCount) {
        prepareBrick(&bricks, taken, &samples, &count, sums);
        for (uint block = 0; block < perBrick; block += BLOCKS_AT_ONCE)
            fillBlocksFrom(&bricks, taken, block, &input, &filled, &work);
    }
}

#endif
