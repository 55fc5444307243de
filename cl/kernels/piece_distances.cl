// SPDX-License-Identifier: Apache-2.0
// The distances of a block's voxels to the pieces that reach it, and the sides over faces: sdf/fill/exact_block.h on a
// device.
#include "pieces.cl"

// Rows along z in a vector, vectors in a slice of one x, vectors in a block.
#define ROWS_AT_ONCE (LANES / BLOCK_SIDE)
#define COLUMNS (BLOCK_SIDE / ROWS_AT_ONCE)
#define CHUNKS (BLOCK_SIDE * COLUMNS / ITEMS)
// Slices of an item.
#define SLICES (ITEMS > 1 ? 1 : BLOCK_SIDE)

// See sdf/fill/exact_block.cpp for these: rounding [voxels, voxels^2 or fractions].
#define BOUND_SLACK 1e-4f
#define TIE 1e-5f
#define RAISED_PART 1e-3f
#define RAISED_BY 5e-7f
#define HEIGHT_SLACK 1e-3f
#define MIN_HEIGHT 1e-3f

// Side bits of a voxel's code, below the number of its nearest piece: PieceSide of sdf/fill/exact_block.h.
enum { SIDE_OUTSIDE = 1, SIDE_INSIDE = 2, SIDE_BITS = 2 };

// The part of a block that an item works on, in slices of one x and columns of rows.
typedef struct {
    int firstSlice, lastSlice, firstColumn, lastColumn;
} Share;

Share ownShare() {
#if ITEMS > 1
    const int row = (int)(ITEM);
    const Share own = {row / COLUMNS, row / COLUMNS, row % COLUMNS, row % COLUMNS};
#else
    const Share own = {0, BLOCK_SIDE - 1, 0, COLUMNS - 1};
#endif
    return own;
}

// The index of a chunk among those of its item.
int chunkAt(int slice, int column) {
    return ITEMS > 1 ? 0 : slice * COLUMNS + column;
}

// Lattice coordinates of a column's voxels.
Lanes latticeY(int column) {
#if LANES == 16
    return (Lanes)((float8)(0), (float8)(1)) + (float)(column * ROWS_AT_ONCE);
#else
    return (Lanes)((float)(column));
#endif
}

Lanes latticeZ() {
    const float8 row = (float8)(0, 1, 2, 3, 4, 5, 6, 7);
#if LANES == 16
    return (Lanes)(row, row);
#else
    return row;
#endif
}

// State of an item's voxels: squared distance to the nearest piece, and its number with the side (-1: none).
typedef struct {
    Lanes nearest2[CHUNKS];
    IntLanes nearest[CHUNKS];
} NearestPieces;

// The slices and columns of a share that a ball's bounding box overlaps.
Share overlap(const Share* own, float3 centre, float radius) {
    // truncation equals rounding down here, since all values below zero are equivalent
    const int low = (int)(max(centre.y - radius, 0.0f)) / ROWS_AT_ONCE,
              high = centre.y + radius < 0 ? -1 : (int)(min(centre.y + radius, 7.0f)) / ROWS_AT_ONCE;
    const int from = (int)(max(centre.x - radius, 0.0f)),
              to = centre.x + radius < 0 ? -1 : (int)(min(centre.x + radius, 7.0f));
    const Share part = {max(own->firstSlice, from), min(own->lastSlice, to), max(own->firstColumn, low),
                        min(own->lastColumn, high)};
    return part;
}

// Reduces squared distances to those to a sample.
void applySample(NearestPieces* found, const Share* own, float3 sample, float reach) {
    const Share part = overlap(own, sample, reach);
    const Lanes z2 = squareLanes(latticeZ() - sample.z);
    for (int column = part.firstColumn; column <= part.lastColumn; ++column) {
        const Lanes across2 = squareLanes(latticeY(column) - sample.y) + z2;
        for (int slice = part.firstSlice; slice <= part.lastSlice; ++slice) {
            Lanes* nearest2 = found->nearest2 + chunkAt(slice, column);
            *nearest2 = min(*nearest2, square((float)(slice)-sample.x) + across2);
        }
    }
}

// Bounding cylinder of pieces relative to a block: BoundingCylinder of sdf/fill/bounding_cylinder.h. Values that depend
// on the slice only are computed once.
typedef struct {
    float3 centre, normal;
    float thickness, radius2;
    float px2[SLICES], height[SLICES];
} BoundingCylinder;

void makeCylinder(BoundingCylinder* cylinder, const Share* own, float3 centre, float radius, float3 normal,
                  float thickness) {
    cylinder->centre = centre;
    cylinder->normal = normal;
    cylinder->thickness = thickness + BOUND_SLACK;
    cylinder->radius2 = square(radius + BOUND_SLACK);
    for (int i = 0; i < SLICES; ++i) {
        const float px = (float)(own->firstSlice + i) - centre.x;
        cylinder->px2[i] = px * px;
        cylinder->height[i] = px * normal.x;
    }
}

// Values that all chunks of a column share.
typedef struct {
    Lanes excess, height;
} Column;

