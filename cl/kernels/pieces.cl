// SPDX-License-Identifier: Apache-2.0
// Cuts triangles into pieces of about a voxel, and groups pieces into clusters, brick by brick: sdf/fill/pieces.h and
// sdf/fill/clusters.h on a device.
#include "groups.cl"

// Longer edges are halved [voxels].
#define MAX_PIECE_EDGE 16.0
// Upper limit of the halvings of a triangle in a grid.
#define MAX_HALVINGS 80
// Rounding of a sample's position and of the radius around it [voxels].
#define RADIUS_SLACK 1e-5f
// Shorter edges count as points, and pieces of less height as their longest edge. Floats can hold the squares of all
// greater lengths [voxels].
#define MIN_LENGTH 1e-9f
// Pieces with a mean radius below this are grouped. The cell size is their mean radius times a factor, within limits
// [voxels].
#define SMALL_RADIUS 1.6
#define CELL_FACTOR 4.0f
#define MIN_CELL 1.1f
#define MAX_CELL 3.0f

// A piece in its own frame: Piece of sdf/fill/pieces.h.
typedef struct {
    int base[3];
    uint triangle;
    float origin[3], u[3], w[3], n[3];
    float length, ox, oy, olen, ex, ey, elen;
    float sample[3];
    float radius;
    float unused;  // padding: the numbers are written four at a time
} Piece;

bool isShort(const Corners* t) {
    return max(lengthSquared(t->b - t->a), max(lengthSquared(t->c - t->b), lengthSquared(t->a - t->c))) <=
           MAX_PIECE_EDGE * MAX_PIECE_EDGE;
}

uint shortBits(const Batch* batch) {
    return bitsOfReal(toReal(longestEdges2(batch)) <= (float)(MAX_PIECE_EDGE * MAX_PIECE_EDGE)) & batch->valid;
}

RealInt partsOfBatch(const Grid* grid, const Batch* batch) {
    (void)(grid);
    return lanesOfBits(shortBits(batch)) & 1;
}

// Halves a triangle at the middle of its longest edge.
void halve(const Corners* t, Corners* first, Corners* second) {
    const double ab2 = lengthSquared(t->b - t->a), bc2 = lengthSquared(t->c - t->b), ca2 = lengthSquared(t->a - t->c);
    // rotated so that the longest edge comes first
    double3 i = t->a, j = t->b, k = t->c;
    if (bc2 > ab2 && bc2 >= ca2) {
        i = t->b;
        j = t->c;
        k = t->a;
    } else if (ca2 > ab2) {
        i = t->c;
        j = t->a;
        k = t->b;
    }
    const double3 middle = 0.5 * (i + j);
    first->a = i;
    first->b = second->a = middle;
    second->b = j;
    first->c = second->c = k;
}

// The parts of a triangle that are still to be cut.
typedef struct {
    Corners waiting[MAX_HALVINGS];
    int count;
} Parts;

// Takes the next part that is short enough; false if there is none left. Skips parts whose box is outside of the
// limits.
bool nextPart(Parts* parts, const Limits* limits, Corners* part) {
    while (parts->count > 0) {
        *part = parts->waiting[--parts->count];
        if (isShort(part)) return true;
        Corners halves[2];
        halve(part, &halves[0], &halves[1]);
        for (int i = 1; i >= 0; --i)
            if (!misses(&halves[i], limits)) parts->waiting[parts->count++] = halves[i];
    }
    return false;
}

uint countParts(const Grid* grid, const Corners* t, const Limits* limits) {
    (void)(grid);
    Parts parts;
    Corners part;
    parts.waiting[0] = *t;
    parts.count = 1;
    uint count = 0;
    while (nextPart(&parts, limits, &part)) ++count;
    return count;
}

// The inverse of a length; zero for a length of zero.
Real inverse(Real length) {
    return select((Real)(0.0f), 1.0f / length, length > MIN_LENGTH);
}

