// SPDX-License-Identifier: Apache-2.0
// The samples of the double layer method in a brick. The parts of triangles are sampled, and the samples are sorted by
// cells of space: sdf/fill/layer_samples.h on a device.
#include "tile_cutter.cl"

// Triangles of up to this many rows are sampled in batches of triangles. The samples of one with more rows are a batch
// of their own.
#define FEW_ROWS 4
// Edge of the cells that samples are sorted by [voxels].
#define CELL_SIDE 4

#if defined(FP_FAST_FMAF) || defined(__FMA__)
#define multiplyAdd fma
#else
#define multiplyAdd(a, b, c) ((a) * (b) + (c))
#endif

// Samples of all bricks of a batch, a column for each number. Positions are in the brick's voxels. Offsets lead from
// them to the outer layer, and negated to the inner layer [voxels]. Only unsorted samples have a cell.
enum { POSITION_X, POSITION_Y, POSITION_Z, OFFSET_X, OFFSET_Y, OFFSET_Z, OWNER, CELL };

// Index of the first sample of a brick of a batch: each brick has space for one more vector.
uint firstSample(global const uint* partOffsets, uint firstBrick, uint brick) {
    return partOffsets[firstBrick + brick] - partOffsets[firstBrick] + brick * LANES;
}

// The cells of a brick: SampleCells of sdf/fill/layer_samples.h.
typedef struct {
    int around;          // cells beyond the brick, and around a cell that are searched
    int size;            // along each axis
    float firstCorner;   // first corner of all cells, on each axis
    float lower, upper;  // bounds of all positions that matter
} SampleCells;

SampleCells cellsFor(const Grid* grid) {
    const float reach = (float)(grid->reach);
    const int side = 1 << grid->shift;
    SampleCells cells;
    // a cell begins half a voxel before its voxels; a tenth of a voxel allows for rounding
    cells.around = 1 + (int)(floor((reach - 0.4f) / CELL_SIDE));
    cells.firstCorner = -0.5f - (float)(cells.around * CELL_SIDE);
    cells.size = side / CELL_SIDE + 2 * cells.around;
    cells.lower = -reach;
    cells.upper = (float)(side - 1) + reach;
    return cells;
}

// The samples of a brick, and their count so far.
typedef struct {
    global float* samples;  // the first sample in the first column
    uint stride;            // of the columns
    global uint* cursors;   // of the cells
    SHARED uint* count;
    double3 origin;  // of the brick
    SampleCells cells;
    float delta;
} SampleOutput;

// Adds the samples of some lanes, except those that do not reach the brick.
void addSamples(SampleOutput* output, uint lanes, Real3 position, Real3 offset, RealInt owner) {
    const SampleCells* c = &output->cells;
    const RealInt within = (position.x >= c->lower) & (position.x <= c->upper) & (position.y >= c->lower) &
                           (position.y <= c->upper) & (position.z >= c->lower) & (position.z <= c->upper);
    lanes &= bitsOfReal(within);
    if (lanes == 0) return;
    const float perCell = 1.0f / CELL_SIDE;
    const RealInt x = toRealInt((position.x - c->firstCorner) * perCell),
                  y = toRealInt((position.y - c->firstCorner) * perCell),
                  z = toRealInt((position.z - c->firstCorner) * perCell);
    global float* to = output->samples + fetchAddShared(output->count, popcount(lanes));
    const uint stride = output->stride;
    storeCompressed(position.x, lanes, to + POSITION_X * stride);
    storeCompressed(position.y, lanes, to + POSITION_Y * stride);
    storeCompressed(position.z, lanes, to + POSITION_Z * stride);
    storeCompressed(offset.x, lanes, to + OFFSET_X * stride);
    storeCompressed(offset.y, lanes, to + OFFSET_Y * stride);
    storeCompressed(offset.z, lanes, to + OFFSET_Z * stride);
    storeCompressed(asReal(owner), lanes, to + OWNER * stride);
    storeCompressed(asReal((x * c->size + y) * c->size + z), lanes, to + CELL * stride);
}

// The vectors that rows and columns of samples are made of.
typedef struct {
    Real3 first, down, across, offset;
} SampleLattice;

Real3 positionIn(const SampleLattice* s, Real row, Real column) {
    return make3(multiplyAdd(column, s->across.x, multiplyAdd(row, s->down.x, s->first.x)),
                 multiplyAdd(column, s->across.y, multiplyAdd(row, s->down.y, s->first.y)),
                 multiplyAdd(column, s->across.z, multiplyAdd(row, s->down.z, s->first.z)));
}

