// SPDX-License-Identifier: Apache-2.0
// Sorts the members of a brick by cells of space into groups that a block can test or cull as a whole.
#include "bins.cl"

// Groups near a block that are tested at once.
#define PAGE 1024
// Rounding of a group's own numbers, and of its position relative to a block [voxels].
#define GROUP_SLACK 1e-4f
#define BIN_SLACK 1e-3f

// An element of a brick, to be grouped with nearby ones.
typedef struct {
    float position[3];  // in the voxels of the brick
    float radius;       // of its bounding sphere
    float normal[3];
    uint content;  // the index of its content, defined by the kernels
} Member;

// Groups of members of all bricks of a batch, a column for each number. The members of a group end where those of the
// next one begin; so do the ranges of bricks in these columns.
enum { POSITION_X, POSITION_Y, POSITION_Z, RADIUS, NORMAL_X, NORMAL_Y, NORMAL_Z, THICKNESS };

// Summary of all members of a brick, or of an item's share of them.
typedef struct {
    double radii;  // summed up
    float lower[3], upper[3];
} Extent;

Extent addExtents(const Extent* a, const Extent* b) {
    Extent sum;
    sum.radii = a->radii + b->radii;
    for (int axis = 0; axis < 3; ++axis) {
        sum.lower[axis] = min(a->lower[axis], b->lower[axis]);
        sum.upper[axis] = max(a->upper[axis], b->upper[axis]);
    }
    return sum;
}