// A unit vector perpendicular to a unit vector: for pieces without a height.
Real3 perpendicularTo(Real3 u) {
    const Real zero = 0.0f, one = 1.0f;
    const RealInt useX = fabs(u.x) < 0.6f;
    const Real3 perpendicular = cross3(u, select3(make3(zero, one, zero), make3(one, zero, zero), useX));
    return scale3(inverse(sqrt(dot3(perpendicular, perpendicular))), perpendicular);
}

// The numbers of a batch of pieces, a column each: those of Piece, then the sample in the brick's voxels.
enum {
    ORIGIN = 0,
    AXIS_U = 3,
    AXIS_W = 6,
    AXIS_N = 9,
    LENGTH = 12,
    LEFT = 13,
    RIGHT = 16,
    SAMPLE = 19,
    COVERING_RADIUS = 22,
    PIECE_ROWS = 24,
    IN_BRICK = 24,
    ROWS = 27
};

void store3(float (*columns)[BATCH], int row, Real3 value) {
    storeReal(value.x, columns[row]);
    storeReal(value.y, columns[row + 1]);
    storeReal(value.z, columns[row + 2]);
}

// The unit vector and the length of an edge in (u, w).
void storeEdge(float (*columns)[BATCH], int row, Real x, Real y) {
    const Real size = sqrt(x * x + y * y), part = inverse(size);
    store3(columns, row, make3(select((Real)(1.0f), x * part, size > MIN_LENGTH), y * part, size));
}

// Computes the frames of pieces, from a corner relative to a lattice point and the vectors from there to the next
// corners. `shift` leads from the lattice points to the brick. Adds the samples in the brick's voxels.
void makeColumns(Real3 corner, Real3 ab, Real3 ac, Real3 shift, float (*columns)[BATCH]) {
    const Real zero = 0.0f, one = 1.0f;
    const Real3 bc = sub3(ac, ab), none = make3(zero, zero, zero);
    // rotated so that the longest edge comes first
    const Real ab2 = dot3(ab, ab), bc2 = dot3(bc, bc), ca2 = dot3(ac, ac);
    const RealInt isFirst = ab2 >= bc2 && ab2 >= ca2, isSecond = bc2 >= ca2;
    const Real3 begin = select3(select3(add3(corner, ac), add3(corner, ab), isSecond), corner, isFirst);
    const Real3 edge = select3(select3(sub3(none, ac), bc, isSecond), ab, isFirst);
    const Real3 third = select3(select3(sub3(ab, ac), sub3(none, ab), isSecond), ac, isFirst);

    const Real size = sqrt(dot3(edge, edge));
    const Real3 u = select3(make3(one, zero, zero), scale3(inverse(size), edge), size > MIN_LENGTH);
    const Real along = min(max(dot3(third, u), zero), size);
    const Real3 rest = sub3(third, scale3(along, u));
    Real height = sqrt(dot3(rest, rest));
    // orthogonalised to u again, since the rest of a flat piece is mostly rounding; if nothing remains, all of it was
    const Real3 rough = scale3(inverse(height), rest), perpendicular = sub3(rough, scale3(dot3(rough, u), u));
    const Real perpendicularLength = sqrt(dot3(perpendicular, perpendicular));
    const RealInt flat = height <= MIN_LENGTH || perpendicularLength < 0.5f;
    const Real3 w = select3(scale3(inverse(perpendicularLength), perpendicular), perpendicularTo(u), flat);
    height = select(height, zero, flat);
    store3(columns, ORIGIN, begin);
    store3(columns, AXIS_U, u);
    store3(columns, AXIS_W, w);
    store3(columns, AXIS_N, cross3(u, w));
    storeReal(size, columns[LENGTH]);
    storeEdge(columns, LEFT, along, height);
    storeEdge(columns, RIGHT, along - size, height);
    // the centre of the smallest circle around the piece: the circumcircle, or the middle of the longest edge
    const Real middle = 0.5f * size;
    const Real lift = (along * along + height * height - along * size) / (height + height);
    const Real up = select(max(lift, zero), zero, flat);
    const Real3 sample = add3(begin, add3(scale3(middle, u), scale3(up, w)));
    store3(columns, SAMPLE, sample);
    store3(columns, IN_BRICK, add3(sample, shift));
    storeReal(sqrt(middle * middle + up * up) + RADIUS_SLACK, columns[COVERING_RADIUS]);
    storeReal(zero, columns[COVERING_RADIUS + 1]);
}

