// Triangles cut into pieces of about a voxel, and pieces grouped into clusters, brick by brick: sdf/pieces.h and
// sdf/clusters.h on a device.
#include "bins.cl"

// Longer edges are halved [voxels].
#define LONGEST_PIECE_EDGE 16.0
// More halvings than any triangle of a grid needs.
#define MOST_HALVINGS 80
// Rounding of a sample's place and of the radius around it; a height below which a piece is as good as its longest edge
// [voxels].
#define RADIUS_SLACK 1e-5f
#define FLAT_HEIGHT 1e-9f
// Pieces with a mean radius below this are grouped, by cells as large as their mean radius times a factor, within limits
// [voxels].
#define SMALL_RADIUS 1.6
#define CELL_FACTOR 4.0f
#define SMALLEST_CELL 1.1f
#define LARGEST_CELL 3.0f
// Rounding of a cluster's own numbers [voxels].
#define CLUSTER_SLACK 1e-4f

// A piece in a frame of its own: Piece of sdf/pieces.h.
typedef struct {
    int base[3];
    float origin[3], u[3], w[3], n[3];
    float length, ox, oy, olen, ex, ey, elen;
    float sample[3];
    float radius;
    uint triangle;
} Piece;

// A piece as its brick sees it: Member of sdf/exact_block.h.
typedef struct {
    float sample[3];
    float radius;
    float normal[3];
    uint piece;
} Member;

// Clusters of all bricks of a batch, a column for each number: Cluster of sdf/exact_block.h. The members of a cluster
// end where those of the next one begin.
enum { SAMPLE_X, SAMPLE_Y, SAMPLE_Z, RADIUS, NORMAL_X, NORMAL_Y, NORMAL_Z, THICKNESS, CLUSTER_COLUMNS };

bool isShort(const Corners* t) {
    return max(lengthSquared(t->b - t->a), max(lengthSquared(t->c - t->b), lengthSquared(t->a - t->c))) <=
           LONGEST_PIECE_EDGE * LONGEST_PIECE_EDGE;
}

bool isOnePart(const Corners* t) {
    return isShort(t);
}

// Cuts a triangle in two at the middle of its longest edge.
void halve(const Corners* t, Corners* first, Corners* second) {
    const double ab2 = lengthSquared(t->b - t->a), bc2 = lengthSquared(t->c - t->b), ca2 = lengthSquared(t->a - t->c);
    // turned so that the longest edge comes first
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
    Corners waiting[MOST_HALVINGS];
    int count;
} Parts;

// Takes the next part that is short enough; false if there is none left. Parts whose box misses the limits are left out.
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

uint countParts(const Corners* t, const Limits* limits) {
    Parts parts;
    Corners part;
    parts.waiting[0] = *t;
    parts.count = 1;
    uint count = 0;
    while (nextPart(&parts, limits, &part)) ++count;
    return count;
}

// Pieces are made as many at once as there are lanes where one item does a group's work, else one by one.
#if ITEMS > 1
#define BATCH 1
typedef float Real;
typedef int RealInt;
#define loadReal(p) (*(p))
#define storeReal(v, p) (*(p) = (v))
#else
#define BATCH LANES
typedef Lanes Real;
typedef IntLanes RealInt;
#define loadReal(p) vloadLanes(0, p)
#define storeReal(v, p) vstoreLanes(v, 0, p)
#endif

typedef struct {
    Real x, y, z;
} Real3;

