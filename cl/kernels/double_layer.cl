// The double layer method on a device: the samples of sdf/fill/layer_samples.h, applied as in sdf/fill/layer_block.cpp.
//
// -D TRIANGLES=1 also stores the triangle of the nearest sample. -D PAPER_CUBE=1 replaces the ball around a sample by
// the paper's cube of (2 K + 1)^3 voxels.
#include "samples.cl"

#ifndef TRIANGLES
#define TRIANGLES 0
#endif
#ifndef PAPER_CUBE
#define PAPER_CUBE 0
#endif

// The voxels that an item fills at once stay in registers: a cube of 4x4x4 voxels, a vector for each slice of one x, or
// on a GPU a row of 8. Points are selected for a cube or, by all items of a group, for a block. Their coordinates are
// relative to its middle.
#if ITEMS > 1
#define SLICES 1
#define CUBES 1
#define PICKED_SIDE 8
#else
#define SLICES 4
#define CUBES 8
#define PICKED_SIDE 4
#endif
#define HALF_SIDE (0.5f * (PICKED_SIDE - 1))

// Points of a layer that are tested at once.
#define PAGE 1024
// Rows of cells that an item tests at once.
#define MOST_ROWS 64
// layerTie of sdf/leaf/blocks.h [voxels^2].
#define LAYER_TIE 1e-5f

// FillParameters of sdf/leaf/blocks.h [voxels].
typedef struct {
    float delta, reach, certain;
    int cube;
} Layers;

// Positions of an item's voxels, relative to the middle of the cube or block that points are selected for.
typedef struct {
    Lanes x[SLICES], y, z;
} Voxels;

// `first` is the x of the first voxel that points are selected for. Relative to their middle it is constant, but
// constants would be loaded again for every point.
Voxels ownVoxels(int first) {
    Voxels v;
    const float middle = (float)(first) + HALF_SIDE;
#if ITEMS > 1
    v.x[0] = (float)(first + (int)(ITEM / BLOCK_SIDE)) - middle;
    v.y = (float)(ITEM % BLOCK_SIDE) - HALF_SIDE;
    v.z = (Lanes)(0, 1, 2, 3, 4, 5, 6, 7) - HALF_SIDE;
#else
    const float4 row = (float4)(0, 1, 2, 3), one = 1.0f;
    UNROLLED for (int slice = 0; slice < SLICES; ++slice) v.x[slice] = (float)(first + slice) - middle;
    v.y = (Lanes)(0 * one, one, 2 * one, 3 * one) - HALF_SIDE;
    v.z = (Lanes)(row, row, row, row) - HALF_SIDE;
#endif
    return v;
}

// The lattice point nearest to a coordinate. Halves round up in spite of rounding: LayerSamples::nearestLattice().
#define nearestLattice(coordinate) floor((coordinate) + 0.5001f)

#if COMPRESSES
typedef uint PickedNumber;
#else
typedef ushort PickedNumber;
#endif

// Points of a layer, and the selection of those that reach the voxels.
typedef struct {
    float x[PAGE] __attribute__((aligned(64))), y[PAGE], z[PAGE], halfSquare[PAGE];
#if TRIANGLES
    int owner[PAGE];
#endif
#if PAPER_CUBE
    float centre[3][PAGE];  // the lattice point nearest to the sample
#endif
    PickedNumber picked[PAGE + LANES];  // some elements beyond the selection are written
} Points;

typedef struct {
    SHARED Points* points;
    SHARED uint* picked;  // count of selected points
} Layer;

// The nearest points of a layer so far: those with the greatest p . v - |p|^2 / 2, as |v - p|^2 = |v|^2 - 2 (p . v -
// |p|^2 / 2). This takes one multiplication per voxel and point.
typedef struct {
    Lanes greatest[SLICES];
#if TRIANGLES
    IntLanes owner[SLICES];
#endif
} Nearest;

INLINED void clear(Nearest* nearest) {
    UNROLLED for (int i = 0; i < SLICES; ++i) {
        nearest->greatest[i] = -INFINITY;
#if TRIANGLES
        nearest->owner[i] = -1;
#endif
    }
}

