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

// Points of a layer that are applied in one go.
#define PAGE 256
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
    for (;;) {
        MEET;
        if (ITEM == 0) {
            taken = atomic_inc(next);
            count = 0;
        }
        MEET;
        if (taken >= bricks) return;
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

// Points of a layer.
typedef struct {
    float x[PAGE], y[PAGE], z[PAGE], halfSquare[PAGE];
#if TRIANGLES
    int owner[PAGE];
#endif
#if PAPER_CUBE
    float centre[3][PAGE];  // the lattice point nearest to the sample
#endif
    uint count;
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
    for (uint p = 0; p < points->count; ++p) {
        const float along = points->x[p];
        Lanes across = multiplyAdd(
            v->z, (Lanes)(points->z[p]), multiplyAdd(v->y, (Lanes)(points->y[p]), (Lanes)(-points->halfSquare[p])));
#if PAPER_CUBE
        const Lanes away = max(fabs(v->y - points->centre[1][p]), fabs(v->z - points->centre[2][p]));
        across = select((Lanes)(-INFINITY), across, away <= (float)(cube));
#else
        (void)(cube);
#endif
        UNROLLED for (int i = 0; i < SLICES; ++i) {
#if PAPER_CUBE
            if (fabs(sliceAt(i) - points->centre[0][p]) > (float)(cube)) continue;
#endif
            const Lanes some = multiplyAdd((Lanes)(along), (Lanes)(sliceAt(i)), across);
#if TRIANGLES
            nearest->owner[i] =
                select(nearest->owner[i], (IntLanes)(points->owner[p]), some > nearest->greatest[i]);
#endif
            nearest->greatest[i] = max(nearest->greatest[i], some);
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

// Picks the points of a layer, out of some, that reach the voxels: those nearer than the root of reach2.
INLINED void pick(SHARED Points* points, uint among, Real3 at, float reach2, const int* owners, const Real3* centre) {
    const Real away2 = squareSum(beyondSide(at.x), beyondSide(at.y), beyondSide(at.z));
    uint near = bitsOfReal(away2 < reach2) & among;
    if (near == 0) return;
    float numbers[4][BATCH];
    storeReal(at.x, numbers[0]);
    storeReal(at.y, numbers[1]);
    storeReal(at.z, numbers[2]);
    storeReal(0.5f * squareSum(at.x, at.y, at.z), numbers[3]);
#if PAPER_CUBE
    float centres[3][BATCH];
    storeReal(centre->x, centres[0]);
    storeReal(centre->y, centres[1]);
    storeReal(centre->z, centres[2]);
#else
    (void)(centre);
#endif
#if ITEMS > 1
    uint to = atomic_add(&points->count, popcount(near));
#else
    uint to = points->count;
    points->count += popcount(near);
#endif
    for (; near != 0; near &= near - 1, ++to) {
        const int lane = lowestBit(near);
        points->x[to] = numbers[0][lane];
        points->y[to] = numbers[1][lane];
        points->z[to] = numbers[2][lane];
        points->halfSquare[to] = numbers[3][lane];
#if TRIANGLES
        points->owner[to] = owners[lane];
#else
        (void)(owners);
#endif
#if PAPER_CUBE
        for (int axis = 0; axis < 3; ++axis) points->centre[axis][to] = centres[axis][lane];
#endif
    }
}

// What a block works from.
typedef struct {
    global const float* columns;  // from the first sample of the brick on
    uint stride;
    global const uint* begins;  // of the brick's cells
    SampleCells cells;
    Layers layers;
} Input;

// Picks the points of both layers around samples begin + ITEM * BATCH ..
INLINED void pickSome(const Input* input, uint begin, uint end, float3 middle, SHARED Points* inner,
                      SHARED Points* outer) {
    const uint at = begin + ITEM * BATCH;
    if (at >= end) return;
    global const float* columns = input->columns + at;
    const uint stride = input->stride;
    uint among = end - at < BATCH ? (1u << (end - at)) - 1 : (1u << BATCH) - 1;
    const Real3 place = make3(loadReal(columns + PLACE_X * stride), loadReal(columns + PLACE_Y * stride),
                              loadReal(columns + PLACE_Z * stride)),
                offset = make3(loadReal(columns + OFFSET_X * stride), loadReal(columns + OFFSET_Y * stride),
                               loadReal(columns + OFFSET_Z * stride)),
                seen = make3(place.x - middle.x, place.y - middle.y, place.z - middle.z);
    Real3 centre = seen;
#if PAPER_CUBE
    const float most = (float)(input->layers.cube) + HALF_SIDE;
    centre = make3(nearestLattice(place.x) - middle.x, nearestLattice(place.y) - middle.y,
                   nearestLattice(place.z) - middle.z);
    among &= bitsOfReal((fabs(centre.x) <= most) & (fabs(centre.y) <= most) & (fabs(centre.z) <= most));
#endif
    int owners[BATCH];
#if TRIANGLES
    for (int lane = 0; lane < BATCH; ++lane) owners[lane] = as_int(columns[OWNER * stride + lane]);
#endif
    const float reach2 = square(input->layers.certain);
    pick(inner, among, sub3(seen, offset), reach2, owners, &centre);
    pick(outer, among, add3(seen, offset), reach2, owners, &centre);
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
    for (int x = cell.x; x < cell.x + along; ++x)
        for (int y = cell.y; y < cell.y + along; ++y) {
            global const uint* row = input->begins + (x * size + y) * size + cell.z;
            const uint end = row[along];
            for (uint i = row[0]; i < end; i += ITEMS * BATCH) {
                pickSome(input, i, end, middle, inner, outer);
                MEET;
                if (max(inner->count, outer->count) > PAGE - ITEMS * BATCH) {
                    applyPoints(inner, v, cube, nearestInner);
                    applyPoints(outer, v, cube, nearestOuter);
                    MEET;
                    if (ITEM == 0) inner->count = outer->count = 0;
                }
                MEET;
            }
        }
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
    vstore4(values.s0123, 0, corner);
    vstore4(values.s4567, 2, corner);
    vstore4(values.s89ab, 4, corner);
    vstore4(values.scdef, 6, corner);
#endif
}

#if LANES == 16
#define asLanes as_float16
#else
#define asLanes as_float8
#endif

enum { FILLED_BLOCKS };

// A group fills a block of a brick. Blocks that hold distances go to the next places of `origins`, `distances` and
// `nearestTriangles`.
GROUP_KERNEL void fillBlocks(Grid grid, global const uint* cellOfBrick, global const uint* partOffsets,
                             uint firstBrick, global const float* columns, global const uint* begins, uint stride,
                             Layers layers, global int* origins, global float* distances, global int* nearestTriangles,
                             global uint* counters) {
    SHARED Points inner, outer;
    SHARED float values[BLOCK_VOXELS], owners[TRIANGLES ? BLOCK_VOXELS : 1];
    SHARED uint slot, anyKnown;
    const int side = (1 << grid.shift) / BLOCK_SIDE;
    const uint perBrick = (uint)(side * side * side), brick = (uint)(get_group_id(0)) / perBrick;
    const int number = (int)(get_group_id(0) % perBrick);
    const int3 inBrick = BLOCK_SIDE * (int3)(number / side / side, number / side % side, number % side);
    const SampleCells cells = cellsFor(&grid);
    const uint cursors = (uint)(cells.size * cells.size * cells.size + 2);
    const Input input = {columns + (partOffsets[firstBrick + brick] - partOffsets[firstBrick]), stride,
                         begins + (size_t)(brick)*cursors, cells, layers};
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
        vstoreLanes(vloadLanes(i, values), place, distances);
#if TRIANGLES
        vstoreLanes(vloadLanes(i, owners), place, (global float*)(nearestTriangles));
#else
        (void)(nearestTriangles);
#endif
    }
}
