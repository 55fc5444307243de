// SPDX-License-Identifier: Apache-2.0
// Lays out the blocks that a filler has left on the device. Produces the same numbers as trimToBand(), Assembler and
// FieldLayout on the host.
#include "layout.cl"

// An unknown block, or an entry of the directory without a block so far.
#define UNKNOWN -3
// A block that the band overlaps.
#define NEEDED 0
// bandEdge of sdf/leaf/band.h [voxels].
#define BAND_EDGE 1e-5f
// As in collider/field/layout/coarse_distance.cpp, clearance.h and field_layout.cpp.
#define MAX_CELLS 16
// Maximum stored distance [CLEARANCE_STEPS].
#define MAX_CLEARANCE_STEPS 127
#define NEAR_SURFACE (0.5f * 1.7320508f)

// BandWidths of sdf/leaf/band.h.
typedef struct {
    float exterior, interior, voxelSize;
} Widths;

// Summary of all blocks. Boxes are of the first voxels of needed blocks and of the active voxels.
typedef struct {
    int needed, conflicts;
    int blockLower[3], blockUpper[3], activeLower[3], activeUpper[3];
} Summary;

// Sides of a voxel, and bits of a block: a side's bit is set if the block has such voxels.
#define NO_SIDE 0
#define OUTSIDE 1
#define INSIDE 2
#define ACTIVE 4
#define OPEN 8

// Combines the bits of all items by OR.
uint combineBits(SHARED uint* bits, uint own) {
    bits[ITEM] = own;
    BARRIER;
    uint all = 0;
    for (uint i = 0; i < ITEMS; ++i) all |= bits[i];
    BARRIER;
    return all;
}

uint sideBits(SHARED const uchar* sides, int voxel) {
    const int x = voxel / (BLOCK_SIDE * BLOCK_SIDE), y = voxel / BLOCK_SIDE % BLOCK_SIDE, z = voxel % BLOCK_SIDE;
    const int last = BLOCK_SIDE - 1, xStep = BLOCK_SIDE * BLOCK_SIDE, yStep = BLOCK_SIDE;
    return (x > 0 ? sides[voxel - xStep] : 0) | (x < last ? sides[voxel + xStep] : 0) |
           (y > 0 ? sides[voxel - yStep] : 0) | (y < last ? sides[voxel + yStep] : 0) | (z > 0 ? sides[voxel - 1] : 0) |
           (z < last ? sides[voxel + 1] : 0);
}

// Propagates the known sides to voxels without a side, one step at a time. If both arrive at once, outside wins.
// Returns the buffer with the result.
SHARED uchar* growSides(SHARED uchar* from, SHARED uchar* to, SHARED uint* bits) {
    for (;;) {
        uint changed = 0;
        for (uint v = ITEM; v < BLOCK_VOXELS; v += ITEMS) {
            uint side = from[v];
            if (side == NO_SIDE) {
                side = sideBits(from, v);
                side = side & OUTSIDE ? OUTSIDE : side;
                changed |= side;
            }
            to[v] = (uchar)(side);
        }
        SHARED uchar* const next = to;
        to = from;
        from = next;
        if (!combineBits(bits, changed)) return from;
    }
}

// edgeOfBand() of sdf/leaf/band.h [m].
float edgeOfBand(float width, float voxelSize) {
    return width * voxelSize - BAND_EDGE * voxelSize;
}

// Whether a signed distance lies in the band [m].
bool isActive(float distance, const Widths* widths) {
    return distance < edgeOfBand(widths->exterior, widths->voxelSize) &&
           distance > -edgeOfBand(widths->interior, widths->voxelSize);
}

// Racy reads avoid most of the atomic operations: bounds only ever widen.
void addToBox(volatile global int* lower, volatile global int* upper, int3 low, int3 high) {
    if (low.x < lower[0]) atomic_min(lower, low.x);
    if (low.y < lower[1]) atomic_min(lower + 1, low.y);
    if (low.z < lower[2]) atomic_min(lower + 2, low.z);
    if (high.x > upper[0]) atomic_max(upper, high.x);
    if (high.y > upper[1]) atomic_max(upper + 1, high.y);
    if (high.z > upper[2]) atomic_max(upper + 2, high.z);
}