INLINED void applyPoints(Layer layer, const Voxels* v, int cube, Nearest* nearest) {
    SHARED const Points* points = layer.points;
    const uint count = *layer.picked;
    for (uint i = 0; i < count; ++i) {
        const uint p = points->picked[i];
        const float along = points->x[p];
        Lanes across = multiplyAdd(
            v->z, (Lanes)(points->z[p]), multiplyAdd(v->y, (Lanes)(points->y[p]), (Lanes)(-points->halfSquare[p])));
#if PAPER_CUBE
        const Lanes away = max(fabs(v->y - points->centre[1][p]), fabs(v->z - points->centre[2][p]));
        across = select((Lanes)(-INFINITY), across, away <= (float)(cube));
#else
        (void)(cube);
#endif
        UNROLLED for (int slice = 0; slice < SLICES; ++slice) {
#if PAPER_CUBE
            if (fabs(v->x[slice].s0 - points->centre[0][p]) > (float)(cube)) continue;
#endif
            const Lanes some = multiplyAdd((Lanes)(along), v->x[slice], across);
#if TRIANGLES
            nearest->owner[slice] =
                select(nearest->owner[slice], (IntLanes)(points->owner[p]), some > nearest->greatest[slice]);
#endif
            nearest->greatest[slice] = max(nearest->greatest[slice], some);
        }
    }
}

Lanes distances2(const Nearest* nearest, const Voxels* v, int slice) {
    const Lanes square2 = multiplyAdd(v->y, v->y, multiplyAdd(v->z, v->z, v->x[slice] * v->x[slice]));
    return multiplyAdd((Lanes)(-2.0f), nearest->greatest[slice], square2);
}

Real squareSum(Real a, Real b, Real c) {
    return multiplyAdd(a, a, multiplyAdd(b, b, c * c));
}

Real beyondSide(Real at) {
    return max(fabs(at) - HALF_SIDE, (Real)(0.0f));
}

typedef ushort8 LooseUshort8 __attribute__((aligned(2)));

// Adds the numbers of some lanes, counted from `first`, to the selection. For each byte, `orders` has the positions of
// its bits in ascending order. This avoids a branch for each bit, which processors would mispredict.
INLINED void addPicked(Layer layer, uint lanes, uint first, global const ulong* orders) {
    SHARED PickedNumber* picked = layer.points->picked;
#if ITEMS > 1
    (void)(orders);
    if (lanes) picked[atomic_inc(layer.picked)] = (PickedNumber)(first);
#elif COMPRESSES
    (void)(orders);
    storeSharedInts(compressInts(laneInts + (int)(first), lanes), 0, (SHARED int*)(picked + *layer.picked));
    *layer.picked += popcount(lanes);
#else
    uint count = *layer.picked;
    UNROLLED for (uint i = 0; i < LANES / 8; ++i) {
        const uint byte = lanes >> 8 * i & 255;
        *(LooseUshort8*)(picked + count) = convert_ushort8(as_uchar8(orders[byte])) + (ushort)(first + 8 * i);
        count += popcount(byte);
    }
    *layer.picked = count;
#endif
}

// Stores points of a layer, and selects those that reach the voxels: closer than the square root of reach2.
INLINED void placePoints(Layer layer, uint first, uint among, Real3 at, float reach2, global const ulong* orders) {
    SHARED Points* points = layer.points;
    const Real away2 = squareSum(beyondSide(at.x), beyondSide(at.y), beyondSide(at.z));
    storeReal(at.x, points->x + first);
    storeReal(at.y, points->y + first);
    storeReal(at.z, points->z + first);
    storeReal(0.5f * squareSum(at.x, at.y, at.z), points->halfSquare + first);
    addPicked(layer, bitsOfReal(away2 < reach2) & among, first, orders);
}

// The input of a block.
typedef struct {
    global const float* columns;  // columns from the first sample of the brick on
    uint stride;
    global const uint* begins;  // first samples of the brick's cells
    SampleCells cells;
    Layers layers;
    global const ulong* orders;  // see addPicked()
} Input;