// Adds the samples of Algorithm 1, one of each triangle of a batch at a time: row i has i + 1 of them.
void addRowsOfBatch(SampleOutput* output, Real rows, const SampleLattice* lattice, RealInt owners) {
    for (int i = 0;; ++i) {
        const uint lanes = bitsOfReal(rows > (Real)((float)(i)));
        if (lanes == 0) return;
        for (int j = 0; j <= i; ++j)
            addSamples(output, lanes, positionIn(lattice, (Real)((float)(i)), (Real)((float)(j))), lattice->offset,
                       owners);
    }
}

Real3 splat3(double3 v) {
    return make3((Real)((float)(v.x)), (Real)((float)(v.y)), (Real)((float)(v.z)));
}

// Bits of the first lanes of a batch, at most all of them.
uint firstLanes(int count) {
    return count < BATCH ? (1u << count) - 1 : (1u << BATCH) - 1;
}

// The same for one part of a triangle, with many samples at once.
void addPart(SampleOutput* output, const Corners* t, int rows, double3 normal, uint triangle) {
    const double step = 1.0 / rows;
    const double3 s1 = (t->b - t->a) * step, s2 = (t->c - t->b) * step, s3 = (t->c - t->a) * step;
    const SampleLattice lattice = {splat3(t->a - output->origin + (s1 + s3) / 3.0), splat3(s1), splat3(s2),
                                   splat3(normal * (output->delta / length(normal)))};
    const int count = rows * (rows + 1) / 2;
    for (int k = 0; k < count; k += BATCH) {
        // the roots are exact at the beginning of a row, and far enough from it before
        const Real number = laneNumbers + (float)(k);
        const Real row = floor((sqrt(multiplyAdd(number, (Real)(8.0f), (Real)(1.0f))) - 1.0f) * 0.5f),
                   column = number - 0.5f * multiplyAdd(row, row, row);
        addSamples(output, firstLanes(count - k), positionIn(&lattice, row, column), lattice.offset,
                   (RealInt)((int)(triangle)));
    }
}

// The samples of a thin part.
void addThin(SampleOutput* output, const Corners* t, int along, double3 normal, uint triangle, const Limits* limits) {
    const Thin thin = thinWithin(t, along, limits);
    const Real3 offset = splat3(normal * (output->delta / length(normal))), rise = splat3(thin.rise);
    for (int first = thin.begin; first < thin.end; first += THIN_RUN) {
        const ThinRun run = thinRun(&thin, first);
        const Real3 start = splat3(run.start - output->origin), step = splat3(run.startStep);
        const Real up = (Real)((float)(run.up)), upStep = (Real)((float)(run.upStep)), down = (Real)((float)(run.down)),
                   downStep = (Real)((float)(run.downStep));
        for (int k = 0; k < run.count; k += BATCH) {
            const Real number = laneNumbers + (float)(k);
            const Real across = min(multiplyAdd(number, upStep, up), multiplyAdd(number, downStep, down));
            const Real3 position = make3(multiplyAdd(across, rise.x, multiplyAdd(number, step.x, start.x)),
                                         multiplyAdd(across, rise.y, multiplyAdd(number, step.y, start.y)),
                                         multiplyAdd(across, rise.z, multiplyAdd(number, step.z, start.z)));
            addSamples(output, firstLanes(run.count - k), position, offset, (RealInt)((int)(triangle)));
        }
    }
}

// Samples a triangle that must be cut.
void sampleLarge(SampleOutput* output, const Grid* grid, uint triangle, const Corners* t, double3 normal,
                 const Limits* limits) {
    Tiles tiles;
    Tile tile;
    beginTiles(&tiles, t, normal);
    Shape shape;
    while (nextTile(&tiles, &grid->sampling, limits, &tile, &shape)) {
        if (shape.rows > 0)
            addPart(output, &tile.corners, shape.rows, normal, triangle);
        else
            addThin(output, &tile.corners, shape.along, normal, triangle, limits);
    }
}

Exact3 fromOrigin(Exact3 corner, double3 origin) {
    const Exact3 v = {corner.x - origin.x, corner.y - origin.y, corner.z - origin.z};
    return v;
}