// Converts distances [voxels] to values [m] as trimToBand() does, a block for each group. `sides` receives the result:
// NEEDED, UNKNOWN, or an empty entry of the directory.
GROUP_KERNEL void trimBlocks(global const int* origins, global const float* distances, Widths widths,
                             global int* keptOrigins, global float* values, global int* sides,
                             global Summary* summary) {
    SHARED uchar first[BLOCK_VOXELS], second[BLOCK_VOXELS];
    SHARED uint bits[ITEMS];
    SHARED int3 lowest[ITEMS], highest[ITEMS];
    const size_t b = get_group_id(0);
    global const float* in = distances + b * BLOCK_VOXELS;
    global float* out = values + b * BLOCK_VOXELS;
    uint has = 0;
    int3 low = INT_MAX, high = INT_MIN;
    for (uint v = ITEM; v < BLOCK_VOXELS; v += ITEMS) {
        const float d = in[v];
        const uint side = d == INFINITY ? NO_SIDE : signbit(d) ? INSIDE : OUTSIDE;
        first[v] = (uchar)(side);
        has |= side == NO_SIDE ? OPEN : side;
        if (!isActive(d * widths.voxelSize, &widths)) continue;
        has |= ACTIVE;
        const int3 place =
            (int3)((int)(v) / (BLOCK_SIDE * BLOCK_SIDE), (int)(v) / BLOCK_SIDE % BLOCK_SIDE, (int)(v) % BLOCK_SIDE);
        low = min(low, place);
        high = max(high, place);
    }
    lowest[ITEM] = low;
    highest[ITEM] = high;
    has = combineBits(bits, has);
    const int3 origin = vload3(b, origins);
    const bool known = has & (OUTSIDE | INSIDE) && origin.x != NO_BLOCK,
               needed = known && (has & ACTIVE || (has & OUTSIDE && has & INSIDE));
    if (ITEM == 0) {
        vstore3(origin, b, keptOrigins);
        sides[b] = !known ? UNKNOWN : needed ? NEEDED : has & INSIDE ? EMPTY_INSIDE : EMPTY_OUTSIDE;
    }
    if (!needed) return;
    SHARED const uchar* side = has & OPEN ? growSides(first, second, bits) : first;
    const float outside = widths.exterior * widths.voxelSize, inside = -widths.interior * widths.voxelSize;
    for (uint v = ITEM; v < BLOCK_VOXELS; v += ITEMS) {
        const float d = in[v] * widths.voxelSize;
        out[v] = isActive(d, &widths) ? d : side[v] == INSIDE ? inside : outside;
    }
    if (ITEM > 0) return;
    for (uint i = 1; i < ITEMS; ++i) {
        low = min(low, lowest[i]);
        high = max(high, highest[i]);
    }
    atomic_inc(&summary->needed);
    addToBox(summary->blockLower, summary->blockUpper, origin, origin);
    if (has & ACTIVE) addToBox(summary->activeLower, summary->activeUpper, origin + low, origin + high);
}

// Copies needed blocks to their final slots and enters all blocks in the directory, a block for each group.
GROUP_KERNEL void placeBlocks(Frame frame, int4 firstVoxel, global const int* origins, global const float* blocks,
                              global const int* sides, global uint* next, global int* directory, global float* values) {
    SHARED uint number;
    const size_t b = get_group_id(0);
    const int side = sides[b];
    const int3 size = vload3(0, frame.blocks), at = (vload3(b, origins) - firstVoxel.xyz) >> 3;
    if (side == UNKNOWN || any(at < 0) || any(at >= size)) return;
    if (ITEM == 0) {
        if (side == NEEDED) number = atomic_inc(next);
        directory[indexOf(at, size)] = side == NEEDED ? (int)(number) : side;
    }
    BARRIER;
    if (side != NEEDED) return;
    for (uint row = ITEM; row < BLOCK_SIDE * BLOCK_SIDE; row += ITEMS) {
        const int3 inBlock = (int3)((int)(row) / BLOCK_SIDE, (int)(row) % BLOCK_SIDE, 0);
        vstore8(vload8(row, blocks + b * BLOCK_VOXELS), 0, values + voxelOf((int)(number), inBlock));
    }
}

int sideOf(float value) {
    return signbit(value) ? EMPTY_INSIDE : EMPTY_OUTSIDE;
}

// The side of an entry's first or last voxel.
int sideAt(int entry, global const float* values, int inBlock) {
    return entry < 0 ? entry : sideOf(values[voxelOf(entry, (int3)(inBlock))]);
}

