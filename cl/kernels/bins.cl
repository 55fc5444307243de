// SPDX-License-Identifier: Apache-2.0
// Bins triangles by the bricks that they reach, by count, scan and scatter: sdf/fill/triangle_bins.h on a device. A
// program that includes this file defines the parts that a triangle is cut into.
#include "vectors.cl"

// Sampling options of the double layer method (DoubleLayerOptions of sdf/options.h); unused by others.
typedef struct {
    double epsilon;
    int maxSubdivision, fillGaps, recursive;
} Sampling;

// BrickRange of sdf/fill/triangle_bins.cpp, and the parameters of the binning.
typedef struct {
    double voxelsPerUnit;  // [1/m]
    double reach;          // maximum distance of a voxel from a triangle [voxels]
    double margin;         // parts farther than this from a brick do not affect it [voxels]
    int first[3];          // [bricks]
    int size[3];           // [bricks]
    int shift;             // edge of a brick: 2^shift voxels
    uint triangles;
    uint cells;  // count of all bricks
    uint runs;   // runs of triangles, each with its own counters
    Sampling sampling;
} Grid;

// Takes the next brick of a batch for this group, with no parts so far. Groups take bricks one after another.
uint takeBrick(global uint* next, SHARED uint* taken, SHARED uint* parts) {
    BARRIER;
    if (ITEM == 0) {
        *taken = atomic_inc(next);
        *parts = 0;
    }
    BARRIER;
    return *taken;
}

// The parts of each triangle of a batch that are the same for all bricks; 0 if they depend on the brick.
RealInt partsOfBatch(const Grid* grid, const Batch* batch);

// The maximum number of parts that a brick with these limits cuts a triangle into.
uint countParts(const Grid* grid, const Corners* triangle, const Limits* limits);

int3 toInt3(const int* v) {
    return (int3)(v[0], v[1], v[2]);
}

int3 brickAt(const Grid* grid, uint cell) {
    const uint y = (uint)(grid->size[1]), z = (uint)(grid->size[2]);
    return toInt3(grid->first) + (int3)((int)(cell / z / y), (int)(cell / z % y), (int)(cell % z));
}

uint cellAt(const Grid* grid, int3 brick) {
    return ((uint)(brick.x) * (uint)(grid->size[1]) + (uint)(brick.y)) * (uint)(grid->size[2]) + (uint)(brick.z);
}

Limits limitsOf(const Grid* grid, int3 brick) {
    const double3 origin = convert_double3(brick * (1 << grid->shift));
    const Limits limits = {origin - grid->margin, origin + ((double)((1 << grid->shift) - 1) + grid->margin)};
    return limits;
}

// Whether an axis separates a triangle from a box around the origin, grown by the reach.
bool separates(double3 axis, double3 a, double3 b, double3 c, double3 halfSize, double reach) {
    const double x = dot(axis, a), y = dot(axis, b), z = dot(axis, c);
    const double limit = dot(fabs(axis), halfSize) + reach * length(axis);
    return min(x, min(y, z)) > limit || max(x, max(y, z)) < -limit;
}

// Separating axis test of a triangle and a box of bricks, grown by the reach. The planes are parallel to the triangle,
// to a side of the box, or to an edge of each (S. Gottschalk and others, SIGGRAPH 1996).
bool isOutOfReach(const Grid* grid, const Corners* t, int3 lower, int3 upper) {
    const double side = (double)(1 << grid->shift), reach = grid->reach + 1;
    const double3 low = convert_double3(toInt3(grid->first) + lower) * side,
                  high = convert_double3(toInt3(grid->first) + upper + 1) * side;
    const double3 centre = 0.5 * (low + high), halfSize = 0.5 * (high - low);
    const double3 a = t->a - centre, b = t->b - centre, c = t->c - centre;
    const double3 edges[3] = {b - a, c - b, a - c};
    if (separates((double3)(1, 0, 0), a, b, c, halfSize, reach) ||
        separates((double3)(0, 1, 0), a, b, c, halfSize, reach) ||
        separates((double3)(0, 0, 1), a, b, c, halfSize, reach) ||
        separates(cross(edges[0], c - a), a, b, c, halfSize, reach))
        return true;
    for (int i = 0; i < 3; ++i) {
        const double3 e = edges[i];
        if (separates((double3)(0, -e.z, e.y), a, b, c, halfSize, reach) ||
            separates((double3)(e.z, 0, -e.x), a, b, c, halfSize, reach) ||
            separates((double3)(-e.y, e.x, 0), a, b, c, halfSize, reach))
            return true;
    }
    return false;
}

// Counters and lists of the bricks around a triangle.
typedef struct {
    global uint* cursors;     // of each cell: count of triangles, later the index of the next one
    global uint* extraParts;  // while counting: parts of a cell's triangles beyond one each
    global uint* list;        // while listing: triangles of each cell; null while counting
    uint triangle;
} Bins;