Column makeColumn(const BoundingCylinder* cylinder, int column) {
    const Lanes py = latticeY(column) - cylinder->centre.y, pz = latticeZ() - cylinder->centre.z;
    const Column result = {py * py + pz * pz - cylinder->radius2, py * cylinder->normal.y + pz * cylinder->normal.z};
    return result;
}

// Whether the cylinder may be nearest to some voxel of a chunk.
bool mayBeNearest(const NearestPieces* found, const BoundingCylinder* cylinder, const Column* column, int slice,
                  int chunk, bool thick) {
    const Lanes bound2 = found->nearest2[chunk], h = cylinder->height[slice] + column->height;
    Lanes excess = cylinder->px2[slice] + column->excess - bound2, g2 = h * h;
    if (thick) {
        const Lanes h2 = g2;
        g2 = squareLanes(max(fabs(h) - cylinder->thickness, (Lanes)(0.0f)));
        excess += g2 - h2;
    }
    return anyLane(excess * fabs(excess) <= 4 * cylinder->radius2 * (bound2 - g2 + HEIGHT_SLACK));
}

// Bits of the chunks in a part of a share with a voxel that the cylinder may be nearest to.
uint nearChunks(const NearestPieces* found, const Share* own, const Share* part, const BoundingCylinder* cylinder,
                bool thick) {
    uint near = 0;
    for (int c = part->firstColumn; c <= part->lastColumn; ++c) {
        const Column column = makeColumn(cylinder, c);
        for (int slice = part->firstSlice; slice <= part->lastSlice; ++slice) {
            const int chunk = chunkAt(slice, c);
            near |= (uint)(mayBeNearest(found, cylinder, &column, slice - own->firstSlice, chunk, thick)) << chunk;
        }
    }
    return near;
}

// Bits of the chunks of a column.
uint chunksOfColumn(uint chunks, int column) {
    return ITEMS > 1 ? chunks : chunks & 0x11111111u << column;
}

int sliceOf(int chunk) {
    return ITEMS > 1 ? 0 : chunk / COLUMNS;
}

// The same for a disc, out of some chunks.
uint nearChunksAmong(const NearestPieces* found, const Share* own, uint among, const BoundingCylinder* cylinder) {
    uint near = 0;
    for (int c = own->firstColumn; c <= own->lastColumn; ++c) {
        uint chunks = chunksOfColumn(among, c);
        if (chunks == 0) continue;
        const Column column = makeColumn(cylinder, c);
        for (; chunks != 0; chunks &= chunks - 1) {
            const int chunk = lowestBit(chunks);
            near |= (uint)(mayBeNearest(found, cylinder, &column, sliceOf(chunk), chunk, false)) << chunk;
        }
    }
    return near;
}

// Signed distance of a coordinate along an edge beyond the edge's ends.
Lanes beyond(Lanes along, float length) {
    return along - min(max(along, (Lanes)(0.0f)), (Lanes)(length));
}

// Keeps the smaller distances, and their pieces. Over a face the face's normal gives the side, unless two pieces are
// equally near within rounding and disagree.
void keepNearer(NearestPieces* found, int chunk, Lanes distance2, Lanes height, IntLanes overFace, int code) {
    const Lanes old2 = found->nearest2[chunk], nearest2 = min(distance2, old2);
    const IntLanes old = found->nearest[chunk];
    const IntLanes side = select((IntLanes)(code + SIDE_INSIDE), (IntLanes)(code + SIDE_OUTSIDE), height > 0.0f);
    const IntLanes own = select((IntLanes)(code), side, overFace);
    const IntLanes winner = select(old, own, distance2 < old2);
    const IntLanes tied = max(distance2, old2) - nearest2 <= nearest2 * TIE + TIE;
    found->nearest2[chunk] = nearest2;
    // keeps the number, and the side bits of both; LLVM 14 miscompiles other forms of it for AVX-512
    const IntLanes kept = (own & old) | ~((1 << SIDE_BITS) - 1) | ~tied;
    found->nearest[chunk] = winner & kept;
}