Exact3 scaleExact(Exact3 a, Exact factor) {
    const Exact3 v = {a.x * factor, a.y * factor, a.z * factor};
    return v;
}

Exact3 addExact(Exact3 a, Exact3 b) {
    const Exact3 v = {a.x + b.x, a.y + b.y, a.z + b.z};
    return v;
}

// Samples the triangles of a batch that have few rows. Returns bits of the others that have an area, and the counted
// rows of all.
uint sampleFewRows(SampleOutput* output, const Grid* grid, const Batch* batch, int* rowsOfEach) {
    const Exact3 ab = subExact(batch->b, batch->a), ac = subExact(batch->c, batch->a),
                 bc = subExact(batch->c, batch->b), normal = normals(batch);
    const Exact size = sqrt(squareExact(normal)), rows = rowsOfBatch(&grid->sampling, batch, size), step = 1.0 / rows;
    storeRealInt(toRealInt(rows), rowsOfEach);
    const uint valid = bitsOfExact(size > 0.0) & batch->valid;
    const uint few = bitsOfExact((rows > 0.0) & (rows <= (double)(FEW_ROWS))) & valid;
    if (few != 0) {
        const Exact3 s1 = scaleExact(ab, step), start = scaleExact(addExact(s1, scaleExact(ac, step)), 1.0 / 3.0);
        const SampleLattice lattice = {toReal3(addExact(fromOrigin(batch->a, output->origin), start)), toReal3(s1),
                                       toReal3(scaleExact(bc, step)),
                                       toReal3(scaleExact(normal, (double)(output->delta) / size))};
        addRowsOfBatch(output, select((Real)(0.0f), toReal(rows), lanesOfBits(few)), &lattice,
                       loadRealInt((const int*)(batch->triangle)));
    }
    return valid & ~few;
}

// Samples the triangles of a list.
void sampleTriangles(SampleOutput* output, const Grid* grid, global const float* points, global const uint* triangles,
                     global const uint* list, uint begin, uint end, const Limits* limits) {
    for (uint first = begin + ITEM * BATCH; first < end; first += ITEMS * BATCH) {
        Batch batch;
        fetchBatch(&batch, points, triangles, list, first, end, grid->voxelsPerUnit);
        int rows[BATCH];
        for (uint rest = sampleFewRows(output, grid, &batch, rows); rest != 0; rest &= rest - 1) {
            const int lane = lowestBit(rest);
            const uint triangle = batch.triangle[lane];
            const Corners t = cornersOf(points, triangles, triangle, grid->voxelsPerUnit);
            const double3 normal = normalOf(&t);
            if (rows[lane] > 0)
                addPart(output, &t, rows[lane], normal, triangle);
            else
                sampleLarge(output, grid, triangle, &t, normal, limits);
        }
    }
}

// Sorts the samples of a brick by cell. The cursors must be zero before. Afterwards they hold the first sample of each
// cell, and the end of the last one.
void sortSamples(const SampleOutput* output, uint count, global float* sorted, SHARED uint* sums) {
    const uint cells = (uint)(output->cells.size * output->cells.size * output->cells.size), stride = output->stride;
    global uint* places = (global uint*)(output->samples + CELL * stride);
    global uint* counts = output->cursors + 2;
    SCALAR_LOOP for (uint i = ITEM; i < count; i += ITEMS) fetchAddGlobal(counts + places[i], 1);
    BARRIER;
    const uint begin = cells * ITEM / ITEMS, end = cells * (ITEM + 1) / ITEMS;
    uint sum = 0;
    if (ITEMS > 1) {
        for (uint cell = begin; cell < end; ++cell) sum += counts[cell];
        sums[ITEM] = sum;
        BARRIER;
        sum = 0;
        for (uint i = 0; i < ITEM; ++i) sum += sums[i];
    }
    // converts the count of a cell to the first sample of the next one
    for (uint cell = begin; cell < end; ++cell) counts[cell] = sum += counts[cell];
    BARRIER;
    SCALAR_LOOP for (uint i = ITEM; i < count; i += ITEMS) places[i] =
        fetchAddGlobal(output->cursors + places[i] + 1, 1);
    for (int column = POSITION_X; column <= OWNER; ++column) {
        global const float* from = output->samples + column * stride;
        global float* to = sorted + column * stride;
        SCALAR_LOOP for (uint i = ITEM; i < count; i += ITEMS) to[places[i]] = from[i];
    }
    BARRIER;
}
