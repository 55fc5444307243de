// The exact method on a device: sdf/fill/exact.cpp, with the same pieces, bounds, sign propagation and closest
// features. Blocks whose sides the nearest triangles leave open are listed and left to the host.
//
// -D TRIANGLES=1 also stores the nearest triangle of each voxel.
#include "pieces.cl"

#ifndef TRIANGLES
#define TRIANGLES 0
#endif

// Rows along z in a vector, vectors in a slice of one x, vectors in a block.
#define ROWS_AT_ONCE (LANES / BLOCK_SIDE)
#define COLUMNS (BLOCK_SIDE / ROWS_AT_ONCE)
#define CHUNKS (BLOCK_SIDE * COLUMNS / ITEMS)
// Slices of an item.
#define SLICES (ITEMS > 1 ? 1 : BLOCK_SIDE)

// See sdf/fill/exact_block.cpp, sdf/fill/bounding_cylinder.h and sdf/leaf/sign_propagation.h for these: rounding
// [voxels, voxels^2 or fractions].
#define BOUND_SLACK 1e-4f
#define TIE 1e-5f
#define RAISED_PART 1e-3f
#define RAISED_BY 5e-7f
#define HEIGHT_SLACK 1e-3f
#define LEAST_HEIGHT 1e-3f
// See sdf/leaf/sign_propagation.h.
#define LINK_SLACK 1e-4f
#define FAR_FROM 0.5f
#define MID_FROM 0.1f
// See sdf/sign/closest_side.cpp, and sideSlack of sdf/fill/exact.cpp.
#define SAME_PLACE 1e-7
#define FLATNESS 1e-10
#define CANCELLED 1e-2
#define SIDE_SLACK 1e-3f
// Maximum faces that meet in the closest point of a voxel; with more of them the host decides.
#define MOST_FACES 48

// Side bits of a voxel's code, below the number of its nearest piece: PieceSide of sdf/fill/exact_block.h.
enum { SIDE_OUTSIDE = 1, SIDE_INSIDE = 2, SIDE_BITS = 2 };

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
        Cut cut = {pieces + first, unsorted + first, &count, first, brick * (1 << grid.shift), noExtent()};
        cutTriangles(&cut, points, triangles, list, triangleOffsets[b], triangleOffsets[b + 1], grid.voxelsPerUnit,
                     &limits);
        extents[ITEM] = cut.extent;
        MEET;
        const uint found = count;
        const Extent all = sumExtents(extents);
        const float meanRadius = (float)(all.radii / found);
        const Cells cells = makeCells(&all, clamp(CELL_FACTOR * meanRadius, SMALLEST_CELL, LARGEST_CELL));
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
                putGroup(&groups, i, vload3(0, member.place), member.radius, vload3(0, member.normal), 0);
            }
            if (ITEM == 0) groups.begins[first + found] = first + found;
        }
        MEET;
        rangeGroups(&groups, first, groupCount, slices, (float)(grid.reach), ranges + taken * slices);
    }
}

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
} Found;

