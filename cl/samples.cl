// The samples of the double layer method in a brick: triangles cut into tiles, tiles into runs of samples, runs gathered
// into groups. sdf/tile_cutter.h and sdf/layer_samples.h on a device.
#include "groups.cl"

// Algorithm 1 divides the longest edge into as many parts as the others; with parts beyond this many roots of epsilon
// the triangle counts as a sliver.
#define SLIVER_STEP 3.0
// More tiles than wait at once for any triangle of a grid.
#define MOST_TILES 160
// Most rows and columns of samples in one run.
#define MOST_ROWS 4
// Runs of triangles with a mean area below this are gathered, by cells of this side [voxels^2, voxels].
#define SMALL_AREA 0.5
#define CELL_SIZE 1.0f

// More columns of a group: mean of its runs' offsets. RADIUS holds all samples around PLACE, and the inner and outer
// ones around PLACE less and plus the offset: LayerGroup of sdf/layer_samples.h.
enum { OFFSET_X = COMMON_COLUMNS, OFFSET_Y, OFFSET_Z, ALL_COLUMNS };

// Samples of one part of a triangle, all with the same offset: LayerRun of sdf/layer_samples.h. What Member keeps of
// other things is this here.
typedef struct {
    float place[3];  // the first sample, in the voxels of the brick
    int triangle;
    float twiceOffset[3];
    uint samples;  // their number, and the place of the first one times SAMPLES_AT_MOST
} Run;
#define SAMPLES_AT_MOST 32u

// A part of a triangle that is still to be cut or to be sampled.
typedef struct {
    Corners corners;
    double area, longest2;
} Tile;

typedef struct {
    Tile waiting[MOST_TILES];
    int count;
} Tiles;

double longestEdge2(const Corners* t) {
    return max(lengthSquared(t->b - t->a), max(lengthSquared(t->c - t->b), lengthSquared(t->a - t->c)));
}

Corners cornersFrom(double3 a, double3 b, double3 c) {
    const Corners corners = {a, b, c};
    return corners;
}

void wait(Tiles* tiles, const Limits* limits, Corners corners, double area, double longest2) {
    if (misses(&corners, limits)) return;
    const Tile tile = {corners, area, longest2};
    tiles->waiting[tiles->count++] = tile;
}

// At the middle of the longest edge.
void halve(Tiles* tiles, const Limits* limits, const Tile* tile) {
    const Corners* t = &tile->corners;
    const double ab2 = lengthSquared(t->b - t->a), bc2 = lengthSquared(t->c - t->b), ca2 = lengthSquared(t->a - t->c);
    Corners turned = *t;
    if (bc2 > ab2 && bc2 >= ca2)
        turned = cornersFrom(t->b, t->c, t->a);
    else if (ca2 > ab2)
        turned = cornersFrom(t->c, t->a, t->b);
    const double3 middle = 0.5 * (turned.a + turned.b);
    const Corners first = cornersFrom(turned.a, middle, turned.c), second = cornersFrom(middle, turned.b, turned.c);
    wait(tiles, limits, second, 0.5 * tile->area, longestEdge2(&second));
    wait(tiles, limits, first, 0.5 * tile->area, longestEdge2(&first));
}

void quarter(Tiles* tiles, const Limits* limits, const Tile* tile) {
    const Corners* t = &tile->corners;
    const double3 ab = 0.5 * (t->a + t->b), bc = 0.5 * (t->b + t->c), ca = 0.5 * (t->c + t->a);
    const double area = 0.25 * tile->area, longest2 = 0.25 * tile->longest2;
    wait(tiles, limits, cornersFrom(ab, bc, ca), area, longest2);
    wait(tiles, limits, cornersFrom(ca, bc, t->c), area, longest2);
    wait(tiles, limits, cornersFrom(ab, t->b, bc), area, longest2);
    wait(tiles, limits, cornersFrom(t->a, ab, ca), area, longest2);
}

// Rows of samples that Algorithm 1, or Fig. 2 of the paper, gives a part of a triangle; 0 if it must be cut.
int rowsOf(const Sampling* sampling, double area, double longest2) {
    const double epsilon = sampling->epsilon, sliver2 = SLIVER_STEP * SLIVER_STEP * epsilon;
    if (sampling->recursive) return area <= epsilon && !(sampling->fillGaps && longest2 > sliver2) ? 1 : 0;
    const double n = max(1.0, ceil(sqrt(area / epsilon))), most = sampling->maxSubdivision;
    if (sampling->fillGaps && (longest2 > sliver2 * n * n || n > most)) return 0;
    return (int)(min(n, most));
}