// Adds `parts` parts of the triangle to the cell; 0 if they must be counted.
void addToBrick(const Bins* bins, const Grid* grid, const Corners* t, uint cell, uint parts) {
    const uint slot = fetchAddGlobal(bins->cursors + cell, 1);
    if (bins->list) {
        bins->list[slot] = bins->triangle;
    } else if (parts != 1) {
        const Limits limits = limitsOf(grid, brickAt(grid, cell));
        // a result below one is correct too: sums of unsigned numbers wrap around
        atomic_add(bins->extraParts + cell, (parts ? parts : countParts(grid, t, &limits)) - 1);
    }
}

// Halves boxes of bricks, and skips those that the triangle does not reach. The cost of a needle is thus proportional
// to its length, not to the box around it.
#define MAX_BOXES 100  // three times the bits of a coordinate
void addToBricks(const Bins* bins, const Grid* grid, const Corners* t, int3 lowest, int3 highest, uint parts) {
    int3 lower[MAX_BOXES], upper[MAX_BOXES];
    int waiting = 1;
    lower[0] = lowest;
    upper[0] = highest;
    while (waiting > 0) {
        --waiting;
        const int3 low = lower[waiting], high = upper[waiting], size = high - low;
        if (isOutOfReach(grid, t, low, high)) continue;
        if (size.x + size.y + size.z == 0) {
            addToBrick(bins, grid, t, cellAt(grid, low), parts);
            continue;
        }
        const int3 axis = size.x >= size.y && size.x >= size.z ? (int3)(1, 0, 0)
                          : size.y >= size.z                   ? (int3)(0, 1, 0)
                                                               : (int3)(0, 0, 1);
        const int3 middle = axis * (low + size / 2) + (1 - axis) * high;
        lower[waiting] = low;
        upper[waiting++] = middle;
        lower[waiting] = axis * (middle + 1) + (1 - axis) * low;
        upper[waiting++] = high;
    }
}

// The bricks around most triangles are at most two along each axis. A 32-bit code holds the lowest brick and the axes
// with two bricks, so that they are computed once.
#define MANY_BRICKS UINT_MAX

void addToFewBricks(const Bins* bins, const Grid* grid, const Corners* t, uint code, uint parts) {
    const uint lowest = code >> 3, xStep = (uint)(grid->size[1] * grid->size[2]), yStep = (uint)(grid->size[2]);
    for (uint x = 0; x <= (code >> 2 & 1); ++x)
        for (uint y = 0; y <= (code >> 1 & 1); ++y)
            for (uint z = 0; z <= (code & 1); ++z) addToBrick(bins, grid, t, lowest + x * xStep + y * yStep + z, parts);
}

// The bricks around the triangles of a batch: lowest and extent, inclusive.
void bricksAround(const Grid* grid, const Batch* batch, Int3* lowest, Int3* extent) {
    const Exact3 low = minExact(batch->a, minExact(batch->b, batch->c)),
                 high = maxExact(batch->a, maxExact(batch->b, batch->c));
    const Int3 first = {toRealInt(floor(low.x - grid->reach)) >> grid->shift,
                        toRealInt(floor(low.y - grid->reach)) >> grid->shift,
                        toRealInt(floor(low.z - grid->reach)) >> grid->shift};
    lowest->x = first.x - grid->first[0];
    lowest->y = first.y - grid->first[1];
    lowest->z = first.z - grid->first[2];
    extent->x = (toRealInt(floor(high.x + grid->reach)) >> grid->shift) - first.x;
    extent->y = (toRealInt(floor(high.y + grid->reach)) >> grid->shift) - first.y;
    extent->z = (toRealInt(floor(high.z + grid->reach)) >> grid->shift) - first.z;
}

void addToManyBricks(const Bins* bins, const Grid* grid, global const float* points, global const uint* triangles,
                     uint parts) {
    const Corners t = cornersOf(points, triangles, bins->triangle, grid->voxelsPerUnit);
    const double3 low = min(t.a, min(t.b, t.c)) - grid->reach, high = max(t.a, max(t.b, t.c)) + grid->reach;
    addToBricks(bins, grid, &t, (convert_int3(floor(low)) >> grid->shift) - toInt3(grid->first),
                (convert_int3(floor(high)) >> grid->shift) - toInt3(grid->first), parts);
}