// The slices and columns of a share that a ball's bounding box overlaps.
Share within(const Share* own, float3 centre, float radius) {
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
void applySample(Found* found, const Share* own, float3 sample, float reach) {
    const Share part = within(own, sample, reach);
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
} Drum;

void makeDrum(Drum* drum, const Share* own, float3 centre, float radius, float3 normal, float thickness) {
    drum->centre = centre;
    drum->normal = normal;
    drum->thickness = thickness + BOUND_SLACK;
    drum->radius2 = square(radius + BOUND_SLACK);
    for (int i = 0; i < SLICES; ++i) {
        const float px = (float)(own->firstSlice + i) - centre.x;
        drum->px2[i] = px * px;
        drum->height[i] = px * normal.x;
    }
}

// Values that all chunks of a column share.
typedef struct {
    Lanes excess, height;
} Column;

Column makeColumn(const Drum* drum, int column) {
    const Lanes py = latticeY(column) - drum->centre.y, pz = latticeZ() - drum->centre.z;
    const Column result = {py * py + pz * pz - drum->radius2, py * drum->normal.y + pz * drum->normal.z};
    return result;
}

// Whether the cylinder may be nearest to some voxel of a chunk.
bool mayBeNearest(const Found* found, const Drum* drum, const Column* column, int slice, int chunk, bool thick) {
    const Lanes bound2 = found->nearest2[chunk], h = drum->height[slice] + column->height;
    Lanes excess = drum->px2[slice] + column->excess - bound2, g2 = h * h;
    if (thick) {
        const Lanes h2 = g2;
        g2 = squareLanes(max(fabs(h) - drum->thickness, (Lanes)(0.0f)));
        excess += g2 - h2;
    }
    return anyLane(excess * fabs(excess) <= 4 * drum->radius2 * (bound2 - g2 + HEIGHT_SLACK));
}

// Bits of the chunks in a part of a share with a voxel that the cylinder may be nearest to.
uint nearChunks(const Found* found, const Share* own, const Share* part, const Drum* drum, bool thick) {
    uint near = 0;
    for (int c = part->firstColumn; c <= part->lastColumn; ++c) {
        const Column column = makeColumn(drum, c);
        for (int slice = part->firstSlice; slice <= part->lastSlice; ++slice) {
            const int chunk = chunkAt(slice, c);
            near |= (uint)(mayBeNearest(found, drum, &column, slice - own->firstSlice, chunk, thick)) << chunk;
        }
    }
    return near;
}

// Bits of the chunks of a column.
uint ofColumn(uint chunks, int column) {
    return ITEMS > 1 ? chunks : chunks & 0x11111111u << column;
}

int sliceOf(int chunk) {
    return ITEMS > 1 ? 0 : chunk / COLUMNS;
}

// The same for a disc, out of some chunks.
uint nearAmong(const Found* found, const Share* own, uint among, const Drum* drum) {
    uint near = 0;
    for (int c = own->firstColumn; c <= own->lastColumn; ++c) {
        uint chunks = ofColumn(among, c);
        if (chunks == 0) continue;
        const Column column = makeColumn(drum, c);
        for (; chunks != 0; chunks &= chunks - 1) {
            const int chunk = lowestBit(chunks);
            near |= (uint)(mayBeNearest(found, drum, &column, sliceOf(chunk), chunk, false)) << chunk;
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
void keepNearer(Found* found, int chunk, Lanes distance2, Lanes height, IntLanes overFace, int code) {
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
void askPiece(Found* found, const Share* own, uint chunks, global const Piece* piece, uint number, int3 block) {
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
        uint slices = ofColumn(chunks, column);
        if (slices == 0) continue;
        const Lanes py = latticeY(column) + shift.y - origin.y;
        const Lanes uAcross = py * u.y + pz * u.z, wAcross = py * w.y + pz * w.z, nAcross = py * n.y + pz * n.z;
        for (; slices != 0; slices &= slices - 1) {
            const int chunk = lowestBit(slices), slice = sliceOf(chunk);
            const Lanes along = uAlong[slice] + uAcross, aside = wAlong[slice] + wAcross,
                        height = nAlong[slice] + nAcross;
            const Lanes base2 = squareLanes(beyond(along, size)) + aside * aside;
            // the edges from both ends of the longest edge to the third corner
            const Lanes v = along - size;
            const Lanes leftOf = aside * ox - along * oy, rightOf = aside * ex - v * ey;
            const Lanes left2 = squareLanes(beyond(along * ox + aside * oy, olen)) + leftOf * leftOf;
            const Lanes right2 = squareLanes(beyond(v * ex + aside * ey, elen)) + rightOf * rightOf;
            const Lanes height2 = height * height;
            const IntLanes above = (aside > 0.0f) & (leftOf <= 0.0f) & (rightOf >= 0.0f);
            const Lanes distance2 = height2 + select(min(base2, min(left2, right2)), (Lanes)(0.0f), above);
            keepNearer(found, chunk, distance2, height, above & (height2 > square(LEAST_HEIGHT)), code);
        }
    }
}

// The input of a block.
typedef struct {
    Near near;
    global const Member* members;
    global const Piece* pieces;
} Input;

void applySamples(const Input* input, const Share* own, SHARED const uint* page, uint count, Found* found) {
    for (uint i = 0; i < count; ++i)
        applySample(found, own, placeOf(&input->near.groups, page[i]) - input->near.inBrick, input->near.reach);
}

// Tests the members of a cluster that come near some chunks.
void askMembers(const Input* input, const Share* own, uint cluster, uint near, Found* found) {
    const uint begin = input->near.groups.begins[cluster], end = input->near.groups.begins[cluster + 1];
    for (uint m = begin; m < end; ++m) {
        global const Member* member = input->members + m;
        uint ask = near;
        if (end - begin > 1) {
            Drum drum;
            makeDrum(&drum, own, vload3(0, member->place) - input->near.inBrick, member->radius,
                     vload3(0, member->normal), 0);
            ask = nearAmong(found, own, near, &drum);
        }
        if (ask != 0) askPiece(found, own, ask, input->pieces + member->content, member->content, input->near.block);
    }
}

void askGroups(const Input* input, const Share* own, SHARED const uint* page, uint count, Found* found) {
    const uint stride = input->near.groups.stride;
    for (uint i = 0; i < count; ++i) {
        const uint c = page[i];
        global const float* columns = input->near.groups.columns + c;
        const float3 sample = placeOf(&input->near.groups, c) - input->near.inBrick;
        const float radius = columns[RADIUS * stride], thickness = columns[THICKNESS * stride];
        Drum drum;
        makeDrum(&drum, own, sample, radius,
                 (float3)(columns[NORMAL_X * stride], columns[NORMAL_Y * stride], columns[NORMAL_Z * stride]),
                 thickness);
        const Share part = within(own, sample, input->near.reach + radius);
        const uint near = nearChunks(found, own, &part, &drum, thickness > 0);
        if (near != 0) askMembers(input, own, c, near, found);
    }
}

// Computes the distances. First come bounds by samples, raised slightly so that a piece's own distance wins over its
// sample's; then the pieces. The page holds all clusters that reach the block, or else is refilled once more. Returns
// false if there is none.
bool measure(const Input* input, const Share* own, SHARED uint* page, SHARED uint* count, Found* found) {
    for (int i = 0; i < CHUNKS; ++i) found->nearest2[i] = square(input->near.reach);
    uint next = input->near.range.x, pages = 0;
    do {
        next = turnPage(&input->near, next, page, count);
        applySamples(input, own, page, *count, found);
        ++pages;
    } while (next < input->near.range.y);
    if (pages == 1 && *count == 0) return false;
    for (int i = 0; i < CHUNKS; ++i) {
        found->nearest2[i] = min(found->nearest2[i] * (1 + RAISED_PART) + RAISED_BY, (Lanes)(square(input->near.reach)));
        found->nearest[i] = -1;
    }
    if (pages > 1) next = input->near.range.x;
    do {
        if (pages > 1) next = turnPage(&input->near, next, page, count);
        askGroups(input, own, page, *count, found);
    } while (next < input->near.range.y);
    return true;
}

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

void summarize(const Found* found, const Share* own, SHARED Block* block) {
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
ulong grownInSlice(ulong set, ulong linkY, ulong linkZ) {
    for (;;) {
        const ulong old = set;
        set |= (set & linkZ) << 1 | (set >> 1 & linkZ);
        set |= (set & linkY) << 8 | (set >> 8 & linkY);
        if (set == old) return set;
    }
}

// Adds all voxels to a set that links connect with it.
void spread(SHARED const Block* block, SHARED Mask* set) {
    uint changed = 0;  // slices that have not been propagated to their neighbours
    for (int x = 0; x < BLOCK_SIDE; ++x) {
        if (set->slice[x] == 0) continue;
        set->slice[x] = grownInSlice(set->slice[x], block->linkY.slice[x], block->linkZ.slice[x]);
        changed |= 1u << x;
    }
    while (changed != 0) {
        const int x = lowestBit(changed);
        changed &= changed - 1;
        for (int to = x - 1; to <= x + 1; to += 2) {
            if (to < 0 || to >= BLOCK_SIDE) continue;
            const ulong given = set->slice[x] & block->linkX.slice[min(x, to)];
            if ((given & ~set->slice[to]) == 0) continue;
            set->slice[to] = grownInSlice(set->slice[to] | given, block->linkY.slice[to], block->linkZ.slice[to]);
            changed |= 1u << to;
        }
    }
}

double3 closestOnSegment(double3 a, double3 b) {
    const double3 ab = b - a;
    const double length2 = dot(ab, ab);
    const double t = length2 > 0 ? clamp(-dot(a, ab) / length2, 0.0, 1.0) : 0.0;
    // from the nearer end, so that both triangles of an edge find the same point for either direction of the edge
    return t <= 0.5 ? a + t * ab : b - (1 - t) * ab;
}

// The point of a triangle that is closest to the origin. Correct for triangles without area too.
double3 closestToOrigin(const Corners* t) {
    const double3 ab = t->b - t->a, ac = t->c - t->a, bc = t->c - t->b, n = cross(ab, ac);
    const double n2 = dot(n, n), longest2 = max(dot(ab, ab), max(dot(ac, ac), dot(bc, bc)));
    // inside all three edges: the foot on the plane
    if (n2 > FLATNESS * FLATNESS * longest2 * longest2 && dot(cross(ab, -t->a), n) >= 0 &&
        dot(cross(bc, -t->b), n) >= 0 && dot(cross(-ac, -t->c), n) >= 0)
        return dot(t->a, n) / n2 * n;
    double3 best = closestOnSegment(t->a, t->b);
    const double3 second = closestOnSegment(t->b, t->c), third = closestOnSegment(t->c, t->a);
    if (dot(second, second) < dot(best, best)) best = second;
    if (dot(third, third) < dot(best, best)) best = third;
    return best;
}

// The angle of a triangle at one of its points: the full angle inside, half of it on an edge.
double angleAt(const Corners* t, double3 p) {
    const double3 c[3] = {t->a, t->b, t->c};
    for (int i = 0; i < 3; ++i)
        if (distance(c[i], p) <= SAME_PLACE) {
            const double3 a = c[(i + 1) % 3] - c[i], b = c[(i + 2) % 3] - c[i];
            return atan2(length(cross(a, b)), dot(a, b));
        }
    for (int i = 0; i < 3; ++i) {
        const double3 edge = c[(i + 1) % 3] - c[i];
        if (length(cross(edge, p - c[i])) <= SAME_PLACE * length(edge)) return M_PI;
    }
    return 2 * M_PI;
}

bool sameCorners(const Corners* s, const Corners* t) {
    return (all(s->a == t->a) && all(s->b == t->b) && all(s->c == t->c)) ||
           (all(s->a == t->b) && all(s->b == t->c) && all(s->c == t->a)) ||
           (all(s->a == t->c) && all(s->b == t->a) && all(s->c == t->b));
}

// The mesh relative to a point.
typedef struct {
    global const float* points;
    global const uint* triangles;
    double voxelsPerUnit;
    double3 from;  // [voxels]
} View;

Corners seen(const View* view, uint triangle) {
    Corners t = cornersOf(view->points, view->triangles, triangle, view->voxelsPerUnit);
    t.a -= view->from;
    t.b -= view->from;
    t.c -= view->from;
    return t;
}

// Triangles that may be nearest to a point.
typedef struct {
    uint triangle[MOST_FACES];
    int count;
    bool all;  // no triangle was left out because of the limit
    double nearest;
    double3 closest;  // the point of the nearest of them
} Faces;

void offer(Faces* faces, const View* view, uint triangle) {
    for (int i = 0; i < faces->count; ++i)
        if (faces->triangle[i] == triangle) return;
    const Corners t = seen(view, triangle);
    const double3 closest = closestToOrigin(&t);
    const double away = length(closest);
    if (away > faces->nearest + SAME_PLACE) return;
    if (away < faces->nearest) {
        // the nearest ones so far may be farther
        if (away < faces->nearest - SAME_PLACE) faces->count = 0;
        faces->nearest = away;
        faces->closest = closest;
    }
    if (faces->count == MOST_FACES)
        faces->all = false;
    else
        faces->triangle[faces->count++] = triangle;
}

// ClosestSide::side() of sdf/sign/closest_side.cpp: negative inside, positive outside, zero where the normals at the
// closest point cancel or there are too many.
double sideBy(const Faces* faces, const View* view) {
    double sum = 0, weights = 0;
    for (int i = 0; i < faces->count; ++i) {
        const Corners t = seen(view, faces->triangle[i]);
        const double3 closest = closestToOrigin(&t), ab = t.b - t.a, ac = t.c - t.a, bc = t.c - t.b,
                      normal = cross(ab, ac);
        const double size = length(normal), longest = sqrt(max(dot(ab, ab), max(dot(ac, ac), dot(bc, bc))));
        // a triangle thinner than the tolerance has no reliable normal
        if (distance(closest, faces->closest) > SAME_PLACE || size <= SAME_PLACE * longest) continue;
        bool duplicate = false;
        for (int j = 0; j < i; ++j) {
            const Corners other = seen(view, faces->triangle[j]);
            duplicate = duplicate || sameCorners(&other, &t);
        }
        if (duplicate) continue;
        const double angle = angleAt(&t, faces->closest);
        sum -= angle * dot(normal / size, faces->closest);
        weights += angle;
    }
    return !faces->all || fabs(sum) <= CANCELLED * weights * faces->nearest ? 0 : sum;
}

// The side of a voxel of a block, from all pieces that may be as near as its nearest one.
double sideOf(const Input* input, SHARED const Block* block, View* view, int voxel) {
    const int3 at = (int3)(voxel / 64, voxel / 8 % 8, voxel % 8);
    view->from = convert_double3(input->near.block + at);
    Faces faces;
    faces.count = 0;
    faces.all = true;
    faces.nearest = INFINITY;
    offer(&faces, view, input->pieces[block->nearest[voxel] >> SIDE_BITS].triangle);
    const float3 place = input->near.inBrick + convert_float3(at);
    const float away = (float)(faces.nearest) + SIDE_SLACK;
    global const float* radii = input->near.groups.columns + RADIUS * input->near.groups.stride;
    for (uint c = input->near.range.x; c < input->near.range.y; ++c) {
        if (distance(place, placeOf(&input->near.groups, c)) > away + radii[c]) continue;
        for (uint m = input->near.groups.begins[c]; m < input->near.groups.begins[c + 1]; ++m) {
            global const Member* member = input->members + m;
            if (distance(place, vload3(0, member->place)) <= away + member->radius)
                offer(&faces, view, input->pieces[member->content].triangle);
        }
    }
    return sideBy(&faces, view);
}

// completeSides() of sdf/leaf/sign_propagation.h. Propagates the known sides over links. For each group of linked
// voxels that remains without a side, the side of one voxel is computed. Returns the number of voxels that are on both
// sides. Marks the block as open where the closest feature leaves a side open.
uint completeSides(const Input* input, SHARED Block* block, View* view) {
    spread(block, &block->outside);
    spread(block, &block->inside);
    uint onBoth = 0;
    for (int x = 0; x < BLOCK_SIDE; ++x) onBoth += (uint)(popcount(block->outside.slice[x] & block->inside.slice[x]));
    for (int seeds = 0; seeds < 3; ++seeds) {
        SHARED const Mask* some = seeds == 0 ? &block->far : seeds == 1 ? &block->mid : &block->known;
        for (int x = 0; x < BLOCK_SIDE; ++x)
            for (;;) {
                const ulong open = some->slice[x] & ~(block->outside.slice[x] | block->inside.slice[x]);
                if (open == 0) break;
                const int bit = 63 - (int)(clz(open & -open));
                const double side = sideOf(input, block, view, x * 64 + bit);
                if (side == 0) {
                    block->open = 1;
                    return 0;
                }
                SHARED Mask* set = side < 0 ? &block->inside : &block->outside;
                set->slice[x] |= 1ul << bit;
                spread(block, set);
            }
    }
    return onBoth;
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
    const Input input = {nearBlock(&grid, &groups, cellOfBrick, firstBrick, ranges), members, pieces};
    if (input.near.range.x >= input.near.range.y) return;
    const Share own = ownShare();
    Found found;
    if (!measure(&input, &own, page, &count, &found)) return;
    summarize(&found, &own, &block);
    MEET;
    ulong known = 0;
    for (int x = 0; x < BLOCK_SIDE; ++x) known |= block.known.slice[x];
    if (known == 0) return;
    if (sign) findSignLinks(&own, &block);
    MEET;
    if (ITEM == 0) {
        block.open = 0;
        View view = {points, triangles, grid.voxelsPerUnit, 0};
        const uint conflicts = sign ? completeSides(&input, &block, &view) : 0;
        if (conflicts > 0) atomic_add(counters + CONFLICTS, conflicts);
        block.slot = atomic_inc(counters + (block.open ? OPEN_BLOCKS : FILLED_BLOCKS));
        vstore3(input.near.block, block.slot, block.open ? openBlocks : origins);
    }
    MEET;
    if (block.open) return;
    for (int slice = own.firstSlice; slice <= own.lastSlice; ++slice)
        for (int column = own.firstColumn; column <= own.lastColumn; ++column) {
            const int chunk = slice * COLUMNS + column;
            const size_t place = (size_t)(block.slot) * (BLOCK_VOXELS / LANES) + chunk;
            const IntLanes nearest = vloadLanes(chunk, block.nearest);
            const Lanes distance = select((Lanes)(FAR_AWAY), vloadLanes(chunk, block.distance), nearest >= 0);
            const IntLanes inside = lanesOf(sign ? block.inside.chunk[chunk] : 0);
            storeGlobalLanes(select(distance, -distance, inside), place, distances);
            if (TRIANGLES) {
                int owners[LANES];
                *(LooseIntLanes*)(owners) = nearest;
                for (int i = 0; i < LANES; ++i)
                    owners[i] = owners[i] < 0 ? -1 : (int)(pieces[owners[i] >> SIDE_BITS].triangle);
                storeGlobalInts(vloadLanes(0, owners), place, nearestTriangles);
            }
        }
}