void cutTile(Tiles* tiles, const Sampling* sampling, const Limits* limits, const Tile* tile) {
    const double epsilon = sampling->epsilon, n2 = ceil(sqrt(tile->area / epsilon)) * ceil(sqrt(tile->area / epsilon));
    const bool isSliver = tile->longest2 > SLIVER_STEP * SLIVER_STEP * epsilon * max(1.0, n2);
    if (sampling->recursive ? tile->area <= 2 * epsilon : isSliver)
        halve(tiles, limits, tile);
    else
        quarter(tiles, limits, tile);
}

// Takes the next tile that is to be sampled, and its rows; 0 if there is none left.
int nextTile(Tiles* tiles, const Sampling* sampling, const Limits* limits, Tile* tile) {
    while (tiles->count > 0) {
        *tile = tiles->waiting[--tiles->count];
        const int rows = rowsOf(sampling, tile->area, tile->longest2);
        if (rows > 0) return rows;
        cutTile(tiles, sampling, limits, tile);
    }
    return 0;
}

Tile wholeTile(const Corners* t, double3 normal) {
    const Tile tile = {*t, 0.5 * length(normal), longestEdge2(t)};
    return tile;
}

double3 normalOf(const Corners* t) {
    return cross(t->b - t->a, t->c - t->a);
}

// Bits of the triangles of a batch that get one sample each.
uint singleBits(const Sampling* sampling, const Batch* batch, Exact size) {
    const double epsilon = sampling->epsilon;
    return bitsOfExact((0.5 * size <= epsilon) &
                       (longestEdges2(batch) <= SLIVER_STEP * SLIVER_STEP * epsilon));
}

Exact3 normals(const Batch* batch) {
    return crossExact(subExact(batch->b, batch->a), subExact(batch->c, batch->a));
}

uint onePartBits(const Grid* grid, const Batch* batch) {
    return singleBits(&grid->sampling, batch, sqrt(squareExact(normals(batch))));
}

// A part is a sample here.
uint countParts(const Grid* grid, const Corners* t, const Limits* limits) {
    const Tile whole = wholeTile(t, normalOf(t));
    int rows = rowsOf(&grid->sampling, whole.area, whole.longest2);
    if (rows > 0) return (uint)(rows * (rows + 1) / 2);
    Tiles tiles;
    Tile tile;
    tiles.waiting[0] = whole;
    tiles.count = 1;
    uint count = 0;
    while ((rows = nextTile(&tiles, &grid->sampling, limits, &tile)) > 0) count += (uint)(rows * (rows + 1) / 2);
    return count;
}

// The samples of a brick, and how many runs and samples there are so far.
typedef struct {
    global float* samples;
    global Run* runs;
    SHARED uint* counts;
    uint first;       // the number of the brick's first sample
    double3 origin;   // of the brick
    float3 lower, upper;  // of all places that can matter
    float twiceDelta;
    Extent extent;
} Cut;

enum { RUNS, SAMPLES };

uint take(SHARED uint* counter, uint count) {
#if ITEMS > 1
    return atomic_add(counter, count);
#else
    const uint before = *counter;
    *counter = before + count;
    return before;
#endif
}

void addToExtent(Extent* extent, float3 place, double size) {
    vstore3(min(vload3(0, extent->lower), place), 0, extent->lower);
    vstore3(max(vload3(0, extent->upper), place), 0, extent->upper);
    extent->sizes += size;
}

void putRun(Cut* cut, uint place, float3 first, uint triangle, float3 twiceOffset, uint samples) {
    global float* run = cut->runs[place].place;
    vstore4((float4)(first, as_float(triangle)), 0, run);
    vstore4((float4)(twiceOffset, as_float(samples)), 1, run);
}

// The samples that Algorithm 1 puts into rows row .. and columns column .. of a tile, as one run.
void addRun(Cut* cut, uint triangle, float3 first, float3 down, float3 across, int row, int lastRow, int column,
            int side, float3 twiceOffset, double size) {
    float places[SAMPLES_AT_MOST][3];
    uint count = 0;
    float3 lower = INFINITY, upper = -INFINITY;
    for (int i = row; i < lastRow; ++i)
        for (int j = column; j < min(column + side, i + 1); ++j) {
            const float3 place = first + (float)(i) * down + (float)(j) * across;
            vstore3(place, count++, places[0]);
            lower = min(lower, place);
            upper = max(upper, place);
        }
    if (any(upper < cut->lower) || any(lower > cut->upper)) return;
    const uint at = take(cut->counts + SAMPLES, count);
    for (uint i = 0; i < count; ++i) vstore3(vload3(i, places[0]), at + i, cut->samples);
    const float3 begin = vload3(0, places[0]);
    putRun(cut, take(cut->counts + RUNS, 1), begin, triangle, twiceOffset, (cut->first + at) * SAMPLES_AT_MOST + count);
    addToExtent(&cut->extent, begin, size);
}

