// The double layer method on a device: the samples of sdf/layer_samples.h, applied as sdf/layer_block.cpp does it.
//
// -D TRIANGLES=1 also keeps whose sample is the nearest; -D PAPER_CUBE=1 replaces the ball around a sample by the
// paper's cube of (2 K + 1)^3 voxels.
#include "samples.cl"

#ifndef TRIANGLES
#define TRIANGLES 0
#endif
#ifndef PAPER_CUBE
#define PAPER_CUBE 0
#endif

// What an item fills at once stays in registers: a cube of 4x4x4 voxels, a vector for each slice of one x, or a GPU's
// row of 8. Points are picked for a cube or, by all items of a group, for a block; they are seen from its middle.
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

// Points of a layer that are looked at in one go.
#define PAGE 1024
// layerTie of sdf/blocks.h [voxels^2].
#define LAYER_TIE 1e-5f

// FillParameters of sdf/blocks.h [voxels].
typedef struct {
    float delta, reach, certain;
    int cube;
} Layers;

// Bricks into sorted samples. Work-groups take the bricks one after another.
GROUP_KERNEL void prepareBricks(global const float* points, global const uint* triangles, Grid grid,
                                global const uint* cellOfBrick, global const uint* triangleOffsets,
                                global const uint* partOffsets, global const uint* list, uint firstBrick, uint bricks,
                                global Sample* unsorted, global float* columns, global uint* begins, uint stride,
                                global uint* next, Layers layers) {
    SHARED uint taken, count, sums[ITEMS];
    while (takeBrick(next, &taken, &count) < bricks) {
        const uint b = firstBrick + taken, first = partOffsets[b] - partOffsets[firstBrick];
        const int3 brick = brickAt(&grid, cellOfBrick[b]);
        const Limits limits = limitsOf(&grid, brick);
        const SampleCells cells = cellsFor(&grid);
        const uint cursors = (uint)(cells.size * cells.size * cells.size + 2);
        Cut cut = {unsorted + first, begins + (size_t)(taken)*cursors, &count,
                   convert_double3(brick * (1 << grid.shift)), cells, layers.delta};
        for (uint i = ITEM; i < cursors; i += ITEMS) cut.cursors[i] = 0;
        MEET;
        cutTriangles(&cut, &grid, points, triangles, list, triangleOffsets[b], triangleOffsets[b + 1], &limits);
        MEET;
        sortSamples(&cut, count, columns + first, stride, sums);
    }
}

// Where an item's voxels are, from the middle of what points are picked for.
typedef struct {
    Lanes y, z;
} Voxels;

Voxels ownVoxels(void) {
#if ITEMS > 1
    const Voxels v = {(Lanes)((float)(ITEM % BLOCK_SIDE) - HALF_SIDE), (Lanes)(0, 1, 2, 3, 4, 5, 6, 7) - HALF_SIDE};
#else
    const float4 row = (float4)(0, 1, 2, 3), one = 1.0f;
    const Voxels v = {(Lanes)(0 * one, one, 2 * one, 3 * one) - HALF_SIDE, (Lanes)(row, row, row, row) - HALF_SIDE};
#endif
    return v;
}

float sliceAt(int slice) {
#if ITEMS > 1
    (void)(slice);
    return (float)(ITEM / BLOCK_SIDE) - HALF_SIDE;
#else
    return (float)(slice)-HALF_SIDE;
#endif
}

// The lattice point nearest to a coordinate. Halves go up, whatever the rounding: LayerSamples::nearestLattice().
#define nearestLattice(coordinate) floor((coordinate) + 0.5001f)

// Points of a layer, and those of them that reach the voxels.
typedef struct {
    float x[PAGE], y[PAGE], z[PAGE], halfSquare[PAGE];
#if TRIANGLES
    int owner[PAGE];
#endif
#if PAPER_CUBE
    float centre[3][PAGE];  // the lattice point nearest to the sample
#endif
    ushort picked[PAGE + BLOCK_SIDE];  // some more are written
    uint count;                        // of those picked
} Points;