// Stores the points of both layers around samples begin + ITEM * BATCH .. at positions from `first` + ITEM * BATCH on.
INLINED void placeLayers(const Input* input, uint begin, uint end, float3 middle, uint first, Layer inner,
                         Layer outer) {
    const uint at = begin + ITEM * BATCH, to = first + ITEM * BATCH;
    if (at >= end) return;
    global const float* columns = input->columns + at;
    const uint stride = input->stride;
    uint among = end - at < BATCH ? (1u << (end - at)) - 1 : (1u << BATCH) - 1;
    const Real3 place = make3(loadReal(columns + PLACE_X * stride), loadReal(columns + PLACE_Y * stride),
                              loadReal(columns + PLACE_Z * stride)),
                offset = make3(loadReal(columns + OFFSET_X * stride), loadReal(columns + OFFSET_Y * stride),
                               loadReal(columns + OFFSET_Z * stride)),
                seen = make3(place.x - middle.x, place.y - middle.y, place.z - middle.z);
#if PAPER_CUBE
    const float most = (float)(input->layers.cube) + HALF_SIDE;
    const Real3 centre = make3(nearestLattice(place.x) - middle.x, nearestLattice(place.y) - middle.y,
                               nearestLattice(place.z) - middle.z);
    among &= bitsOfReal((fabs(centre.x) <= most) & (fabs(centre.y) <= most) & (fabs(centre.z) <= most));
    storeReal(centre.x, inner.points->centre[0] + to);
    storeReal(centre.y, inner.points->centre[1] + to);
    storeReal(centre.z, inner.points->centre[2] + to);
    storeReal(centre.x, outer.points->centre[0] + to);
    storeReal(centre.y, outer.points->centre[1] + to);
    storeReal(centre.z, outer.points->centre[2] + to);
#endif
#if TRIANGLES
    const Real owners = loadReal(columns + OWNER * stride);
    storeReal(owners, (SHARED float*)(inner.points->owner) + to);
    storeReal(owners, (SHARED float*)(outer.points->owner) + to);
#endif
    const float reach2 = square(input->layers.certain);
    placePoints(inner, to, among, sub3(seen, offset), reach2, input->orders);
    placePoints(outer, to, among, add3(seen, offset), reach2, input->orders);
}

// Whether any sample is in the cells around a block.
bool hasSamples(const Input* input, int3 corner) {
    const int size = input->cells.size, along = BLOCK_SIDE / CELL_SIDE + 2 * input->cells.around;
    const int3 cell = corner / CELL_SIDE;
    global const uint* slab = input->begins + (cell.x * size + cell.y) * size + cell.z;
    for (int x = 0; x < along; ++x, slab += size * size) {
        global const uint* row = slab;
        for (int y = 0; y < along; ++y, row += size)
            if (row[along] > row[0]) return true;
    }
    return false;
}

// The points of both layers around a cube, and the nearest of those tested so far.
typedef struct {
    const Input* input;
    const Voxels* voxels;
    Layer inner, outer;
    Nearest nearestInner, nearestOuter;
    float3 middle;
    uint placed;  // waiting points of each layer
    bool any;     // whether any point reaches the cube
} Cube;

// Tests the waiting points.
INLINED void applyLayers(Cube* cube) {
    MEET;
    if (*cube->inner.picked + *cube->outer.picked > 0) {
        cube->any = true;
        applyPoints(cube->inner, cube->voxels, cube->input->layers.cube, &cube->nearestInner);
        applyPoints(cube->outer, cube->voxels, cube->input->layers.cube, &cube->nearestOuter);
    }
    MEET;
    if (ITEM == 0) *cube->inner.picked = *cube->outer.picked = 0;
    MEET;
    cube->placed = 0;
}

// Adds the points around samples begin .. end - 1.
INLINED void placeSamples(Cube* cube, uint begin, uint end) {
    for (uint i = begin; i < end; i += ITEMS * BATCH) {
        if (cube->placed == PAGE) applyLayers(cube);
        placeLayers(cube->input, i, end, cube->middle, cube->placed, cube->inner, cube->outer);
        cube->placed += ITEMS * BATCH;
    }
}

