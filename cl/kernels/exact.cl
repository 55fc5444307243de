// SPDX-License-Identifier: Apache-2.0
// The exact method on a device: sdf/fill/exact.cpp, with the same pieces, bounds, sign propagation and closest
// features. Blocks whose sides the nearest triangles leave open are listed and left to the host.
//
// -D TRIANGLES=1 also stores the nearest triangle of each voxel.
#include "sign_propagation.cl"

#ifndef TRIANGLES
#define TRIANGLES 0
#endif

// Cuts bricks into pieces and groups these. Work-groups take the bricks one after another, so that few need scratch
// memory.
GROUP_KERNEL void prepareBricks(global const float* points, global const uint* triangles, Grid grid,
                                global const uint* cellOfBrick, global const uint* triangleOffsets,
                                global const uint* partOffsets, global const uint* list, uint firstBrick, uint bricks,
                                global Piece* pieces, global Member* unsorted, global Member* members,
                                global uint* cellOfMember, global float* groupColumns, global uint* groupBegins,
                                uint stride, global uint* scratch, uint scratchCells, global uint2* ranges,
                                global uint* next) {
    SHARED uint taken, count;
    SHARED Extent extents[ITEMS];
    SHARED uint2 sums[ITEMS];
    const Groups groups = {groupColumns, groupBegins, stride};
    const int slices = (1 << grid.shift) / BLOCK_SIDE;
    while (takeBrick(next, &taken, &count) < bricks) {
        const uint b = firstBrick + taken, first = partOffsets[b] - partOffsets[firstBrick];
        const int3 brick = brickAt(&grid, cellOfBrick[b]);
        const Limits limits = limitsOf(&grid, brick);
        PieceOutput output = {pieces + first, unsorted + first, &count, first, brick * (1 << grid.shift), noExtent()};
        cutTriangles(&output, points, triangles, list, triangleOffsets[b], triangleOffsets[b + 1], grid.voxelsPerUnit,
                     &limits);
        extents[ITEM] = output.extent;
        BARRIER;
        const uint found = count;
        const Extent all = sumExtents(extents);
        const float meanRadius = (float)(all.radii / found);
        const Cells cells = makeCells(&all, clamp(CELL_FACTOR * meanRadius, MIN_CELL, MAX_CELL));
        uint groupCount = found;
        if (all.radii < SMALL_RADIUS * found && countCells(&cells) <= (float)(scratchCells)) {
            groupCount = sortMembers(&groups, first, unsorted + first, members + first, cellOfMember + first, found,
                                     &cells, scratch + get_group_id(0) * scratchCells, sums);
            for (uint g = first + ITEM; g < first + groupCount; g += ITEMS) makeCluster(&groups, g, members);
        } else {
            for (uint i = first + ITEM; i < first + found; i += ITEMS) {
                const Member member = unsorted[i];
                members[i] = member;
                groups.begins[i] = i;
                storeGroup(&groups, i, vload3(0, member.position), member.radius, vload3(0, member.normal), 0);
            }
            if (ITEM == 0) groups.begins[first + found] = first + found;
        }
        BARRIER;
        rangeGroups(&groups, first, groupCount, slices, (float)(grid.reach), ranges + taken * slices);
    }
}

enum { FILLED_BLOCKS, OPEN_BLOCKS, CONFLICTS };

// A group fills a block of a brick. Blocks that hold distances go to the next slots of `origins`, `distances` and
// `nearestTriangles`. The positions of those whose sides remain open go to `openBlocks`. With sign = 0 all distances
// are positive.
GROUP_KERNEL void fillBlocks(global const float* points, global const uint* triangles, Grid grid,
                             global const uint* cellOfBrick, uint firstBrick, global const Piece* pieces,
                             global const Member* members, global float* groupColumns, global uint* groupBegins,
                             uint stride, global const uint2* ranges, int sign, global int* origins,
                             global float* distances, global int* nearestTriangles, global int* openBlocks,
                             global uint* counters) {
    SHARED uint page[PAGE], count;
    SHARED Block block;
    const Groups groups = {groupColumns, groupBegins, stride};
    const Input input = {ownBlockGroups(&grid, &groups, cellOfBrick, firstBrick, ranges), members, pieces};
    if (input.nearby.range.x >= input.nearby.range.y) return;
    const Share own = ownShare();
    NearestPieces found;
    if (!computeDistances(&input, &own, page, &count, &found)) return;
    storeResults(&found, &own, &block);
    BARRIER;
    ulong known = 0;
    for (int x = 0; x < BLOCK_SIDE; ++x) known |= block.known.slice[x];
    if (known == 0) return;
    if (sign) findSignLinks(&own, &block);
    BARRIER;
    if (ITEM == 0) {
        block.open = 0;
        RelativeMesh mesh = {points, triangles, grid.voxelsPerUnit, 0};
        const uint conflicts = sign ? completeSides(&input, &block, &mesh) : 0;
        if (conflicts > 0) atomic_add(counters + CONFLICTS, conflicts);
        block.slot = atomic_inc(counters + (block.open ? OPEN_BLOCKS : FILLED_BLOCKS));
        vstore3(input.nearby.block, block.slot, block.open ? openBlocks : origins);
    }
    BARRIER;
    if (block.open) return;
    for (int slice = own.firstSlice; slice <= own.lastSlice; ++slice)
        for (int column = own.firstColumn; column <= own.lastColumn; ++column) {
            const int chunk = slice * COLUMNS + column;
            const size_t offset = (size_t)(block.slot) * (BLOCK_VOXELS / LANES) + chunk;
            const IntLanes nearest = vloadLanes(chunk, block.nearest);
            const Lanes distance = select((Lanes)(FAR_AWAY), vloadLanes(chunk, block.distance), nearest >= 0);
            const IntLanes inside = lanesOf(sign ? block.inside.chunk[chunk] : 0);
            storeGlobalLanes(select(distance, -distance, inside), offset, distances);
            if (TRIANGLES) {
                int owners[LANES];
                *(UnalignedIntLanes*)(owners) = nearest;
                for (int i = 0; i < LANES; ++i)
                    owners[i] = owners[i] < 0 ? -1 : (int)(pieces[owners[i] >> SIDE_BITS].triangle);
                storeGlobalInts(vloadLanes(0, owners), offset, nearestTriangles);
            }
        }
}