// The pieces of a brick, and their count so far.
typedef struct {
    global Piece* pieces;
    global Member* members;
    SHARED uint* count;
    uint first;   // index of the brick's first piece
    int3 origin;  // of the brick
    Extent extent;
} PieceOutput;

float4 fourOf(float (*columns)[BATCH], int row, int lane) {
    return (float4)(columns[row][lane], columns[row + 1][lane], columns[row + 2][lane], columns[row + 3][lane]);
}

// Makes pieces and their members from some lanes.
void makePieces(PieceOutput* output, uint lanes, Real3 corner, Real3 ab, Real3 ac, int (*base)[BATCH],
                const uint* triangles) {
    float columns[ROWS][BATCH];
    const Real3 shift = make3(toRealFromInt(loadRealInt(base[0]) - output->origin.x),
                              toRealFromInt(loadRealInt(base[1]) - output->origin.y),
                              toRealFromInt(loadRealInt(base[2]) - output->origin.z));
    makeColumns(corner, ab, ac, shift, columns);
    uint slot = fetchAddShared(output->count, popcount(lanes));
    float3 lower = vload3(0, output->extent.lower), upper = vload3(0, output->extent.upper);
    float radii = 0;
    for (; lanes != 0; lanes &= lanes - 1, ++slot) {
        const int lane = lowestBit(lanes);
        global Piece* piece = output->pieces + slot;
        *(global int4*)(piece->base) = (int4)(base[0][lane], base[1][lane], base[2][lane], (int)(triangles[lane]));
        global float4* numbers = (global float4*)(piece->origin);
        UNROLLED for (int row = 0; row < PIECE_ROWS; row += 4) numbers[row / 4] = fourOf(columns, row, lane);
        const float3 sample = fourOf(columns, IN_BRICK, lane).xyz;
        const float radius = columns[COVERING_RADIUS][lane];
        global float4* member = (global float4*)(output->members + slot);
        member[0] = (float4)(sample, radius);
        member[1] = (float4)(columns[AXIS_N][lane], columns[AXIS_N + 1][lane], columns[AXIS_N + 2][lane],
                             as_float(output->first + slot));
        lower = min(lower, sample);
        upper = max(upper, sample);
        radii += radius;
    }
    vstore3(lower, 0, output->extent.lower);
    vstore3(upper, 0, output->extent.upper);
    output->extent.radii += radii;
}

// Parts of long triangles that wait until they fill a batch: their lattice points, a corner relative to it, and the
// vectors from it to the next corners.
typedef struct {
    int base[3][BATCH];
    uint triangle[BATCH];
    float corner[3][BATCH], ab[3][BATCH], ac[3][BATCH];
    uint count;
} Waiting;

Real3 load3(float (*from)[BATCH]) {
    return make3(loadReal(from[0]), loadReal(from[1]), loadReal(from[2]));
}

void flush(PieceOutput* output, Waiting* waiting) {
    if (waiting->count == 0) return;
    makePieces(output, (1u << waiting->count) - 1, load3(waiting->corner), load3(waiting->ab), load3(waiting->ac),
               waiting->base, waiting->triangle);
    waiting->count = 0;
}

// The lattice point nearest to a point. Halves round up, so that a shift by whole voxels shifts the result.
#define nearestLattice(point) floor((point) + 0.5)