// Adds the points around all samples of the cells around a cube.
INLINED void placeCells(Cube* cube, int3 cell) {
    const Input* input = cube->input;
    const int size = input->cells.size, along = PICKED_SIDE / CELL_SIDE + 2 * input->cells.around;
#if ITEMS == 1
    // rows of cells are collected first, and kept if they hold samples: a branch for each would be mispredicted half of
    // the time
    uint begins[MOST_ROWS], ends[MOST_ROWS], rows = 0;
#endif
    global const uint* slab = input->begins + (cell.x * size + cell.y) * size + cell.z;
    for (int x = 0; x < along; ++x, slab += size * size) {
        global const uint* row = slab;
        for (int y = 0; y < along; ++y, row += size) {
#if ITEMS > 1
            placeSamples(cube, row[0], row[along]);
#else
            begins[rows] = row[0];
            ends[rows] = row[along];
            rows += row[0] < row[along];
            if (rows < MOST_ROWS) continue;
            for (uint i = 0; i < rows; ++i) placeSamples(cube, begins[i], ends[i]);
            rows = 0;
#endif
        }
    }
#if ITEMS == 1
    for (uint i = 0; i < rows; ++i) placeSamples(cube, begins[i], ends[i]);
#endif
}

// Finds the nearest points of both layers for the voxels of a cube; `corner` is its first voxel in the brick. Returns
// false if no point reaches it.
INLINED bool fillCube(Cube* cube, int3 corner) {
    cube->middle = convert_float3(corner) + HALF_SIDE;
    cube->placed = 0;
    cube->any = false;
    clear(&cube->nearestInner);
    clear(&cube->nearestOuter);
    MEET;
    if (ITEM == 0) *cube->inner.picked = *cube->outer.picked = 0;
    MEET;
    placeCells(cube, corner / CELL_SIDE);
    applyLayers(cube);
    return cube->any;
}

// Eq. 3: computes a slice's signed distances from both layers, and the points' owners. The inside keeps its sign bit
// where the distance is clamped to zero. Returns whether any distance is known.
INLINED uint combine(const Cube* cube, int slice, const Layers* layers, Lanes* values, IntLanes* owners) {
    const Nearest *inner = &cube->nearestInner, *outer = &cube->nearestOuter;
    const Lanes certain2 = square(layers->certain),
                inner2 = min(distances2(inner, cube->voxels, slice), certain2),
                outer2 = min(distances2(outer, cube->voxels, slice), certain2);
    // where only the outer layer is near enough to be known, the tie has no meaning
    const IntLanes inside = (inner2 < certain2) & (inner2 <= outer2 + LAYER_TIE), known = min(inner2, outer2) < certain2;
    const Lanes clamped = max(sqrt(max(max(inner2, outer2), (Lanes)(0.0f))) - layers->delta, (Lanes)(0.0f));
    *values = select((Lanes)(INFINITY), select(clamped, -clamped, inside), known);
#if TRIANGLES
    *owners = select(inner->owner[slice], outer->owner[slice], inside);
#else
    (void)(owners);
#endif
    return (uint)(anyLane(known));
}

// Memory that an item writes a block to: a group uses its own, until it is known that the block is kept.
#if ITEMS > 1
#define WRITTEN local
#else
#define WRITTEN global
#endif

// Writes a slice of a cube into its block.
void putSlice(Lanes values, int slice, int3 inBlock, WRITTEN float* block) {
#if ITEMS > 1
    (void)(slice);
    (void)(inBlock);
    vstore8(values, ITEM, block);
#else
    WRITTEN float* corner = block + ((inBlock.x + slice) * BLOCK_SIDE + inBlock.y) * BLOCK_SIDE + inBlock.z;
    *(WRITTEN float4*)(corner) = values.s0123;
    *(WRITTEN float4*)(corner + BLOCK_SIDE) = values.s4567;
    *(WRITTEN float4*)(corner + 2 * BLOCK_SIDE) = values.s89ab;
    *(WRITTEN float4*)(corner + 3 * BLOCK_SIDE) = values.scdef;
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
} Filled;

