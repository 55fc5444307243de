// SPDX-License-Identifier: Apache-2.0
// The signed distances of a cube of voxels, from the samples in the cells around it: sdf/fill/layer_block.cpp on a
// device.
#include "layer_points.cl"

// Rows of cells that an item tests at once.
#define MAX_ROWS 64
// layerTie of sdf/leaf/blocks.h [voxels^2].
#define LAYER_TIE 1e-5f

// FillParameters of sdf/leaf/blocks.h [voxels].
typedef struct {
    float delta, reach, certain;
    int cube;
} Layers;

// The input of a block.
typedef struct {
    global const float* columns;  // columns from the first sample of the brick on
    uint stride;
    global const uint* begins;  // first samples of the brick's cells
    SampleCells cells;
    Layers layers;
    global const ulong* orders;  // see addSelected()
} Input;

// Stores the points of both layers around samples begin + ITEM * BATCH .. at positions from `first` + ITEM * BATCH on.
INLINED void storeLayerPoints(const Input* input, uint begin, uint end, float3 middle, uint first, Layer inner,
                              Layer outer) {
    const uint at = begin + ITEM * BATCH, to = first + ITEM * BATCH;
    if (at >= end) return;
    global const float* columns = input->columns + at;
    const uint stride = input->stride;
    uint lanes = end - at < BATCH ? (1u << (end - at)) - 1 : (1u << BATCH) - 1;
    const Real3 position = make3(loadReal(columns + POSITION_X * stride), loadReal(columns + POSITION_Y * stride),
                                 loadReal(columns + POSITION_Z * stride)),
                offset = make3(loadReal(columns + OFFSET_X * stride), loadReal(columns + OFFSET_Y * stride),
                               loadReal(columns + OFFSET_Z * stride)),
                relative = make3(position.x - middle.x, position.y - middle.y, position.z - middle.z);
#if PAPER_CUBE
    const float limit = (float)(input->layers.cube) + HALF_SIDE;
    const Real3 centre = make3(nearestLattice(position.x) - middle.x, nearestLattice(position.y) - middle.y,
                               nearestLattice(position.z) - middle.z);
    lanes &= bitsOfReal((fabs(centre.x) <= limit) & (fabs(centre.y) <= limit) & (fabs(centre.z) <= limit));
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
    storePoints(inner, to, lanes, sub3(relative, offset), reach2, input->orders);
    storePoints(outer, to, lanes, add3(relative, offset), reach2, input->orders);
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
    uint pending;  // stored points of each layer that are not tested yet
    bool any;      // whether any point reaches the cube
} Cube;

// Tests the pending points.
INLINED void applyLayers(Cube* cube) {
    BARRIER;
    if (*cube->inner.selected + *cube->outer.selected > 0) {
        cube->any = true;
        applyPoints(cube->inner, cube->voxels, cube->input->layers.cube, &cube->nearestInner);
        applyPoints(cube->outer, cube->voxels, cube->input->layers.cube, &cube->nearestOuter);
    }
    BARRIER;
    if (ITEM == 0) *cube->inner.selected = *cube->outer.selected = 0;
    BARRIER;
    cube->pending = 0;
}

// Adds the points around samples begin .. end - 1.
INLINED void storeSamples(Cube* cube, uint begin, uint end) {
    for (uint i = begin; i < end; i += ITEMS * BATCH) {
        if (cube->pending == PAGE) applyLayers(cube);
        storeLayerPoints(cube->input, i, end, cube->middle, cube->pending, cube->inner, cube->outer);
        cube->pending += ITEMS * BATCH;
    }
}

// Adds the points around all samples of the cells around a cube.
INLINED void storeCells(Cube* cube, int3 cell) {
    const Input* input = cube->input;
    const int size = input->cells.size, along = SELECTION_SIDE / CELL_SIDE + 2 * input->cells.around;
#if ITEMS == 1
    // rows of cells are collected first, and kept if they hold samples: a branch for each would be mispredicted half of
    // the time
    uint begins[MAX_ROWS], ends[MAX_ROWS], rows = 0;
#endif
    global const uint* slab = input->begins + (cell.x * size + cell.y) * size + cell.z;
    for (int x = 0; x < along; ++x, slab += size * size) {
        global const uint* row = slab;
        for (int y = 0; y < along; ++y, row += size) {
#if ITEMS > 1
            storeSamples(cube, row[0], row[along]);
#else
            begins[rows] = row[0];
            ends[rows] = row[along];
            rows += row[0] < row[along];
            if (rows < MAX_ROWS) continue;
            for (uint i = 0; i < rows; ++i) storeSamples(cube, begins[i], ends[i]);
            rows = 0;
#endif
        }
    }
#if ITEMS == 1
    for (uint i = 0; i < rows; ++i) storeSamples(cube, begins[i], ends[i]);
#endif
}

// Finds the nearest points of both layers for the voxels of a cube; `corner` is its first voxel in the brick. Returns
// false if no point reaches it.
INLINED bool fillCube(Cube* cube, int3 corner) {
    cube->middle = convert_float3(corner) + HALF_SIDE;
    cube->pending = 0;
    cube->any = false;
    clear(&cube->nearestInner);
    clear(&cube->nearestOuter);
    BARRIER;
    if (ITEM == 0) *cube->inner.selected = *cube->outer.selected = 0;
    BARRIER;
    storeCells(cube, corner / CELL_SIDE);
    applyLayers(cube);
    return cube->any;
}

// Eq. 3: computes a slice's signed distances from both layers, and the points' owners. The inside keeps its sign bit
// where the distance is clamped to zero. Returns whether any distance is known.
INLINED uint combine(const Cube* cube, int slice, const Layers* layers, Lanes* values, IntLanes* owners) {
    const Nearest *inner = &cube->nearestInner, *outer = &cube->nearestOuter;
    const Lanes certain2 = square(layers->certain), inner2 = min(distances2(inner, cube->voxels, slice), certain2),
                outer2 = min(distances2(outer, cube->voxels, slice), certain2);
    // where only the outer layer is near enough to be known, the tie has no meaning
    const IntLanes inside = (inner2 < certain2) & (inner2 <= outer2 + LAYER_TIE),
                   known = min(inner2, outer2) < certain2;
    const Lanes clamped = max(sqrt(max(max(inner2, outer2), (Lanes)(0.0f))) - layers->delta, (Lanes)(0.0f));
    *values = select((Lanes)(INFINITY), select(clamped, -clamped, inside), known);
#if TRIANGLES
    *owners = select(inner->owner[slice], outer->owner[slice], inside);
#else
    (void)(owners);
#endif
    return (uint)(anyLane(known));
}
