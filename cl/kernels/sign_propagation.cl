// SPDX-License-Identifier: Apache-2.0
// The sides of a block's voxels: known ones are propagated over links, and each group of linked voxels without a side
// asks the closest feature: sdf/leaf/sign_propagation.h on a device.
#include "closest_side.cl"

// See sdf/leaf/sign_propagation.h.
#define FAR_FROM 0.5f
#define MID_FROM 0.1f

// One bit per voxel: voxel (x, y, z) is bit 8 y + z of slice x.
typedef union {
    ulong slice[BLOCK_SIDE];
#if LANES == 16
    ushort chunk[BLOCK_SIDE * COLUMNS];
#else
    uchar chunk[BLOCK_SIDE * COLUMNS];
#endif
} Mask;

#ifndef __ENDIAN_LITTLE__
#error "masks of chunks are read as masks of slices in little endian order"
#endif

// A block as all items of its group see it. One more row of distances may be read.
typedef struct {
    float distance[BLOCK_VOXELS + BLOCK_SIDE * 2];
    int nearest[BLOCK_VOXELS];
    Mask known, outside, inside, far, mid;
    Mask linkX, linkY, linkZ;
    uint slot, open;
} Block;

void storeResults(const NearestPieces* found, const Share* own, SHARED Block* block) {
    for (int slice = own->firstSlice; slice <= own->lastSlice; ++slice)
        for (int column = own->firstColumn; column <= own->lastColumn; ++column) {
            const int i = chunkAt(slice, column), chunk = slice * COLUMNS + column;
            const Lanes distance = sqrt(found->nearest2[i]);
            const IntLanes nearest = found->nearest[i], known = nearest >= 0;
            const IntLanes side = known & nearest & ((1 << SIDE_BITS) - 1);
            storeSharedLanes(distance, chunk, block->distance);
            storeSharedInts(nearest, chunk, block->nearest);
            block->known.chunk[chunk] = bitsOf(known);
            // on the surface either side is right, and no link propagates it
            block->outside.chunk[chunk] = bitsOf((side == SIDE_OUTSIDE) | (distance < 0.5f * LINK_SLACK));
            block->inside.chunk[chunk] = bitsOf(side == SIDE_INSIDE);
            block->far.chunk[chunk] = bitsOf(known & (distance > FAR_FROM));
            block->mid.chunk[chunk] = bitsOf(known & (distance > MID_FROM));
        }
}

// Links: voxels whose distance and a neighbour's sum up to more than a voxel.
uint linked(SHARED const float* distance, int step) {
    return bitsOf(vloadLanes(0, distance) + vloadLanes(0, distance + step) > 1 + LINK_SLACK);
}

// SignLinks of sdf/leaf/sign_propagation.h.
void findSignLinks(const Share* own, SHARED Block* block) {
    const uint notLastZ = 0x7f7fu, notLastY = ROWS_AT_ONCE > 1 ? 0xffu : 0u;
    for (int slice = own->firstSlice; slice <= own->lastSlice; ++slice)
        for (int column = own->firstColumn; column <= own->lastColumn; ++column) {
            const int chunk = slice * COLUMNS + column;
            SHARED const float* row = block->distance + chunk * LANES;
            block->linkZ.chunk[chunk] = linked(row, 1) & notLastZ;
            block->linkY.chunk[chunk] = linked(row, BLOCK_SIDE) & (column == COLUMNS - 1 ? notLastY : ~0u);
            block->linkX.chunk[chunk] = slice < BLOCK_SIDE - 1 ? linked(row, BLOCK_SIDE * BLOCK_SIDE) : 0;
        }
}

// Grows a set inside one slice until it stops.
ulong growInSlice(ulong set, ulong linkY, ulong linkZ) {
    for (;;) {
        const ulong old = set;
        set |= (set & linkZ) << 1 | (set >> 1 & linkZ);
        set |= (set & linkY) << 8 | (set >> 8 & linkY);
        if (set == old) return set;
    }
}

// Adds all voxels to a set that links connect with it.
void propagate(SHARED const Block* block, SHARED Mask* set) {
    uint changed = 0;  // slices that have not been propagated to their neighbours
    for (int x = 0; x < BLOCK_SIDE; ++x) {
        if (set->slice[x] == 0) continue;
        set->slice[x] = growInSlice(set->slice[x], block->linkY.slice[x], block->linkZ.slice[x]);
        changed |= 1u << x;
    }
    while (changed != 0) {
        const int x = lowestBit(changed);
        changed &= changed - 1;
        for (int to = x - 1; to <= x + 1; to += 2) {
            if (to < 0 || to >= BLOCK_SIDE) continue;
            const ulong incoming = set->slice[x] & block->linkX.slice[min(x, to)];
            if ((incoming & ~set->slice[to]) == 0) continue;
            set->slice[to] = growInSlice(set->slice[to] | incoming, block->linkY.slice[to], block->linkZ.slice[to]);
            changed |= 1u << to;
        }
    }
}

// completeSides() of sdf/leaf/sign_propagation.h. Propagates the known sides over links. For each group of linked
// voxels that remains without a side, the side of one voxel is computed. Returns the number of voxels that are on both
// sides. Marks the block as open where the closest feature leaves a side open.
uint completeSides(const Input* input, SHARED Block* block, RelativeMesh* mesh) {
    propagate(block, &block->outside);
    propagate(block, &block->inside);
    uint conflicts = 0;
    for (int x = 0; x < BLOCK_SIDE; ++x)
        conflicts += (uint)(popcount(block->outside.slice[x] & block->inside.slice[x]));
    for (int level = 0; level < 3; ++level) {
        SHARED const Mask* seeds = level == 0 ? &block->far : level == 1 ? &block->mid : &block->known;
        for (int x = 0; x < BLOCK_SIDE; ++x)
            for (;;) {
                const ulong open = seeds->slice[x] & ~(block->outside.slice[x] | block->inside.slice[x]);
                if (open == 0) break;
                const int bit = 63 - (int)(clz(open & -open));
                const double side =
                    sideOf(input, (uint)(block->nearest[x * 64 + bit] >> SIDE_BITS), mesh, x * 64 + bit);
                if (side == 0) {
                    block->open = 1;
                    return 0;
                }
                SHARED Mask* set = side < 0 ? &block->inside : &block->outside;
                set->slice[x] |= 1ul << bit;
                propagate(block, set);
            }
    }
    return conflicts;
}