enum { FILLED_BLOCKS };

// Working memory of a group.
typedef struct {
    Points inner, outer;
#if ITEMS > 1
    float values[BLOCK_VOXELS] __attribute__((aligned(64)));
#if TRIANGLES
    float owners[BLOCK_VOXELS] __attribute__((aligned(64)));
#endif
    uint slot, anyKnown;
#endif
} Workplace;

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
    const int3 place = brickAt(grid, bricks->cellOfBrick[b]);
    const Limits limits = limitsOf(grid, place);
    const double3 origin = convert_double3(place * (1 << grid->shift));
    Cut cut = {samples->unsorted, samples->stride, samples->begins, count, origin, cellsFor(grid), bricks->layers.delta};
    for (uint i = ITEM; i < cursors; i += ITEMS) cut.cursors[i] = 0;
    MEET;
    cutTriangles(&cut, grid, bricks->points, bricks->triangles, bricks->list, bricks->triangleOffsets[b],
                 bricks->triangleOffsets[b + 1], &limits);
    MEET;
    sortSamples(&cut, *count, samples->sorted, sums);
}

// The first voxel of a block in its brick.
int3 firstVoxel(const Grid* grid, uint block) {
    const int bits = grid->shift - BLOCK_SHIFT, last = (1 << bits) - 1, n = (int)(block);
    return BLOCK_SIDE * (int3)(n >> 2 * bits, n >> bits & last, n & last);
}

// Fills a block of a brick. Returns whether this item has any known distance.
INLINED uint fillBlock(const Input* input, int3 inBrick, SHARED Workplace* work, SHARED uint* innerPicked,
                       SHARED uint* outerPicked, WRITTEN float* values, WRITTEN float* owners) {
    const Layer inner = {&work->inner, innerPicked}, outer = {&work->outer, outerPicked};
    uint known = 0;
    for (int cube = 0; cube < CUBES; ++cube) {
        const int3 inBlock = CUBES > 1 ? SLICES * (int3)(cube / 4, cube / 2 % 2, cube % 2) : (int3)(0);
        const Voxels v = ownVoxels(inBrick.x + inBlock.x);
        Cube around = {.input = input, .voxels = &v, .inner = inner, .outer = outer};
        const bool any = fillCube(&around, inBrick + inBlock);
        UNROLLED for (int i = 0; i < SLICES; ++i) {
            Lanes distances = INFINITY;
            IntLanes nearest = -1;
            if (any) known |= combine(&around, i, &input->layers, &distances, &nearest);
            putSlice(distances, i, inBlock, values);
#if TRIANGLES
            putSlice(asLanes(nearest), i, inBlock, owners);
#else
            (void)(owners);
#endif
        }
    }
    return known;
}

