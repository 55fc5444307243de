// SPDX-License-Identifier: Apache-2.0
// The signed distances of a cube of voxels, from the samples in the cells around it: sdf/fill/layer_block.cpp on a
// device.
#include "layer_points.cl"

// Rows of cells that an item tests at once.
#define MAX_ROWS 64
// layerTie of sdf/leaf/blocks.h [voxels^2].
#define LAYER_TIE 1e-5f
// Rounding of a position relative to a block [voxels].
#define SELECTION_SLACK 1e-3f

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
#if ITEMS == 1
    global const ulong* orders;  // see addSelected()
#endif
} Input;

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

#if ITEMS > 1

// The samples around a block, and the nearest points of both layers so far for a part of one of its cubes.
typedef struct {
    const Input* input;
    const Voxels* voxels;
    SHARED SelectedSamples* samples;
    SHARED uint* selected;  // count of selected samples
    Nearest nearestInner, nearestOuter;
    float3 middle, blockMiddle;
    uint pending;  // maximum count of selected samples
    bool any;      // whether any sample reaches the block
} Cube;

INLINED void clearSelection(Cube* cube) {
    *cube->selected = 0;
}

// Tests a layer's point, if it reaches the cube.
INLINED void applyLayerPoint(const Cube* cube, Point* point, float3 position, Nearest* nearest) {
    const Real3 p = make3(position.x, position.y, position.z);
    if (distance2ToCube(p, HALF_SIDE) >= square(cube->input->layers.certain)) return;
    point->x = position.x;
    point->y = position.y;
    point->z = position.z;
    point->halfSquare = halfSquareOf(p);
    applyPoint(point, cube->voxels, cube->input->layers.cube, nearest);
}

// Tests the points of both layers around a selected sample.
INLINED void applySample(Cube* cube, uint i) {
    SHARED const SelectedSamples* s = cube->samples;
    const float3 position = (float3)(s->position[0][i], s->position[1][i], s->position[2][i]),
                 offset = (float3)(s->offset[0][i], s->offset[1][i], s->offset[2][i]),
                 relative = position - cube->middle;
    Point point;
#if PAPER_CUBE
    const float3 centre = nearestLattice(position) - cube->middle;
    const float limit = (float)(cube->input->layers.cube) + HALF_SIDE;
    if (fabs(centre.x) > limit || fabs(centre.y) > limit || fabs(centre.z) > limit) return;
    vstore3(centre, 0, point.centre);
#endif
#if TRIANGLES
    point.owner = s->owner[i];
#endif
    applyLayerPoint(cube, &point, relative - offset, &cube->nearestInner);
    applyLayerPoint(cube, &point, relative + offset, &cube->nearestOuter);
}

INLINED void applyPending(Cube* cube) {
    const uint count = *cube->selected;
    cube->any |= count > 0;
    for (uint i = 0; i < count; ++i) applySample(cube, i);
}

// Selects a sample if a point of either layer may reach a cube of the block.
INLINED void selectSample(Cube* cube, uint sample) {
    global const float* columns = cube->input->columns + sample;
    const uint stride = cube->input->stride;
    const float3 position = (float3)(columns[POSITION_X * stride], columns[POSITION_Y * stride],
                                     columns[POSITION_Z * stride]),
                 offset = (float3)(columns[OFFSET_X * stride], columns[OFFSET_Y * stride], columns[OFFSET_Z * stride]),
                 relative = position - cube->blockMiddle, inner = relative - offset, outer = relative + offset;
    const float halfBlock = 0.5f * (BLOCK_SIDE - 1),
                distance2 = min(distance2ToCube(make3(inner.x, inner.y, inner.z), halfBlock),
                                distance2ToCube(make3(outer.x, outer.y, outer.z), halfBlock));
    if (distance2 >= square(cube->input->layers.certain + SELECTION_SLACK)) return;
    SHARED SelectedSamples* s = cube->samples;
    const uint slot = atomic_inc(cube->selected);
    s->position[0][slot] = position.x;
    s->position[1][slot] = position.y;
    s->position[2][slot] = position.z;
    s->offset[0][slot] = offset.x;
    s->offset[1][slot] = offset.y;
    s->offset[2][slot] = offset.z;
#if TRIANGLES
    s->owner[slot] = as_int(columns[OWNER * stride]);
#endif
}

#else

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

INLINED void clearSelection(Cube* cube) {
    *cube->inner.selected = *cube->outer.selected = 0;
}

INLINED void applyPending(Cube* cube) {
    if (*cube->inner.selected + *cube->outer.selected == 0) return;
    cube->any = true;
    applyPoints(cube->inner, cube->voxels, cube->input->layers.cube, &cube->nearestInner);
    applyPoints(cube->outer, cube->voxels, cube->input->layers.cube, &cube->nearestOuter);
}

#endif

// Tests the points that are selected so far.
INLINED void applyLayers(Cube* cube) {
    BARRIER;
    applyPending(cube);
    BARRIER;
    if (ITEM == 0) clearSelection(cube);
    BARRIER;
    cube->pending = 0;
}

// Adds the points around samples begin .. end - 1.
INLINED void storeSamples(Cube* cube, uint begin, uint end) {
    for (uint i = begin; i < end; i += ITEMS * BATCH) {
        if (cube->pending > PAGE - ITEMS * BATCH) applyLayers(cube);
#if ITEMS > 1
        if (i + ITEM < end) selectSample(cube, i + ITEM);
        cube->pending += min(end - i, (uint)(ITEMS));
#else
        storeLayerPoints(cube->input, i, end, cube->middle, cube->pending, cube->inner, cube->outer);
        cube->pending += BATCH;
#endif
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

// Finds the nearest points of both layers for the voxels of a cube. `corner` is its first voxel in the brick, and
// `selectionCorner` that of the cube or block that points are selected for. Returns false if no point reaches it.
INLINED bool fillCube(Cube* cube, int3 corner, int3 selectionCorner) {
    cube->middle = convert_float3(corner) + HALF_SIDE;
#if ITEMS > 1
    cube->blockMiddle = convert_float3(selectionCorner) + 0.5f * (BLOCK_SIDE - 1);
#endif
    cube->pending = 0;
    cube->any = false;
    clear(&cube->nearestInner);
    clear(&cube->nearestOuter);
    BARRIER;
    if (ITEM == 0) clearSelection(cube);
    BARRIER;
    storeCells(cube, selectionCorner / CELL_SIDE);
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