// The nearest points of a layer so far. They are those with the greatest p . v - |p|^2 / 2, as
// |v - p|^2 = |v|^2 - 2 (p . v - |p|^2 / 2): one multiplication a voxel and point.
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

INLINED void applyPoints(SHARED const Points* points, const Voxels* v, int cube, Nearest* nearest) {
    for (uint i = 0; i < points->count; ++i) {
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
            if (fabs(sliceAt(slice) - points->centre[0][p]) > (float)(cube)) continue;
#endif
            const Lanes some = multiplyAdd((Lanes)(along), (Lanes)(sliceAt(slice)), across);
#if TRIANGLES
            nearest->owner[slice] =
                select(nearest->owner[slice], (IntLanes)(points->owner[p]), some > nearest->greatest[slice]);
#endif
            nearest->greatest[slice] = max(nearest->greatest[slice], some);
        }
    }
}

Lanes distances2(const Nearest* nearest, const Voxels* v, int slice) {
    const Lanes square2 =
        multiplyAdd(v->y, v->y, multiplyAdd(v->z, v->z, (Lanes)(sliceAt(slice) * sliceAt(slice))));
    return multiplyAdd((Lanes)(-2.0f), nearest->greatest[slice], square2);
}

Real squareSum(Real a, Real b, Real c) {
    return multiplyAdd(a, a, multiplyAdd(b, b, c * c));
}

Real beyondSide(Real at) {
    return max(fabs(at) - HALF_SIDE, (Real)(0.0f));
}

typedef ushort8 LooseUshort8 __attribute__((aligned(2)));

// Adds the numbers of some lanes, counted from `first`, to those picked. `orders` has the places of its bits, in
// ascending order, for each byte: without it there were a branch for each bit, and processors would guess it wrong.
INLINED void addPicked(SHARED Points* points, uint lanes, uint first, global const ulong* orders) {
#if ITEMS > 1
    (void)(orders);
    if (lanes) points->picked[atomic_inc(&points->count)] = (ushort)(first);
#else
    uint count = points->count;
    UNROLLED for (uint i = 0; i < LANES / 8; ++i) {
        const uint byte = lanes >> 8 * i & 255;
        *(LooseUshort8*)(points->picked + count) = convert_ushort8(as_uchar8(orders[byte])) + (ushort)(first + 8 * i);
        count += popcount(byte);
    }
    points->count = count;
#endif
}

// Places points of a layer, and picks those that reach the voxels: nearer than the root of reach2.
INLINED void placePoints(SHARED Points* points, uint first, uint among, Real3 at, float reach2,
                         global const ulong* orders) {
    const Real away2 = squareSum(beyondSide(at.x), beyondSide(at.y), beyondSide(at.z));
    storeReal(at.x, points->x + first);
    storeReal(at.y, points->y + first);
    storeReal(at.z, points->z + first);
    storeReal(0.5f * squareSum(at.x, at.y, at.z), points->halfSquare + first);
    addPicked(points, bitsOfReal(away2 < reach2) & among, first, orders);
}

// What a block works from.
typedef struct {
    global const float* columns;  // from the first sample of the brick on
    uint stride;
    global const uint* begins;  // of the brick's cells
    SampleCells cells;
    Layers layers;
    global const ulong* orders;  // see addPicked()
} Input;