void putOrigin(const Bricks* bricks, uint brick, int3 inBrick, uint slot, global int* origins) {
    const int3 place = brickAt(&bricks->grid, bricks->cellOfBrick[bricks->firstBrick + brick]);
    vstore3(place * (1 << bricks->grid.shift) + inBrick, slot, origins);
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

// A group fills a block of a brick. For each byte, `orders` has the positions of its bits.
GROUP_KERNEL void fillBlocks(Grid grid, global const uint* cellOfBrick, global const uint* partOffsets,
                             uint firstBrick, global float* sorted, global uint* begins, uint stride, Layers layers,
                             global const ulong* orders, global int* origins, global float* distances,
                             global int* nearestTriangles, global uint* counters) {
    SHARED Workplace work;
    SHARED uint innerPicked, outerPicked;
    const uint perBrick = blocksPerBrick(&grid), brick = (uint)(get_group_id(0)) / perBrick;
    const Bricks bricks = {0, 0, grid, cellOfBrick, 0, partOffsets, 0, firstBrick, layers};
    const Input input = {sorted + firstSample(partOffsets, firstBrick, brick), stride,
                         begins + brick * cursorsOf(&grid), cellsFor(&grid), layers, orders};
    const int3 inBrick = firstVoxel(&grid, (uint)(get_group_id(0)) % perBrick);
    if (!hasSamples(&input, inBrick)) return;
#if TRIANGLES
    local float* const owners = work.owners;
#else
    (void)(nearestTriangles);
    local float* const owners = 0;
#endif
    const uint known = fillBlock(&input, inBrick, &work, &innerPicked, &outerPicked, work.values, owners);
    MEET;
    if (ITEM == 0) work.anyKnown = 0;
    MEET;
    if (known) work.anyKnown = 1;
    MEET;
    if (!work.anyKnown) return;
    if (ITEM == 0) {
        work.slot = atomic_inc(counters + FILLED_BLOCKS);
        putOrigin(&bricks, brick, inBrick, work.slot, origins);
    }
    MEET;
    for (uint i = ITEM; i < BLOCK_VOXELS / LANES; i += ITEMS) {
        const size_t place = (size_t)(work.slot) * (BLOCK_VOXELS / LANES) + i;
        storeGlobalLanes(vloadLanes(i, work.values), place, distances);
#if TRIANGLES
        storeGlobalLanes(vloadLanes(i, owners), place, (global float*)(nearestTriangles));
#endif
    }
}

#else

// Blocks of a brick that are given slots together: a bit for each.
#define TOGETHER 64

// Fills those blocks of a brick that may hold distances, TOGETHER from `first` on, in adjacent slots.
INLINED void fillTogether(const Bricks* bricks, uint brick, uint first, const Input* input, const Filled* filled,
                          Workplace* work) {
    const Grid* grid = &bricks->grid;
    ulong wanted = 0;
    for (uint i = 0; i < TOGETHER; ++i) wanted |= (ulong)(hasSamples(input, firstVoxel(grid, first + i))) << i;
    const uint count = (uint)(popcount(wanted));
    uint slot = atomic_add(filled->counters + FILLED_BLOCKS, count), innerPicked, outerPicked;
    const uint end = slot + count;
    for (; wanted != 0; wanted &= wanted - 1) {
        const int3 inBrick = firstVoxel(grid, first + 63 - (uint)(clz(wanted & -wanted)));
        const size_t place = (size_t)(slot) * BLOCK_VOXELS;
        if (!fillBlock(input, inBrick, work, &innerPicked, &outerPicked, filled->distances + place,
                       (global float*)(filled->triangles) + place))
            continue;
        putOrigin(bricks, brick, inBrick, slot, filled->origins);
        ++slot;
    }
    for (; slot < end; ++slot) vstore3((int3)(NO_BLOCK), slot, filled->origins);
}

// Does both steps at once. Each group has `room` for the samples of a brick, which stays in the processor's cache. For
// each byte, `orders` has the positions of its bits.
GROUP_KERNEL void fillBricks(global const float* points, global const uint* triangles, Grid grid,
                             global const uint* cellOfBrick, global const uint* triangleOffsets,
                             global const uint* partOffsets, global const uint* list, uint firstBrick, uint brickCount,
                             global float* unsorted, global float* sorted, global uint* begins, uint stride,
                             global uint* next, Layers layers, uint room, global const ulong* orders,
                             global int* origins, global float* distances, global int* nearestTriangles,
                             global uint* counters) {
    uint taken, count, sums[ITEMS];
    Workplace work;
    const Bricks bricks = {points,      triangles, grid,       cellOfBrick, triangleOffsets,
                           partOffsets, list,      firstBrick, layers};
    const uint group = (uint)(get_group_id(0)), first = group * room, perBrick = blocksPerBrick(&grid);
    const Samples samples = {unsorted + first, sorted + first, begins + group * cursorsOf(&grid), stride};
    const Input input = {samples.sorted, stride, samples.begins, cellsFor(&grid), layers, orders};
    const Filled filled = {origins, distances, nearestTriangles, counters};
    while (takeBrick(next, &taken, &count) < brickCount) {
        prepareBrick(&bricks, taken, &samples, &count, sums);
        for (uint block = 0; block < perBrick; block += TOGETHER)
            fillTogether(&bricks, taken, block, &input, &filled, &work);
    }
}

#endif