// Counts the triangles of a batch in the bricks around them, and stores their codes.
void countBatch(Bins* bins, const Grid* grid, const Batch* batch, global const float* points,
                global const uint* triangles, global uint* codes) {
    Int3 lowest, extent;
    bricksAround(grid, batch, &lowest, &extent);
    const RealInt code = ((lowest.x * grid->size[1] + lowest.y) * grid->size[2] + lowest.z) << 3 | extent.x << 2 |
                         extent.y << 1 | extent.z;
    const uint few = bitsOfReal((extent.x <= 1) & (extent.y <= 1) & (extent.z <= 1));
    int all[BATCH], parts[BATCH];
    storeRealInt(code, all);
    storeRealInt(partsOfBatch(grid, batch), parts);
    for (uint rest = batch->valid; rest != 0; rest &= rest - 1) {
        const int lane = lowestBit(rest);
        bins->triangle = batch->triangle[lane];
        if (few >> lane & 1) {
            codes[bins->triangle] = (uint)(all[lane]);
            Corners t;
            if (parts[lane] == 0) t = cornersOf(points, triangles, bins->triangle, grid->voxelsPerUnit);
            addToFewBricks(bins, grid, &t, (uint)(all[lane]), (uint)(parts[lane]));
        } else {
            codes[bins->triangle] = MANY_BRICKS;
            addToManyBricks(bins, grid, points, triangles, (uint)(parts[lane]));
        }
    }
}

// The triangles of this item. If one item does a group's work, they are a run with its own counters, so that no counter
// is shared and the lists are in ascending order. Otherwise all items count together, a batch at each step.
typedef struct {
    ulong begin, end, step;
    uint run;
} TriangleRange;

TriangleRange ownRange(const Grid* grid) {
    const ulong count = grid->triangles, item = get_global_id(0), items = get_global_size(0);
#if ITEMS > 1
    const TriangleRange range = {item, count, items, 0};
#else
    const TriangleRange range = {count * item / items, count * (item + 1) / items, BATCH, (uint)(item)};
#endif
    return range;
}

// `cursors` has runs x cells counters, `more` has one per cell; all must be zero. Stores a code for each triangle.
kernel void countTriangles(global const float* points, global const uint* triangles, Grid grid, global uint* cursors,
                           global uint* extraParts, global uint* codes) {
    const TriangleRange range = ownRange(&grid);
    Bins bins = {cursors + range.run * grid.cells, extraParts, 0, 0};
    for (ulong i = range.begin; i < range.end; i += range.step) {
        Batch batch;
        fetchBatch(&batch, points, triangles, 0, (uint)(i), (uint)(range.end), grid.voxelsPerUnit);
        countBatch(&bins, &grid, &batch, points, triangles, codes);
    }
}

// Converts counts to offsets by a scan. The b-th brick that has triangles gets its cell, its first triangle and its
// first part. `total` receives the counts of such bricks, of triangles and of parts. One group does all the work.
GROUP_KERNEL void scanBricks(Grid grid, global uint* cursors, global const uint* extraParts, global uint* cellOfBrick,
                             global uint* triangleOffsets, global uint* partOffsets, global ulong* total) {
    SHARED ulong bricks[ITEMS], triangles[ITEMS], pieces[ITEMS];
    const uint begin = (uint)((ulong)(grid.cells) * ITEM / ITEMS),
               end = (uint)((ulong)(grid.cells) * (ITEM + 1) / ITEMS);
    ulong brick = 0, triangle = 0, part = 0;
    for (uint cell = begin; cell < end; ++cell) {
        uint inCell = 0;
        for (uint run = 0; run < grid.runs; ++run) inCell += cursors[run * grid.cells + cell];
        brick += inCell > 0;
        triangle += inCell;
        part += (uint)(inCell + extraParts[cell]);
    }
    bricks[ITEM] = brick;
    triangles[ITEM] = triangle;
    pieces[ITEM] = part;
    BARRIER;
    brick = triangle = part = 0;
    for (uint i = 0; i < ITEM; ++i) {
        brick += bricks[i];
        triangle += triangles[i];
        part += pieces[i];
    }
    for (uint cell = begin; cell < end; ++cell) {
        const ulong first = triangle;
        for (uint run = 0; run < grid.runs; ++run) {
            global uint* cursor = cursors + run * grid.cells + cell;
            const uint count = *cursor;
            *cursor = (uint)(triangle);
            triangle += count;
        }
        const uint inCell = (uint)(triangle - first);
        if (inCell == 0) continue;
        cellOfBrick[brick] = cell;
        triangleOffsets[brick] = (uint)(first);
        partOffsets[brick++] = (uint)(part);
        part += (uint)(inCell + extraParts[cell]);
    }
    if (ITEM < ITEMS - 1) return;
    triangleOffsets[brick] = (uint)(triangle);
    partOffsets[brick] = (uint)(part);
    total[0] = brick;
    total[1] = triangle;
    total[2] = part;
}

// Lists the triangles of each brick, at the offsets from scanBricks().
kernel void listTriangles(global const float* points, global const uint* triangles, Grid grid, global uint* cursors,
                          global const uint* codes, global uint* list) {
    const TriangleRange range = ownRange(&grid);
    Bins bins = {cursors + range.run * grid.cells, 0, list, 0};
    const ulong step = ITEMS > 1 ? range.step : 1;
    for (ulong i = range.begin; i < range.end; i += step) {
        bins.triangle = (uint)(i);
        if (codes[i] != MANY_BRICKS)
            addToFewBricks(&bins, &grid, 0, codes[i], 1);
        else
            addToManyBricks(&bins, &grid, points, triangles, 1);
    }
}