// Places the points of both layers around samples begin + ITEM * BATCH .. as those from `first` + ITEM * BATCH on.
INLINED void placeLayers(const Input* input, uint begin, uint end, float3 middle, uint first, SHARED Points* inner,
                         SHARED Points* outer) {
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
    storeReal(centre.x, inner->centre[0] + to);
    storeReal(centre.y, inner->centre[1] + to);
    storeReal(centre.z, inner->centre[2] + to);
    storeReal(centre.x, outer->centre[0] + to);
    storeReal(centre.y, outer->centre[1] + to);
    storeReal(centre.z, outer->centre[2] + to);
#endif
#if TRIANGLES
    const Real owners = loadReal(columns + OWNER * stride);
    storeReal(owners, (SHARED float*)(inner->owner) + to);
    storeReal(owners, (SHARED float*)(outer->owner) + to);
#endif
    const float reach2 = square(input->layers.certain);
    placePoints(inner, to, among, sub3(seen, offset), reach2, input->orders);
    placePoints(outer, to, among, add3(seen, offset), reach2, input->orders);
}

// Whether any sample lies in the cells around a block.
bool hasSamples(const Input* input, int3 corner) {
    const int size = input->cells.size, along = BLOCK_SIDE / CELL_SIDE + 2 * input->cells.around;
    const int3 cell = corner / CELL_SIDE;
    for (int x = cell.x; x < cell.x + along; ++x)
        for (int y = cell.y; y < cell.y + along; ++y) {
            global const uint* row = input->begins + (x * size + y) * size + cell.z;
            if (row[along] > row[0]) return true;
        }
    return false;
}

// The nearest points of both layers for the voxels of a cube; `corner` is its first voxel in the brick.
INLINED void fillCube(const Input* input, int3 corner, const Voxels* v, SHARED Points* inner, SHARED Points* outer,
                      Nearest* nearestInner, Nearest* nearestOuter) {
    const int cube = input->layers.cube, size = input->cells.size,
              along = PICKED_SIDE / CELL_SIDE + 2 * input->cells.around;
    const int3 cell = corner / CELL_SIDE;
    const float3 middle = convert_float3(corner) + HALF_SIDE;
    clear(nearestInner);
    clear(nearestOuter);
    MEET;
    if (ITEM == 0) inner->count = outer->count = 0;
    MEET;
    uint placed = 0;
    for (int x = cell.x; x < cell.x + along; ++x)
        for (int y = cell.y; y < cell.y + along; ++y) {
            global const uint* row = input->begins + (x * size + y) * size + cell.z;
            const uint end = row[along];
            for (uint i = row[0]; i < end; i += ITEMS * BATCH) {
                if (placed == PAGE) {
                    MEET;
                    applyPoints(inner, v, cube, nearestInner);
                    applyPoints(outer, v, cube, nearestOuter);
                    MEET;
                    if (ITEM == 0) inner->count = outer->count = 0;
                    MEET;
                    placed = 0;
                }
                placeLayers(input, i, end, middle, placed, inner, outer);
                placed += ITEMS * BATCH;
            }
        }
    MEET;
    applyPoints(inner, v, cube, nearestInner);
    applyPoints(outer, v, cube, nearestOuter);
}

// Eq. 3: from both layers to a slice's signed distances. The inside keeps its sign bit where the distance is clamped to
// zero.
INLINED Lanes combine(const Nearest* inner, const Nearest* outer, const Voxels* v, int slice, const Layers* layers,
                      IntLanes* inside, IntLanes* known) {
    const Lanes certain2 = square(layers->certain), inner2 = min(distances2(inner, v, slice), certain2),
                outer2 = min(distances2(outer, v, slice), certain2);
    *inside = inner2 <= outer2 + LAYER_TIE;
    *known = min(inner2, outer2) < certain2;
    const Lanes clamped = max(sqrt(max(max(inner2, outer2), (Lanes)(0.0f))) - layers->delta, (Lanes)(0.0f));
    return select((Lanes)(INFINITY), select(clamped, -clamped, *inside), *known);
}