// Samples a tile in runs of equal sides.
void addTile(Cut* cut, uint triangle, const Corners* t, int rows, double3 normal) {
    const double size = length(normal), step = 1.0 / rows;
    const float3 twiceOffset = cut->twiceDelta * convert_float3(normal / size);
    const int parts = (rows + MOST_ROWS - 1) / MOST_ROWS, side = (rows + parts - 1) / parts;
    const double3 s1 = (t->b - t->a) * step, s2 = (t->c - t->b) * step, s3 = (t->c - t->a) * step;
    const double3 start = rows == 1 ? (t->a + t->b + t->c) * (1.0 / 3.0) : t->a + (s1 + s3) / 3.0;
    const float3 first = convert_float3(start - cut->origin), down = convert_float3(s1), across = convert_float3(s2);
    for (int row = 0; row < rows; row += side) {
        const int end = min(row + side, rows);
        // rows that stay away as a whole: a tile may be much larger than a brick
        const float3 a = first + (float)(row)*down, b = first + (float)(end - 1) * down;
        const float3 c = a + (float)(row)*across, d = b + (float)(end - 1) * across;
        if (any(max(max(a, b), max(c, d)) < cut->lower) || any(min(min(a, b), min(c, d)) > cut->upper)) continue;
        for (int column = 0; column < end; column += side)
            addRun(cut, triangle, first, down, across, row, end, column, side, twiceOffset, size);
    }
}

// Triangles of a batch that get one sample each.
void addSingles(Cut* cut, const Batch* batch, uint lanes, Exact3 normal, Exact size) {
    const Exact third = 1.0 / 3.0;
    float places[3][BATCH], offsets[3][BATCH];
    double sizes[BATCH];
    const Real x = toReal((batch->a.x + batch->b.x + batch->c.x) * third - cut->origin.x),
               y = toReal((batch->a.y + batch->b.y + batch->c.y) * third - cut->origin.y),
               z = toReal((batch->a.z + batch->b.z + batch->c.z) * third - cut->origin.z);
    const RealInt stays = x >= cut->lower.x && y >= cut->lower.y && z >= cut->lower.z && x <= cut->upper.x &&
                          y <= cut->upper.y && z <= cut->upper.z;
    lanes &= bitsOfReal(stays);
    storeReal(x, places[0]);
    storeReal(y, places[1]);
    storeReal(z, places[2]);
    storeReal(cut->twiceDelta * toReal(normal.x / size), offsets[0]);
    storeReal(cut->twiceDelta * toReal(normal.y / size), offsets[1]);
    storeReal(cut->twiceDelta * toReal(normal.z / size), offsets[2]);
    storeExact(size, sizes);
    uint place = take(cut->counts + RUNS, popcount(lanes));
    for (; lanes != 0; lanes &= lanes - 1, ++place) {
        const int lane = lowestBit(lanes);
        const float3 sample = (float3)(places[0][lane], places[1][lane], places[2][lane]);
        putRun(cut, place, sample, batch->triangle[lane],
               (float3)(offsets[0][lane], offsets[1][lane], offsets[2][lane]), 1);
        addToExtent(&cut->extent, sample, sizes[lane]);
    }
}

// Samples a triangle that must be cut.
void cutLarge(Cut* cut, const Grid* grid, uint triangle, const Tile* whole, double3 normal, const Limits* limits) {
    Tiles tiles;
    Tile tile;
    tiles.waiting[0] = *whole;
    tiles.count = 1;
    for (int rows; (rows = nextTile(&tiles, &grid->sampling, limits, &tile)) > 0;)
        addTile(cut, triangle, &tile.corners, rows, normal);
}