// Derives the sides of entries without a block from those before them in a column along z. A work-item does a column. A
// column without any block is outside.
kernel void markEmpty(Frame frame, global int* directory, global const float* values) {
    const size_t columns = (size_t)(frame.blocks[0]) * frame.blocks[1], column = get_global_id(0);
    if (column >= columns) return;
    global int* entries = directory + column * frame.blocks[2];
    int first = 0;
    while (first < frame.blocks[2] && entries[first] == UNKNOWN) ++first;
    int side = first < frame.blocks[2] ? sideAt(entries[first], values, 0) : EMPTY_OUTSIDE;
    for (int z = 0; z < frame.blocks[2]; ++z) {
        if (entries[z] == UNKNOWN) entries[z] = side;
        side = sideAt(entries[z], values, BLOCK_SIDE - 1);
    }
}

// An entry of the directory; everything beyond its box is outside.
int entryAt(const Frame* frame, global const int* directory, int3 block) {
    const int3 size = vload3(0, frame->blocks);
    return any(block < 0) || any(block >= size) ? EMPTY_OUTSIDE : directory[indexOf(block, size)];
}

// The value of empty space.
float emptyValue(const Frame* frame, int entry) {
    return entry == EMPTY_INSIDE ? -frame->interiorWidth : frame->exteriorWidth;
}

// Voxel i of the apron: those with z = 8, then y = 8, then x = 8.
int3 apronVoxel(int i) {
    const int faceZ = STRIDE * STRIDE, faceY = STRIDE * BLOCK_SIDE;
    if (i < faceZ) return (int3)(i / STRIDE, i % STRIDE, BLOCK_SIDE);
    i -= faceZ;
    if (i < faceY) return (int3)(i / BLOCK_SIDE, BLOCK_SIDE, i % BLOCK_SIDE);
    i -= faceY;
    return (int3)(BLOCK_SIDE, i / BLOCK_SIDE, i % BLOCK_SIDE);
}

// Copies the first layers of voxels of the upper neighbours; each group does one entry of the directory.
GROUP_KERNEL void fillAprons(Frame frame, global const int* directory, global float* values) {
    const int entry = directory[get_group_id(0)];
    if (entry < 0) return;
    const int3 block = placeAt((uint)(get_group_id(0)), vload3(0, frame.blocks));
    for (int i = (int)(ITEM); i < BLOCK_FLOATS - BLOCK_VOXELS; i += ITEMS) {
        const int3 voxel = apronVoxel(i);
        const int other = entryAt(&frame, directory, block + (voxel >> 3));
        values[voxelOf(entry, voxel)] = other < 0 ? emptyValue(&frame, other) : values[voxelOf(other, voxel & 7)];
    }
}

int3 axisOf(int axis) {
    return (int3)(axis == 0, axis == 1, axis == 2);
}

// Voxel `row` of a layer of 8x8 voxels across an axis.
int3 layerVoxel(int axis, int layer, int row) {
    const int u = row / BLOCK_SIDE, v = row % BLOCK_SIDE;
    return axis == 0 ? (int3)(layer, u, v) : axis == 1 ? (int3)(u, layer, v) : (int3)(u, v, layer);
}

// Whether two neighbouring values have different signs without room for the surface between them. Empty space is at
// least a voxel away from it, or the width of a narrower band.
bool conflict(float a, float b, bool empty, float voxelSize) {
    const float separation = voxelSize * (1 + LINK_SLACK);
    return signbit(a) != signbit(b) && fabs(a) > separation - (empty ? min(fabs(b), voxelSize) : fabs(b));
}

// Counts contradictory neighbours in different blocks, as Assembler::conflicts() does, and empty entries that touch
// entries of the other side. Each group does one entry of the directory.
GROUP_KERNEL void countConflicts(Frame frame, global const int* directory, global const float* values,
                                 global Summary* summary) {
    const int3 block = placeAt((uint)(get_group_id(0)), vload3(0, frame.blocks));
    const int entry = directory[get_group_id(0)];
    int found = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const int next = entryAt(&frame, directory, block + axisOf(axis)),
                  previous = entryAt(&frame, directory, block - axisOf(axis));
        if (entry < 0) {
            if (ITEM == 0) found += (next < 0 && next != entry) + (previous < 0 && previous != entry);
            continue;
        }
        const float before = emptyValue(&frame, previous);
        for (int row = (int)(ITEM); row < BLOCK_SIDE * BLOCK_SIDE; row += ITEMS) {
            const float low = values[voxelOf(entry, layerVoxel(axis, 0, row))],
                        high = values[voxelOf(entry, layerVoxel(axis, BLOCK_SIDE - 1, row))],
                        beyond = values[voxelOf(entry, layerVoxel(axis, BLOCK_SIDE, row))];
            found += conflict(high, beyond, next < 0, frame.voxelSize);
            found += previous < 0 && conflict(low, before, true, frame.voxelSize);
        }
    }
    if (found) atomic_add(&summary->conflicts, found);
}