// Writes a slice of a cube into its block.
void putSlice(Lanes values, int slice, int3 inBlock, SHARED float* block) {
#if ITEMS > 1
    (void)(slice);
    (void)(inBlock);
    vstore8(values, ITEM, block);
#else
    SHARED float* corner = block + ((inBlock.x + slice) * BLOCK_SIDE + inBlock.y) * BLOCK_SIDE + inBlock.z;
    *(float4*)(corner) = values.s0123;
    *(float4*)(corner + BLOCK_SIDE) = values.s4567;
    *(float4*)(corner + 2 * BLOCK_SIDE) = values.s89ab;
    *(float4*)(corner + 3 * BLOCK_SIDE) = values.scdef;
#endif
}

#if LANES == 16
#define asLanes as_float16
#else
#define asLanes as_float8
#endif

enum { FILLED_BLOCKS };

// A group fills a block of a brick. For each byte `orders` has the places of its bits. Blocks that hold distances go to the next places of `origins`, `distances` and
// `nearestTriangles`.
GROUP_KERNEL void fillBlocks(Grid grid, global const uint* cellOfBrick, global const uint* partOffsets,
                             uint firstBrick, global const float* columns, global const uint* begins, uint stride,
                             Layers layers, global const ulong* orders, global int* origins, global float* distances, global int* nearestTriangles,
                             global uint* counters) {
    SHARED Points inner, outer;
    SHARED float values[BLOCK_VOXELS] __attribute__((aligned(64)));
    SHARED float owners[TRIANGLES ? BLOCK_VOXELS : 1] __attribute__((aligned(64)));
    SHARED uint slot, anyKnown;
    const int side = (1 << grid.shift) / BLOCK_SIDE;
    const uint perBrick = (uint)(side * side * side), brick = (uint)(get_group_id(0)) / perBrick;
    const int number = (int)(get_group_id(0) % perBrick);
    const int3 inBrick = BLOCK_SIDE * (int3)(number / side / side, number / side % side, number % side);
    const SampleCells cells = cellsFor(&grid);
    const uint cursors = (uint)(cells.size * cells.size * cells.size + 2);
    const Input input = {columns + (partOffsets[firstBrick + brick] - partOffsets[firstBrick]), stride,
                         begins + (size_t)(brick)*cursors, cells, layers, orders};
    if (!hasSamples(&input, inBrick)) return;
    const Voxels v = ownVoxels();
    uint known = 0;
    for (int cube = 0; cube < CUBES; ++cube) {
        const int3 inBlock = CUBES > 1 ? SLICES * (int3)(cube / 4, cube / 2 % 2, cube % 2) : (int3)(0);
        Nearest nearestInner, nearestOuter;
        fillCube(&input, inBrick + inBlock, &v, &inner, &outer, &nearestInner, &nearestOuter);
        UNROLLED for (int i = 0; i < SLICES; ++i) {
            IntLanes inside, knownLanes;
            putSlice(combine(&nearestInner, &nearestOuter, &v, i, &layers, &inside, &knownLanes), i, inBlock, values);
            known |= (uint)(anyLane(knownLanes));
#if TRIANGLES
            putSlice(asLanes(select(nearestInner.owner[i], nearestOuter.owner[i], inside)), i, inBlock, owners);
#else
            (void)(owners);
#endif
        }
    }
    MEET;
    if (ITEM == 0) anyKnown = 0;
    MEET;
    if (known) anyKnown = 1;
    MEET;
    if (!anyKnown) return;
    if (ITEM == 0) {
        slot = atomic_inc(counters + FILLED_BLOCKS);
        vstore3(brickAt(&grid, cellOfBrick[firstBrick + brick]) * (1 << grid.shift) + inBrick, slot, origins);
    }
    MEET;
    for (uint i = ITEM; i < BLOCK_VOXELS / LANES; i += ITEMS) {
        const size_t place = (size_t)(slot) * (BLOCK_VOXELS / LANES) + i;
        storeGlobalLanes(vloadLanes(i, values), place, distances);
#if TRIANGLES
        storeGlobalLanes(vloadLanes(i, owners), place, (global float*)(nearestTriangles));
#else
        (void)(nearestTriangles);
#endif
    }
}