// Samples the triangles of a list.
void cutTriangles(Cut* cut, const Grid* grid, global const float* points, global const uint* triangles,
                  global const uint* list, uint begin, uint end, const Limits* limits) {
    for (uint first = begin + ITEM * BATCH; first < end; first += ITEMS * BATCH) {
        Batch batch;
        fetchBatch(&batch, points, triangles, list, first, end, grid->voxelsPerUnit);
        const Exact3 normal = normals(&batch);
        const Exact size = sqrt(squareExact(normal));
        const uint some = bitsOfExact(size > 0.0) & batch.real;
        const uint singles = singleBits(&grid->sampling, &batch, size) & some;
        if (singles) addSingles(cut, &batch, singles, normal, size);
        for (uint rest = some & ~singles; rest != 0; rest &= rest - 1) {
            const uint triangle = batch.triangle[lowestBit(rest)];
            const Corners t = cornersOf(points, triangles, triangle, grid->voxelsPerUnit);
            const double3 outward = normalOf(&t);
            const Tile whole = wholeTile(&t, outward);
            int rows = rowsOf(&grid->sampling, whole.area, whole.longest2);
            if (rows > 0)
                addTile(cut, triangle, &t, rows, outward);
            else
                cutLarge(cut, grid, triangle, &whole, outward, limits);
        }
    }
}

// The s-th sample of a run.
float3 sampleOf(global const float* samples, global const Run* run, uint s) {
    const uint begin = run->samples / SAMPLES_AT_MOST;
    return begin == 0 && run->samples == 1 ? vload3(0, run->place) : vload3(begin + s, samples);
}

uint sampleCount(global const Run* run) {
    return run->samples % SAMPLES_AT_MOST;
}

void putOffset(const Groups* groups, uint index, float3 offset) {
    global float* column = groups->columns + index;
    column[OFFSET_X * groups->stride] = offset.x;
    column[OFFSET_Y * groups->stride] = offset.y;
    column[OFFSET_Z * groups->stride] = offset.z;
}

// A group of one run.
void groupRun(const Groups* groups, uint index, global const float* samples, global const Run* run, float twiceDelta) {
    const float3 twiceOffset = vload3(0, run->twiceOffset), normal = twiceOffset / twiceDelta;
    float3 lower = INFINITY, upper = -INFINITY;
    for (uint s = 0; s < sampleCount(run); ++s) {
        const float3 place = sampleOf(samples, run, s);
        lower = min(lower, place);
        upper = max(upper, place);
    }
    const float3 middle = 0.5f * (lower + upper);
    float radius2 = 0;
    for (uint s = 0; s < sampleCount(run); ++s) {
        const float3 away = sampleOf(samples, run, s) - middle;
        radius2 = max(radius2, dot(away, away));
    }
    const float height = fabs(dot(vload3(0, run->place) - middle, normal));
    putGroup(groups, index, middle, sqrt(radius2) + GROUP_SLACK, normal, height + GROUP_SLACK);
    putOffset(groups, index, 0.5f * twiceOffset);
}

// A group of runs that share a cell. The first one shall be near the middle.
void groupRuns(const Groups* groups, uint index, global const float* samples, global Run* runs) {
    const uint begin = groups->begins[index], end = groups->begins[index + 1];
    float3 middle = 0, offset = 0;
    float count = 0;
    for (uint r = begin; r < end; ++r) {
        const float own = (float)(sampleCount(runs + r));
        for (uint s = 0; s < sampleCount(runs + r); ++s) middle += sampleOf(samples, runs + r, s);
        offset += 0.5f * own * vload3(0, runs[r].twiceOffset);
        count += own;
    }
    middle /= count;
    offset /= count;
    const float size = length(offset);
    const float3 normal = size > 0 ? offset / size : (float3)(0, 0, 1);
    float radius2 = 0, thickness = 0, nearest2 = INFINITY;
    uint first = begin;
    for (uint r = begin; r < end; ++r) {
        const float3 aside = 0.5f * vload3(0, runs[r].twiceOffset) - offset;
        for (uint s = 0; s < sampleCount(runs + r); ++s) {
            const float3 away = sampleOf(samples, runs + r, s) - middle;
            const float away2 = dot(away, away);
            // |away +- aside| <= its root, and so is |away|
            radius2 = max(radius2, away2 + 2 * fabs(dot(away, aside)) + dot(aside, aside));
            thickness = max(thickness, fabs(dot(away, normal)));
            if (away2 < nearest2) {
                nearest2 = away2;
                first = r;
            }
        }
    }
    const Run swapped = runs[begin];
    runs[begin] = runs[first];
    runs[first] = swapped;
    putGroup(groups, index, middle, sqrt(radius2) + GROUP_SLACK, normal, thickness + GROUP_SLACK);
    putOffset(groups, index, offset);
}