Extent noExtent(void) {
    const Extent none = {0, {INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    return none;
}

Extent sumExtents(SHARED const Extent* extents) {
    Extent sum = extents[0];
    for (int i = 1; i < ITEMS; ++i) {
        const Extent other = extents[i];
        sum = addExtents(&sum, &other);
    }
    return sum;
}

// A grid of cells over a box.
typedef struct {
    float lower[3];
    float side;
    int size[3];
} Cells;

uint cellOf(const Cells* cells, float3 position) {
    const int3 cell = convert_int3((position - vload3(0, cells->lower)) / cells->side);
    return (uint)((cell.x * cells->size[1] + cell.y) * cells->size[2] + cell.z);
}

Cells makeCells(const Extent* extent, float side) {
    Cells cells;
    cells.side = side;
    for (int axis = 0; axis < 3; ++axis) {
        cells.lower[axis] = extent->lower[axis];
        cells.size[axis] = (int)((extent->upper[axis] - extent->lower[axis]) / side) + 1;
    }
    return cells;
}

float countCells(const Cells* cells) {
    return (float)(cells->size[0]) * (float)(cells->size[1]) * (float)(cells->size[2]);
}

// The groups of a batch.
typedef struct {
    global float* columns;
    global uint* begins;  // the first member of each cluster, and the end of the last one
    uint stride;
} Groups;

void storeGroup(const Groups* groups, uint index, float3 position, float radius, float3 normal, float thickness) {
    global float* column = groups->columns + index;
    const uint stride = groups->stride;
    column[POSITION_X * stride] = position.x;
    column[POSITION_Y * stride] = position.y;
    column[POSITION_Z * stride] = position.z;
    column[RADIUS * stride] = radius;
    column[NORMAL_X * stride] = normal.x;
    column[NORMAL_Y * stride] = normal.y;
    column[NORMAL_Z * stride] = normal.z;
    column[THICKNESS * stride] = thickness;
}

// Sorts members by cell into `sorted`. The members of each non-empty cell form a group. Returns the group count.
uint sortMembers(const Groups* groups, uint first, global const Member* unsorted, global Member* sorted,
                 global uint* cellOfMember, uint count, const Cells* cells, global uint* cursors, SHARED uint2* sums) {
    const uint cellCount = (uint)(cells->size[0] * cells->size[1] * cells->size[2]);
    for (uint cell = ITEM; cell < cellCount; cell += ITEMS) cursors[cell] = 0;
    BARRIER;
    for (uint i = ITEM; i < count; i += ITEMS) {
        const uint cell = cellOf(cells, vload3(0, unsorted[i].position));
        cellOfMember[i] = cell;
        fetchAddGlobal(cursors + cell, 1);
    }
    BARRIER;
    // counts of members and groups before the cells of each item
    const uint begin = (uint)((ulong)(cellCount)*ITEM / ITEMS), end = (uint)((ulong)(cellCount) * (ITEM + 1) / ITEMS);
    uint2 sum = 0;
    if (ITEMS > 1) {
        for (uint cell = begin; cell < end; ++cell) sum += (uint2)(cursors[cell], cursors[cell] > 0);
        sums[ITEM] = sum;
        BARRIER;
        sum = 0;
        for (uint i = 0; i < ITEM; ++i) sum += sums[i];
        BARRIER;  // the last item overwrites sums[0]
    }
    uint group = first + sum.y;
    for (uint cell = begin; cell < end; ++cell) {
        const uint inCell = cursors[cell];
        if (inCell > 0) groups->begins[group++] = first + sum.x;
        cursors[cell] = sum.x;
        sum.x += inCell;
    }
    if (ITEM == ITEMS - 1) {
        groups->begins[group] = first + count;
        sums[0].y = group - first;
    }
    BARRIER;
    const uint found = sums[0].y;
    for (uint i = ITEM; i < count; i += ITEMS) sorted[fetchAddGlobal(cursors + cellOfMember[i], 1)] = unsorted[i];
    BARRIER;
    return found;
}

// Finds the range of a brick's groups, in their order, that may reach each slice of blocks of the same x.
void rangeGroups(const Groups* groups, uint first, uint count, int slices, float reach, global uint2* ranges) {
    for (int slice = (int)(ITEM); slice < slices; slice += ITEMS) ranges[slice] = (uint2)(UINT_MAX, 0);
    BARRIER;
    for (uint c = first + ITEM; c < first + count; c += ITEMS) {
        const float x = groups->columns[POSITION_X * groups->stride + c],
                    beyond = reach + groups->columns[RADIUS * groups->stride + c] + GROUP_SLACK;
        const int low = clamp(convert_int_rtn((x - beyond - (BLOCK_SIDE - 1)) / BLOCK_SIDE), 0, slices),
                  high = clamp(convert_int_rtn((x + beyond) / BLOCK_SIDE), -1, slices - 1);
        for (int slice = low; slice <= high; ++slice) {
            global uint* range = (global uint*)(ranges + slice);
#if ITEMS > 1
            atomic_min(range, c);
            atomic_max(range + 1, c + 1);
#else
            range[0] = min(range[0], c);
            range[1] = max(range[1], c + 1);
#endif
        }
    }
}

// A block's position, and the groups that may reach it.
typedef struct {
    Groups groups;
    uint2 range;     // groups that may reach its slice of blocks
    int3 block;      // index coordinates of its first voxel
    float3 inBrick;  // the same in the voxels of the brick
    float reach;     // [voxels]
} BlockGroups;

// The block of this work-group, out of all blocks of a batch of bricks.
BlockGroups ownBlockGroups(const Grid* grid, const Groups* groups, global const uint* cellOfBrick, uint firstBrick,
                           global const uint2* ranges) {
    const int side = (1 << grid->shift) / BLOCK_SIDE;
    const uint perBrick = (uint)(side * side * side), brick = (uint)(get_group_id(0)) / perBrick;
    const int number = (int)(get_group_id(0) % perBrick);
    const int3 inBrick = BLOCK_SIDE * (int3)(number / side / side, number / side % side, number % side);
    const BlockGroups nearby = {*groups, ranges[brick * side + inBrick.x / BLOCK_SIDE],
                                brickAt(grid, cellOfBrick[firstBrick + brick]) * (1 << grid->shift) + inBrick,
                                convert_float3(inBrick), (float)(grid->reach)};
    return nearby;
}

// Mask of LANES groups from the c-th on that reach the block.
IntLanes reaching(const BlockGroups* nearby, uint c) {
    const float halfBlock = 0.5f * (BLOCK_SIDE - 1);
    global const float* columns = nearby->groups.columns + c;
    const uint stride = nearby->groups.stride;
    const Lanes dx = nearby->inBrick.x + halfBlock - vloadLanes(0, columns + POSITION_X * stride),
                dy = nearby->inBrick.y + halfBlock - vloadLanes(0, columns + POSITION_Y * stride),
                dz = nearby->inBrick.z + halfBlock - vloadLanes(0, columns + POSITION_Z * stride);
    const Lanes nx = vloadLanes(0, columns + NORMAL_X * stride), ny = vloadLanes(0, columns + NORMAL_Y * stride),
                nz = vloadLanes(0, columns + NORMAL_Z * stride);
    const Lanes zero = 0.0f, reach = vloadLanes(0, columns + RADIUS * stride) + nearby->reach,
                slab = vloadLanes(0, columns + THICKNESS * stride) + (nearby->reach + BIN_SLACK);
    const Lanes distance2 = squareLanes(max(fabs(dx) - halfBlock, zero)) +
                            squareLanes(max(fabs(dy) - halfBlock, zero)) + squareLanes(max(fabs(dz) - halfBlock, zero));
    return (distance2 < reach * reach) &
           (fabs(dx * nx + dy * ny + dz * nz) < slab + halfBlock * (fabs(nx) + fabs(ny) + fabs(nz)));
}

// Lists groups that reach the block, from the c-th on, until the page may lack space for more or there are none.
// Returns the next group to test.
uint fillPage(const BlockGroups* nearby, uint c, SHARED uint* page, SHARED uint* count) {
    BARRIER;
    if (ITEM == 0) *count = 0;
    BARRIER;
    while (c < nearby->range.y && *count <= PAGE - ITEMS * LANES) {
        const uint at = c + ITEM * LANES;
        uint bits = at < nearby->range.y ? bitsOf(reaching(nearby, at)) : 0;
        // the columns have space for one more vector, whose content is ignored
        if (at < nearby->range.y && nearby->range.y - at < LANES) bits &= (1u << (nearby->range.y - at)) - 1;
        BARRIER;
        for (; bits != 0; bits &= bits - 1) {
            const uint slot = fetchAddShared(count, 1);
            page[slot] = at + (uint)(lowestBit(bits));
        }
        c += ITEMS * LANES;
        BARRIER;
    }
    return min(c, nearby->range.y);
}

float3 positionOf(const Groups* groups, uint c) {
    global const float* columns = groups->columns + c;
    return (float3)(columns[POSITION_X * groups->stride], columns[POSITION_Y * groups->stride],
                    columns[POSITION_Z * groups->stride]);
}