// Reduces the distances in some chunks to those to a piece. Lattice coordinates are exact in floats.
void applyPiece(NearestPieces* found, const Share* own, uint chunks, global const Piece* piece, uint number,
                int3 block) {
    const float3 shift = convert_float3(block - vload3(0, piece->base)), origin = vload3(0, piece->origin);
    const float3 u = vload3(0, piece->u), w = vload3(0, piece->w), n = vload3(0, piece->n);
    const float size = piece->length, ox = piece->ox, oy = piece->oy, olen = piece->olen, ex = piece->ex,
                ey = piece->ey, elen = piece->elen;
    const int code = (int)(number << SIDE_BITS);
    float uAlong[SLICES], wAlong[SLICES], nAlong[SLICES];
    for (int i = 0; i < SLICES; ++i) {
        const float px = (float)(own->firstSlice + i) + shift.x - origin.x;
        uAlong[i] = px * u.x;
        wAlong[i] = px * w.x;
        nAlong[i] = px * n.x;
    }
    const Lanes pz = latticeZ() + shift.z - origin.z;
    for (int column = own->firstColumn; column <= own->lastColumn; ++column) {
        uint slices = chunksOfColumn(chunks, column);
        if (slices == 0) continue;
        const Lanes py = latticeY(column) + shift.y - origin.y;
        const Lanes uAcross = py * u.y + pz * u.z, wAcross = py * w.y + pz * w.z, nAcross = py * n.y + pz * n.z;
        for (; slices != 0; slices &= slices - 1) {
            const int chunk = lowestBit(slices), slice = sliceOf(chunk);
            const Lanes along = uAlong[slice] + uAcross, across = wAlong[slice] + wAcross,
                        height = nAlong[slice] + nAcross;
            const Lanes base2 = squareLanes(beyond(along, size)) + across * across;
            // the edges from both ends of the longest edge to the third corner
            const Lanes v = along - size;
            const Lanes leftOf = across * ox - along * oy, rightOf = across * ex - v * ey;
            const Lanes left2 = squareLanes(beyond(along * ox + across * oy, olen)) + leftOf * leftOf;
            const Lanes right2 = squareLanes(beyond(v * ex + across * ey, elen)) + rightOf * rightOf;
            const Lanes height2 = height * height;
            const IntLanes above = (across > 0.0f) & (leftOf <= 0.0f) & (rightOf >= 0.0f);
            const Lanes distance2 = height2 + select(min(base2, min(left2, right2)), (Lanes)(0.0f), above);
            keepNearer(found, chunk, distance2, height, above & (height2 > square(MIN_HEIGHT)), code);
        }
    }
}

// The input of a block.
typedef struct {
    BlockGroups nearby;
    global const Member* members;
    global const Piece* pieces;
} Input;

void applySamples(const Input* input, const Share* own, SHARED const uint* page, uint count, NearestPieces* found) {
    for (uint i = 0; i < count; ++i)
        applySample(found, own, positionOf(&input->nearby.groups, page[i]) - input->nearby.inBrick,
                    input->nearby.reach);
}

// Tests the members of a cluster that come near some chunks.
void applyMembers(const Input* input, const Share* own, uint cluster, uint chunks, NearestPieces* found) {
    const uint begin = input->nearby.groups.begins[cluster], end = input->nearby.groups.begins[cluster + 1];
    for (uint m = begin; m < end; ++m) {
        global const Member* member = input->members + m;
        uint nearby = chunks;
        if (end - begin > 1) {
            BoundingCylinder cylinder;
            makeCylinder(&cylinder, own, vload3(0, member->position) - input->nearby.inBrick, member->radius,
                     vload3(0, member->normal), 0);
            nearby = nearChunksAmong(found, own, chunks, &cylinder);
        }
        if (nearby != 0)
            applyPiece(found, own, nearby, input->pieces + member->content, member->content, input->nearby.block);
    }
}

void applyGroups(const Input* input, const Share* own, SHARED const uint* page, uint count, NearestPieces* found) {
    const uint stride = input->nearby.groups.stride;
    for (uint i = 0; i < count; ++i) {
        const uint c = page[i];
        global const float* columns = input->nearby.groups.columns + c;
        const float3 sample = positionOf(&input->nearby.groups, c) - input->nearby.inBrick;
        const float radius = columns[RADIUS * stride], thickness = columns[THICKNESS * stride];
        BoundingCylinder cylinder;
        makeCylinder(&cylinder, own, sample, radius,
                 (float3)(columns[NORMAL_X * stride], columns[NORMAL_Y * stride], columns[NORMAL_Z * stride]),
                 thickness);
        const Share part = overlap(own, sample, input->nearby.reach + radius);
        const uint near = nearChunks(found, own, &part, &cylinder, thickness > 0);
        if (near != 0) applyMembers(input, own, c, near, found);
    }
}

// Computes the distances. First come bounds by samples, raised slightly so that a piece's own distance wins over its
// sample's; then the pieces. The page holds all clusters that reach the block, or else is refilled once more. Returns
// false if there is none.
bool computeDistances(const Input* input, const Share* own, SHARED uint* page, SHARED uint* count,
                      NearestPieces* found) {
    for (int i = 0; i < CHUNKS; ++i) found->nearest2[i] = square(input->nearby.reach);
    uint next = input->nearby.range.x, pages = 0;
    do {
        next = fillPage(&input->nearby, next, page, count);
        applySamples(input, own, page, *count, found);
        ++pages;
    } while (next < input->nearby.range.y);
    if (pages == 1 && *count == 0) return false;
    for (int i = 0; i < CHUNKS; ++i) {
        found->nearest2[i] =
            min(found->nearest2[i] * (1 + RAISED_PART) + RAISED_BY, (Lanes)(square(input->nearby.reach)));
        found->nearest[i] = -1;
    }
    if (pages > 1) next = input->nearby.range.x;
    do {
        if (pages > 1) next = fillPage(&input->nearby, next, page, count);
        applyGroups(input, own, page, *count, found);
    } while (next < input->nearby.range.y);
    return true;
}