Real3 make3(Real x, Real y, Real z) {
    const Real3 v = {x, y, z};
    return v;
}
Real3 add3(Real3 a, Real3 b) {
    return make3(a.x + b.x, a.y + b.y, a.z + b.z);
}
Real3 sub3(Real3 a, Real3 b) {
    return make3(a.x - b.x, a.y - b.y, a.z - b.z);
}
Real3 scale3(Real s, Real3 a) {
    return make3(s * a.x, s * a.y, s * a.z);
}
Real dot3(Real3 a, Real3 b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
Real3 cross3(Real3 a, Real3 b) {
    return make3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
Real3 select3(Real3 no, Real3 yes, RealInt which) {
    return make3(select(no.x, yes.x, which), select(no.y, yes.y, which), select(no.z, yes.z, which));
}

// One over a length; zero for none.
Real inverse(Real length) {
    return select((Real)(0.0f), 1.0f / length, length > 0.0f);
}

// A unit vector across a unit vector: for pieces without a height.
Real3 across(Real3 u) {
    const Real zero = 0.0f, one = 1.0f;
    const RealInt useX = fabs(u.x) < 0.6f;
    const Real3 way = cross3(u, select3(make3(zero, one, zero), make3(one, zero, zero), useX));
    return scale3(inverse(sqrt(dot3(way, way))), way);
}

// Pieces to be made: a lattice point, a corner as seen from it, the ways from there to the next corners.
typedef struct {
    int base[3][BATCH];
    uint triangle[BATCH];
    float corner[3][BATCH], ab[3][BATCH], ac[3][BATCH];
    uint count;
} Waiting;

// The numbers of a batch of pieces, a column each.
enum { ORIGIN = 0, AXIS_U = 3, AXIS_W = 6, AXIS_N = 9, LENGTH = 12, LEFT = 13, RIGHT = 16, SAMPLE = 19, COVER = 22, ROWS };

Real3 load3(float (*from)[BATCH]) {
    return make3(loadReal(from[0]), loadReal(from[1]), loadReal(from[2]));
}

void put3(float (*columns)[BATCH], int row, Real3 value) {
    storeReal(value.x, columns[row]);
    storeReal(value.y, columns[row + 1]);
    storeReal(value.z, columns[row + 2]);
}

// The unit vector and the length of an edge in (u, w).
void putEdge(float (*columns)[BATCH], int row, Real x, Real y) {
    const Real size = sqrt(x * x + y * y), part = inverse(size);
    put3(columns, row, make3(select((Real)(1.0f), x * part, size > 0.0f), y * part, size));
}

void makeColumns(Waiting* waiting, float (*columns)[BATCH]) {
    const Real zero = 0.0f, one = 1.0f;
    const Real3 corner = load3(waiting->corner), ab = load3(waiting->ab), ac = load3(waiting->ac), bc = sub3(ac, ab),
                none = make3(zero, zero, zero);
    // turned so that the longest edge comes first
    const Real ab2 = dot3(ab, ab), bc2 = dot3(bc, bc), ca2 = dot3(ac, ac);
    const RealInt isFirst = ab2 >= bc2 && ab2 >= ca2, isSecond = bc2 >= ca2;
    const Real3 begin = select3(select3(add3(corner, ac), add3(corner, ab), isSecond), corner, isFirst);
    const Real3 edge = select3(select3(sub3(none, ac), bc, isSecond), ab, isFirst);
    const Real3 third = select3(select3(sub3(ab, ac), sub3(none, ab), isSecond), ac, isFirst);

    const Real size = sqrt(dot3(edge, edge));
    const Real3 u = select3(make3(one, zero, zero), scale3(inverse(size), edge), size > 0.0f);
    const Real along = min(max(dot3(third, u), zero), size);
    const Real3 rest = sub3(third, scale3(along, u));
    Real height = sqrt(dot3(rest, rest));
    // once more across u, because the rest of a flat piece is mostly rounding; if nothing remains then, all of it was
    const Real3 rough = scale3(inverse(height), rest), way = sub3(rough, scale3(dot3(rough, u), u));
    const Real wayLength = sqrt(dot3(way, way));
    const RealInt flat = height <= FLAT_HEIGHT || wayLength < 0.5f;
    const Real3 w = select3(scale3(inverse(wayLength), way), across(u), flat);
    height = select(height, zero, flat);
    put3(columns, ORIGIN, begin);
    put3(columns, AXIS_U, u);
    put3(columns, AXIS_W, w);
    put3(columns, AXIS_N, cross3(u, w));
    storeReal(size, columns[LENGTH]);
    putEdge(columns, LEFT, along, height);
    putEdge(columns, RIGHT, along - size, height);
    // the centre of the smallest circle around the piece: of its corners', or the middle of the longest edge
    const Real middle = 0.5f * size;
    const Real lift = (along * along + height * height - along * size) / (height + height);
    const Real up = select(max(lift, zero), zero, flat);
    put3(columns, SAMPLE, add3(begin, add3(scale3(middle, u), scale3(up, w))));
    storeReal(sqrt(middle * middle + up * up) + RADIUS_SLACK, columns[COVER]);
}

void makePieces(Waiting* waiting, global Piece* pieces) {
    float columns[ROWS][BATCH];
    makeColumns(waiting, columns);
    for (uint i = 0; i < waiting->count; ++i) {
        global Piece* piece = pieces + i;
        for (int axis = 0; axis < 3; ++axis) piece->base[axis] = waiting->base[axis][i];
        global float* numbers = piece->origin;
        for (int row = 0; row < ROWS; ++row) numbers[row] = columns[row][i];
        piece->triangle = waiting->triangle[i];
    }
    waiting->count = 0;
}

// The pieces of a brick, and how many of them there are so far.
typedef struct {
    global Piece* pieces;
    SHARED uint* count;
} Cut;

void flush(const Cut* cut, Waiting* waiting) {
    if (waiting->count == 0) return;
#if ITEMS > 1
    const uint place = atomic_add(cut->count, waiting->count);
#else
    const uint place = *cut->count;
    *cut->count += waiting->count;
#endif
    makePieces(waiting, cut->pieces + place);
}

void addPart(const Cut* cut, Waiting* waiting, const Corners* t, uint triangle) {
    const uint at = waiting->count;
    // rounded to the nearest, halves always up, so that a shift by whole voxels shifts the result
    const int3 base = convert_int3_rtn(t->a + 0.5);
    const float3 corner = convert_float3(t->a - convert_double3(base)), ab = convert_float3(t->b - t->a),
                 ac = convert_float3(t->c - t->a);
    waiting->base[0][at] = base.x;
    waiting->base[1][at] = base.y;
    waiting->base[2][at] = base.z;
    waiting->corner[0][at] = corner.x;
    waiting->corner[1][at] = corner.y;
    waiting->corner[2][at] = corner.z;
    waiting->ab[0][at] = ab.x;
    waiting->ab[1][at] = ab.y;
    waiting->ab[2][at] = ab.z;
    waiting->ac[0][at] = ac.x;
    waiting->ac[1][at] = ac.y;
    waiting->ac[2][at] = ac.z;
    waiting->triangle[at] = triangle;
    if (++waiting->count == BATCH) flush(cut, waiting);
}

void cutTriangles(const Cut* cut, global const float* points, global const uint* triangles, global const uint* list,
                  uint begin, uint end, double voxelsPerUnit, const Limits* limits) {
    Waiting waiting;
    waiting.count = 0;
    for (uint i = begin + ITEM; i < end; i += ITEMS) {
        const uint triangle = list[i];
        const Corners t = cornersOf(points, triangles, triangle, voxelsPerUnit);
        if (isShort(&t)) {
            addPart(cut, &waiting, &t, triangle);
            continue;
        }
        Parts parts;
        Corners part;
        parts.waiting[0] = t;
        parts.count = 1;
        while (nextPart(&parts, limits, &part)) addPart(cut, &waiting, &part, triangle);
    }
    flush(cut, &waiting);
}

// What the items of a group tell each other about the samples of a brick.
typedef struct {
    double radii;
    float lower[3], upper[3];
} Extent;

// Cells of a box.
typedef struct {
    float lower[3];
    float side;
    int size[3];
} Cells;

uint cellOf(const Cells* cells, float3 place) {
    const int3 cell = convert_int3((place - vload3(0, cells->lower)) / cells->side);
    return (uint)((cell.x * cells->size[1] + cell.y) * cells->size[2] + cell.z);
}

Extent addExtents(const Extent* a, const Extent* b) {
    Extent sum;
    sum.radii = a->radii + b->radii;
    for (int axis = 0; axis < 3; ++axis) {
        sum.lower[axis] = min(a->lower[axis], b->lower[axis]);
        sum.upper[axis] = max(a->upper[axis], b->upper[axis]);
    }
    return sum;
}

// Makes members of pieces, unsorted.
Extent makeMembers(global const Piece* pieces, uint first, uint count, int3 origin, global Member* members) {
    Extent extent = {0, {INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (uint i = ITEM; i < count; i += ITEMS) {
        global const Piece* piece = pieces + first + i;
        const float3 sample = convert_float3(vload3(0, piece->base) - origin) + vload3(0, piece->sample);
        global Member* member = members + i;
        vstore3(sample, 0, member->sample);
        member->radius = piece->radius;
        vstore3(vload3(0, piece->n), 0, member->normal);
        member->piece = first + i;
        const Extent one = {piece->radius, {sample.x, sample.y, sample.z}, {sample.x, sample.y, sample.z}};
        extent = addExtents(&extent, &one);
    }
    return extent;
}

// The columns of clusters of a batch, and what of them is a brick's.
typedef struct {
    global float* columns;
    global uint* begins;  // the first member of each cluster, and the end of the last one
    uint stride;
} Clusters;

void putCluster(const Clusters* clusters, uint index, float3 sample, float radius, float3 normal, float thickness,
                uint begin) {
    global float* column = clusters->columns + index;
    const uint stride = clusters->stride;
    column[SAMPLE_X * stride] = sample.x;
    column[SAMPLE_Y * stride] = sample.y;
    column[SAMPLE_Z * stride] = sample.z;
    column[RADIUS * stride] = radius;
    column[NORMAL_X * stride] = normal.x;
    column[NORMAL_Y * stride] = normal.y;
    column[NORMAL_Z * stride] = normal.z;
    column[THICKNESS * stride] = thickness;
    clusters->begins[index] = begin;
}

// Members begin .. end become a cluster; returns how far it reaches around its sample.
void addCluster(const Clusters* clusters, uint index, global const Member* members, uint begin, uint end) {
    float3 mean = 0, normal = 0;
    for (uint m = begin; m < end; ++m) {
        mean += vload3(0, members[m].sample);
        normal += vload3(0, members[m].normal);
    }
    mean /= (float)(end - begin);
    const float size = length(normal);
    normal = size > 0 ? normal / size : (float3)(0, 0, 1);
    // the sample must be a point of the surface: the member's nearest to the middle
    float3 sample = 0;
    float nearest2 = INFINITY;
    for (uint m = begin; m < end; ++m) {
        const float3 place = vload3(0, members[m].sample), away = place - mean;
        const float away2 = dot(away, away);
        if (away2 < nearest2) {
            nearest2 = away2;
            sample = place;
        }
    }
    float radius = 0, thickness = 0;
    for (uint m = begin; m < end; ++m) {
        const float3 away = vload3(0, members[m].sample) - sample;
        const float facing = dot(vload3(0, members[m].normal), normal), own = members[m].radius;
        radius = max(radius, length(away) + own);
        thickness = max(thickness, fabs(dot(away, normal)) + own * sqrt(max(0.0f, 1 - facing * facing)));
    }
    putCluster(clusters, index, sample, radius + CLUSTER_SLACK, normal, thickness + CLUSTER_SLACK, begin);
}

// Sorts members by cell into `sorted`; each cell that has some becomes a cluster. Returns the number of clusters.
uint groupMembers(const Clusters* clusters, uint first, global const Member* unsorted, global Member* sorted,
                  global uint* cellOfMember, uint count, const Cells* cells, global uint* cursors,
                  SHARED uint2* sums) {
    const uint cellCount = (uint)(cells->size[0] * cells->size[1] * cells->size[2]);
    for (uint cell = ITEM; cell < cellCount; cell += ITEMS) cursors[cell] = 0;
    MEET;
    for (uint i = ITEM; i < count; i += ITEMS) {
        const uint cell = cellOf(cells, vload3(0, unsorted[i].sample));
        cellOfMember[i] = cell;
        takeGlobal(cursors + cell, 1);
    }
    MEET;
    // how many members and clusters come before the cells of each item
    const uint begin = (uint)((ulong)(cellCount) * ITEM / ITEMS), end = (uint)((ulong)(cellCount) * (ITEM + 1) / ITEMS);
    uint2 sum = 0;
    if (ITEMS > 1) {
        for (uint cell = begin; cell < end; ++cell) sum += (uint2)(cursors[cell], cursors[cell] > 0);
        sums[ITEM] = sum;
        MEET;
        sum = 0;
        for (uint i = 0; i < ITEM; ++i) sum += sums[i];
    }
    uint cluster = first + sum.y;
    for (uint cell = begin; cell < end; ++cell) {
        const uint inCell = cursors[cell];
        if (inCell > 0) clusters->begins[cluster++] = first + sum.x;
        cursors[cell] = sum.x;
        sum.x += inCell;
    }
    if (ITEM == ITEMS - 1) {
        clusters->begins[cluster] = first + count;
        sums[0].y = cluster - first;
    }
    MEET;
    const uint found = sums[0].y;
    for (uint i = ITEM; i < count; i += ITEMS) sorted[takeGlobal(cursors + cellOfMember[i], 1)] = unsorted[i];
    MEET;
    for (uint c = first + ITEM; c < first + found; c += ITEMS) {
        const uint beginOf = clusters->begins[c] - first, endOf = clusters->begins[c + 1] - first;
        addCluster(clusters, c, sorted - first, beginOf + first, endOf + first);
    }
    return found;
}

// Which clusters of a brick, in their order, may reach each slice of blocks of the same x.
void rangeClusters(const Clusters* clusters, uint first, uint count, int slices, float reach, global uint2* ranges) {
    for (int slice = (int)(ITEM); slice < slices; slice += ITEMS) ranges[slice] = (uint2)(UINT_MAX, 0);
    MEET;
    for (uint c = first + ITEM; c < first + count; c += ITEMS) {
        const float x = clusters->columns[SAMPLE_X * clusters->stride + c],
                    beyond = reach + clusters->columns[RADIUS * clusters->stride + c] + CLUSTER_SLACK;
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