void addPart(PieceOutput* output, Waiting* waiting, const Corners* t, uint triangle) {
    const uint at = waiting->count;
    const double3 base = nearestLattice(t->a), corner = t->a - base, ab = t->b - t->a, ac = t->c - t->a;
    const double from[12] = {base.x, base.y, base.z, corner.x, corner.y, corner.z, ab.x, ab.y, ab.z, ac.x, ac.y, ac.z};
    for (int axis = 0; axis < 3; ++axis) {
        waiting->base[axis][at] = (int)(from[axis]);
        waiting->corner[axis][at] = (float)(from[3 + axis]);
        waiting->ab[axis][at] = (float)(from[6 + axis]);
        waiting->ac[axis][at] = (float)(from[9 + axis]);
    }
    waiting->triangle[at] = triangle;
    if (++waiting->count == BATCH) flush(output, waiting);
}

void cutLong(PieceOutput* output, Waiting* waiting, const Corners* t, uint triangle, const Limits* limits) {
    Parts parts;
    Corners part;
    parts.waiting[0] = *t;
    parts.count = 1;
    while (nextPart(&parts, limits, &part)) addPart(output, waiting, &part, triangle);
}

// Cuts the triangles of a list.
void cutTriangles(PieceOutput* output, global const float* points, global const uint* triangles,
                  global const uint* list, uint begin, uint end, double voxelsPerUnit, const Limits* limits) {
    Waiting waiting;
    waiting.count = 0;
    for (uint first = begin + ITEM * BATCH; first < end; first += ITEMS * BATCH) {
        Batch batch;
        fetchBatch(&batch, points, triangles, list, first, end, voxelsPerUnit);
        const Exact3 base = {nearestLattice(batch.a.x), nearestLattice(batch.a.y), nearestLattice(batch.a.z)};
        const Exact3 ab = subExact(batch.b, batch.a), ac = subExact(batch.c, batch.a);
        const uint shortTriangles = shortBits(&batch);
        int bases[3][BATCH];
        storeRealInt(toRealInt(base.x), bases[0]);
        storeRealInt(toRealInt(base.y), bases[1]);
        storeRealInt(toRealInt(base.z), bases[2]);
        if (shortTriangles)
            makePieces(output, shortTriangles, toReal3(subExact(batch.a, base)), toReal3(ab), toReal3(ac), bases,
                       batch.triangle);
        for (uint rest = batch.valid & ~shortTriangles; rest != 0; rest &= rest - 1) {
            const uint one = batch.triangle[lowestBit(rest)];
            const Corners t = cornersOf(points, triangles, one, voxelsPerUnit);
            cutLong(output, &waiting, &t, one, limits);
        }
    }
    flush(output, &waiting);
}

// Makes a cluster of a group of pieces, with a sample and a radius that covers all of them: sdf/fill/clusters.h.
void makeCluster(const Groups* groups, uint index, global const Member* members) {
    const uint begin = groups->begins[index], end = groups->begins[index + 1];
    float3 mean = 0, normal = 0;
    for (uint m = begin; m < end; ++m) {
        mean += vload3(0, members[m].position);
        normal += vload3(0, members[m].normal);
    }
    mean /= (float)(end - begin);
    const float size = length(normal);
    normal = size > 0 ? normal / size : (float3)(0, 0, 1);
    // the sample must be on the surface: the member's sample nearest to the middle
    float3 sample = 0;
    float nearest2 = INFINITY;
    for (uint m = begin; m < end; ++m) {
        const float3 position = vload3(0, members[m].position), offset = position - mean;
        const float distance2 = dot(offset, offset);
        if (distance2 < nearest2) {
            nearest2 = distance2;
            sample = position;
        }
    }
    float radius = 0, thickness = 0;
    for (uint m = begin; m < end; ++m) {
        const float3 offset = vload3(0, members[m].position) - sample;
        // by the cross product: near 1, the cosine is too coarse to give the sine
        const float sine = length(cross(vload3(0, members[m].normal), normal)), own = members[m].radius;
        radius = max(radius, length(offset) + own);
        thickness = max(thickness, fabs(dot(offset, normal)) + own * sine);
    }
    storeGroup(groups, index, sample, radius + GROUP_SLACK, normal, thickness + GROUP_SLACK);
}
