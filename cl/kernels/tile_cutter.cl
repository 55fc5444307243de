// SPDX-License-Identifier: Apache-2.0
// Cuts triangles into the parts that Algorithm 1 of the paper samples without gaps: sdf/fill/tile_cutter.h on a device.
#include "bins.cl"

// Algorithm 1 divides the longest edge into as many parts as the others. If the parts are longer than this many square
// roots of epsilon, the triangle is a sliver.
#define SLIVER_STEP 3.0
// Spacing of the samples along a thin part [square roots of epsilon], and the number after which the sequence restarts.
#define THIN_STEP 1.6
#define MAX_ALONG (1 << 30)
#define THIN_RUN 16
// Upper limit of the tiles that wait at once for a triangle of a grid.
#define MAX_TILES 160

// A part of a triangle that is still to be cut or to be sampled.
typedef struct {
    Corners corners;
    double area, longest2;
} Tile;

typedef struct {
    Tile waiting[MAX_TILES];
    int count;
} Tiles;

double longestEdge2(const Corners* t) {
    return max(lengthSquared(t->b - t->a), max(lengthSquared(t->c - t->b), lengthSquared(t->a - t->c)));
}

Corners cornersFrom(double3 a, double3 b, double3 c) {
    const Corners corners = {a, b, c};
    return corners;
}

void push(Tiles* tiles, const Limits* limits, Corners corners, double area, double longest2) {
    if (misses(&corners, limits)) return;
    const Tile tile = {corners, area, longest2};
    tiles->waiting[tiles->count++] = tile;
}

// The same triangle, its longest edge from a to b.
Corners rotatedToLongest(const Corners* t) {
    const double ab2 = lengthSquared(t->b - t->a), bc2 = lengthSquared(t->c - t->b), ca2 = lengthSquared(t->a - t->c);
    if (bc2 > ab2 && bc2 >= ca2) return cornersFrom(t->b, t->c, t->a);
    if (ca2 > ab2) return cornersFrom(t->c, t->a, t->b);
    return *t;
}

// Halves a tile at the middle of the longest edge.
void halve(Tiles* tiles, const Limits* limits, const Tile* tile) {
    const Corners t = rotatedToLongest(&tile->corners);
    const double3 middle = 0.5 * (t.a + t.b);
    const Corners first = cornersFrom(t.a, middle, t.c), second = cornersFrom(middle, t.b, t.c);
    push(tiles, limits, second, 0.5 * tile->area, longestEdge2(&second));
    push(tiles, limits, first, 0.5 * tile->area, longestEdge2(&first));
}

void quarter(Tiles* tiles, const Limits* limits, const Tile* tile) {
    const Corners* t = &tile->corners;
    const double3 ab = 0.5 * (t->a + t->b), bc = 0.5 * (t->b + t->c), ca = 0.5 * (t->c + t->a);
    const double area = 0.25 * tile->area, longest2 = 0.25 * tile->longest2;
    push(tiles, limits, cornersFrom(ab, bc, ca), area, longest2);
    push(tiles, limits, cornersFrom(ca, bc, t->c), area, longest2);
    push(tiles, limits, cornersFrom(ab, t->b, bc), area, longest2);
    push(tiles, limits, cornersFrom(t->a, ab, ca), area, longest2);
}

// The samples of a part of a triangle: rows of them, or one row along it if it is thin. None if it must be cut.
typedef struct {
    int rows;   // n of Algorithm 1; 1 in Fig. 2 of the paper
    int along;  // see ThinPart
} Shape;

Shape shapeOf(const Sampling* sampling, const Tile* tile) {
    const double epsilon = sampling->epsilon, sliver2 = SLIVER_STEP * SLIVER_STEP * epsilon, area = tile->area,
                 longest2 = tile->longest2;
    const Shape cut = {0, 0}, one = {1, 0};
    if (sampling->recursive) return area <= epsilon && !(sampling->fillGaps && longest2 > sliver2) ? one : cut;
    const double n = max(1.0, ceil(sqrt(area / epsilon))), maxRows = sampling->maxSubdivision;
    if (sampling->fillGaps && longest2 > sliver2 * n * n) {
        const Shape thin = {0,
                            (int)(min(ceil(sqrt(longest2 / (THIN_STEP * THIN_STEP * epsilon))), (double)(MAX_ALONG)))};
        return 4 * area * area <= epsilon * longest2 ? thin : cut;
    }
    const Shape rows = {(int)(min(n, maxRows)), 0};
    return sampling->fillGaps && n > maxRows ? cut : rows;
}

void cutTile(Tiles* tiles, const Sampling* sampling, const Limits* limits, const Tile* tile) {
    const double epsilon = sampling->epsilon, n2 = ceil(sqrt(tile->area / epsilon)) * ceil(sqrt(tile->area / epsilon));
    const bool isSliver = tile->longest2 > SLIVER_STEP * SLIVER_STEP * epsilon * max(1.0, n2);
    if (sampling->recursive ? tile->area <= 2 * epsilon : isSliver)
        halve(tiles, limits, tile);
    else
        quarter(tiles, limits, tile);
}

