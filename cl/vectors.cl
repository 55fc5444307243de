// Triangles a batch at a time: as many at once as there are lanes where one item does a group's work, else one by one.
#include "common.cl"

#if ITEMS > 1
#define BATCH 1
typedef float Real;
typedef int RealInt;
typedef double Exact;
#define loadReal(p) (*(p))
#define storeReal(v, p) (*(p) = (v))
#define loadRealInt(p) (*(p))
#define toExact convert_double
#define toReal convert_float
#define toRealInt convert_int
#define toRealFromInt convert_float
#define bitsOfReal(held) ((uint)((held) != 0))
#define bitsOfExact(held) ((uint)((held) != 0))
#define storeExact(v, p) (*(p) = (v))
#define storeRealInt(v, p) (*(p) = (v))
#define laneNumbers 0.0f
#define lanesOfBits(bits) ((int)(bits))
#else
#define BATCH LANES
typedef Lanes Real;
typedef IntLanes RealInt;
typedef double16 Exact;
#define loadReal(p) vloadLanes(0, p)
#define storeReal(v, p) vstoreLanes(v, 0, p)
#define loadRealInt(p) vloadLanes(0, p)
#define toExact convert_double16
#define toReal convert_float16
#define toRealInt convert_int16
#define toRealFromInt convert_float16
#define bitsOfReal bitsOf
#define bitsOfExact(held) bitsOf(convert_int16(held))
#define storeExact(v, p) vstore16(v, 0, p)
#define storeRealInt(v, p) vstoreLanes(v, 0, p)
#define laneNumbers ((Real)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15))
#define lanesOfBits lanesOf
#endif

typedef struct {
    Real x, y, z;
} Real3;

typedef struct {
    Exact x, y, z;
} Exact3;

typedef struct {
    RealInt x, y, z;
} Int3;

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
Exact3 subExact(Exact3 a, Exact3 b) {
    const Exact3 v = {a.x - b.x, a.y - b.y, a.z - b.z};
    return v;
}
Exact3 minExact(Exact3 a, Exact3 b) {
    const Exact3 v = {min(a.x, b.x), min(a.y, b.y), min(a.z, b.z)};
    return v;
}
Exact3 maxExact(Exact3 a, Exact3 b) {
    const Exact3 v = {max(a.x, b.x), max(a.y, b.y), max(a.z, b.z)};
    return v;
}
Exact3 crossExact(Exact3 a, Exact3 b) {
    const Exact3 v = {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    return v;
}
Exact squareExact(Exact3 a) {
    return a.x * a.x + a.y * a.y + a.z * a.z;
}
Real3 toReal3(Exact3 a) {
    return make3(toReal(a.x), toReal(a.y), toReal(a.z));
}

// The triangles of a batch. Where a list ends the last one is repeated.
typedef struct {
    uint triangle[BATCH];
    uint real;  // a bit for each that is no repetition
    Exact3 a, b, c;  // corners [voxels]
} Batch;

// A corner of each triangle of a batch [voxels].
Exact3 corners(global const float* points, uint (*indices)[BATCH], int corner, double voxelsPerUnit) {
    float places[3][BATCH];
    for (int i = 0; i < BATCH; ++i) {
        global const float* point = points + 3 * (size_t)(indices[corner][i]);
        places[0][i] = point[0];
        places[1][i] = point[1];
        places[2][i] = point[2];
    }
    const Exact3 all = {toExact(loadReal(places[0])) * voxelsPerUnit, toExact(loadReal(places[1])) * voxelsPerUnit,
                        toExact(loadReal(places[2])) * voxelsPerUnit};
    return all;
}

// The longest edges of a batch, squared.
Exact longestEdges2(const Batch* batch) {
    return max(squareExact(subExact(batch->b, batch->a)),
               max(squareExact(subExact(batch->c, batch->b)), squareExact(subExact(batch->a, batch->c))));
}

// The batch that begins at `first` of a list of triangles, or of all of them if the list is null: all indices are fetched before all corners, so that the processor waits for memory
// once and not for each triangle.
void fetchBatch(Batch* batch, global const float* points, global const uint* triangles, global const uint* list,
                uint first, uint end, double voxelsPerUnit) {
    uint indices[3][BATCH];
    const uint count = min(end - first, (uint)(BATCH));
    for (uint i = 0; i < BATCH; ++i) {
        const uint at = first + min(i, count - 1);
        batch->triangle[i] = list ? list[at] : at;
        const uint3 t = vload3(batch->triangle[i], triangles);
        indices[0][i] = t.x;
        indices[1][i] = t.y;
        indices[2][i] = t.z;
    }
    batch->real = (1u << count) - 1;
    batch->a = corners(points, indices, 0, voxelsPerUnit);
    batch->b = corners(points, indices, 1, voxelsPerUnit);
    batch->c = corners(points, indices, 2, voxelsPerUnit);
}