// The coarse cell of this work-item; some are beyond the last one along z.
int3 ownCell(void) {
    return (int3)((int)(get_global_id(2)), (int)(get_global_id(1)), (int)(get_global_id(0)));
}

// Initialises the clearances: 0 for coarse cells that the surface crosses, `far` for others. Sets only the signs in the
// centres. A work-item does a cell.
kernel void initialiseCells(Frame frame, float far, global const int* directory, global const float* values,
                            global float* distances2, global char* centres) {
    const int3 blocks = vload3(0, frame.blocks), cell = ownCell(), block = cell / COARSE_ALONG;
    if (cell.z >= COARSE_ALONG * blocks.z) return;
    const size_t p = indexOf(cell, COARSE_ALONG * blocks);
    const int entry = directory[indexOf(block, blocks)];
    if (entry < 0) {
        distances2[p] = far;
        centres[centreOf(cell, blocks)] = entry == EMPTY_INSIDE ? -1 : 1;
        return;
    }
    global const float* corner = values + voxelOf(entry, COARSE_SIDE * (cell - COARSE_ALONG * block));
    float minValue = INFINITY, maxValue = -INFINITY, nearest = INFINITY;
    for (int x = 0; x <= COARSE_SIDE; ++x)
        for (int y = 0; y <= COARSE_SIDE; ++y)
            for (int z = 0; z <= COARSE_SIDE; ++z) {
                const float value = corner[(x * STRIDE + y) * STRIDE + z];
                minValue = min(minValue, value);
                maxValue = max(maxValue, value);
                nearest = min(nearest, fabs(value));
            }
    distances2[p] = nearest <= NEAR_SURFACE * frame.voxelSize || (minValue < 0) != (maxValue < 0) ? 0 : far;
    centres[centreOf(cell, blocks)] = minValue < 0 ? -1 : 1;
}

// Propagates squared distances along one more axis: transformRow() of collider/field/layout/coarse_distance.cpp. A work-item
// does a coarse cell.
kernel void transformCells(Frame frame, int axis, global const float* from, global float* to) {
    const int3 size = COARSE_ALONG * vload3(0, frame.blocks);
    const int3 cell = ownCell();
    if (cell.z >= size.z) return;
    const size_t p = indexOf(cell, size), step = axis == 0 ? (size_t)(size.y) * size.z : axis == 1 ? size.z : 1;
    const int i = axis == 0   ? cell.x
                  : axis == 1 ? cell.y
                              : cell.z,
              count = axis == 0   ? size.x
                      : axis == 1 ? size.y
                                  : size.z;
    float best = from[p];
    const int reach = min(MAX_CELLS, max(i, count - 1 - i));
    for (int d = 1; d <= reach; ++d) {
        const float along2 = ((float)(d)-0.5f) * ((float)(d)-0.5f);
        if (along2 >= best) break;
        if (i >= d) best = min(best, along2 + from[p - d * step]);
        if (i + d < count) best = min(best, along2 + from[p + d * step]);
    }
    to[p] = best;
}

// Converts squared distances to distances [CLEARANCE_STEPS], rounded down, with the signs of the centres. A work-item
// does a coarse cell.
kernel void storeCentres(Frame frame, global const float* distances2, global char* centres) {
    const int3 blocks = vload3(0, frame.blocks), cell = ownCell();
    if (cell.z >= COARSE_ALONG * blocks.z) return;
    const int squared = (int)(CLEARANCE_STEPS * CLEARANCE_STEPS * distances2[indexOf(cell, COARSE_ALONG * blocks)]);
    int steps = (int)(sqrt((float)(squared)));
    // a device may round square roots either way
    while (steps * steps > squared) --steps;
    while ((steps + 1) * (steps + 1) <= squared) ++steps;
    global char* centre = centres + centreOf(cell, blocks);
    *centre = (char)(*centre * min(steps, MAX_CLEARANCE_STEPS));
}