// Takes the next tile that is to be sampled. False if there is none left.
bool nextTile(Tiles* tiles, const Sampling* sampling, const Limits* limits, Tile* tile, Shape* shape) {
    while (tiles->count > 0) {
        *tile = tiles->waiting[--tiles->count];
        *shape = shapeOf(sampling, tile);
        if (shape->rows + shape->along > 0) return true;
        cutTile(tiles, sampling, limits, tile);
    }
    return false;
}

// ThinPart of sdf/fill/tile_cutter.h.
typedef struct {
    double3 from, edge, rise;
    double peak;
    int along;
    int begin, end;  // range of the runs that may be within the limits
} Thin;

// A run of its samples.
typedef struct {
    double3 start, startStep;
    double up, upStep, down, downStep;
    int count;
} ThinRun;

Thin thinWithin(const Corners* t, int along, const Limits* limits) {
    const Corners rotated = rotatedToLongest(t);
    Thin thin = {.from = rotated.a, .edge = rotated.b - rotated.a, .along = along};
    const double3 opposite = rotated.c - rotated.a, none = 0.0;
    thin.peak = clamp(dot(opposite, thin.edge) / dot(thin.edge, thin.edge), 1e-6, 1 - 1e-6);
    thin.rise = 0.5 * (opposite - thin.peak * thin.edge);
    const double3 lower = limits->lower - max(thin.rise, none) - thin.from,
                  upper = limits->upper - min(thin.rise, none) - thin.from;
    // on an axis perpendicular to the edge, all of it is within the limits, or nothing
    const long3 perpendicular = thin.edge == 0.0;
    if (any(perpendicular && (lower > 0.0 || upper < 0.0))) return thin;
    const double3 divisor = select(thin.edge, (double3)(1.0), perpendicular);
    const double3 a = select(lower / divisor, none, perpendicular),
                  b = select(upper / divisor, (double3)(1.0), perpendicular);
    const double3 nearer = min(a, b), farther = max(a, b);
    const double low = max(0.0, max(nearer.x, max(nearer.y, nearer.z))),
                 high = min(1.0, min(farther.x, min(farther.y, farther.z)));
    if (low > high) return thin;
    // one more sample at each end allows for rounding
    thin.begin = max(0, (int)(low * along) - 2) / THIN_RUN * THIN_RUN;
    thin.end = min(along, (int)(high * along) + 2);
    return thin;
}

ThinRun thinRun(const Thin* thin, int first) {
    const double step = 1.0 / thin->along, at = (first + 1.0 / 3.0) * step, peak = thin->peak;
    const ThinRun run = {thin->from + at * thin->edge,
                         step * thin->edge,
                         at / peak,
                         step / peak,
                         (1 - at) / (1 - peak),
                         -step / (1 - peak),
                         min(THIN_RUN, thin->along - first)};
    return run;
}

uint countThin(const Corners* t, int along, const Limits* limits) {
    const Thin thin = thinWithin(t, along, limits);
    const int end = min(along, (thin.end + THIN_RUN - 1) / THIN_RUN * THIN_RUN);
    return (uint)(end - thin.begin);
}

// Starts with a whole triangle.
void beginTiles(Tiles* tiles, const Corners* t, double3 normal) {
    const Tile whole = {*t, 0.5 * length(normal), longestEdge2(t)};
    tiles->waiting[0] = whole;
    tiles->count = 1;
}

double3 normalOf(const Corners* t) {
    return cross(t->b - t->a, t->c - t->a);
}

Exact3 normals(const Batch* batch) {
    return crossExact(subExact(batch->b, batch->a), subExact(batch->c, batch->a));
}

// Rows of Algorithm 1 for triangles of a batch that need no cut; 0 for the others.
Exact rowsOfBatch(const Sampling* sampling, const Batch* batch, Exact size) {
    const double epsilon = sampling->epsilon, maxRows = sampling->recursive ? 1 : sampling->maxSubdivision;
    const Exact rows = max((Exact)(1.0), ceil(sqrt(0.5 * size / epsilon)));
    const Exact sliver2 = rows * rows * (SLIVER_STEP * SLIVER_STEP * epsilon);
    return ((longestEdges2(batch) <= sliver2) & (rows <= maxRows)) ? rows : (Exact)(0.0);
}

// Here a part is a sample.
RealInt partsOfBatch(const Grid* grid, const Batch* batch) {
    const Exact rows = rowsOfBatch(&grid->sampling, batch, sqrt(squareExact(normals(batch))));
    return toRealInt(0.5 * rows * (rows + 1.0));
}

uint countParts(const Grid* grid, const Corners* t, const Limits* limits) {
    Tiles tiles;
    Tile tile;
    beginTiles(&tiles, t, normalOf(t));
    Shape shape;
    uint count = 0;
    while (nextTile(&tiles, &grid->sampling, limits, &tile, &shape))
        count +=
            shape.rows > 0 ? (uint)(shape.rows * (shape.rows + 1) / 2) : countThin(&tile.corners, shape.along, limits);
    return count;
}
