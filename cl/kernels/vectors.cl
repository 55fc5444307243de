// SPDX-License-Identifier: Apache-2.0
// Processes triangles in batches: as many at once as there are lanes if one item does a group's work, else one by one.
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
#define bitsOfReal(mask) ((uint)((mask) != 0))
#define bitsOfExact(mask) ((uint)((mask) != 0))
#define storeRealInt(v, p) (*(p) = (v))
#define laneNumbers 0.0f
#define asReal as_float
#define lanesOfBits(bits) ((int)(bits))
#else
#define BATCH LANES
typedef Lanes Real;
typedef IntLanes RealInt;
typedef double16 Exact;
#define loadReal(p) vloadLanes(0, p)
#define storeReal(v, p) storeLanes(v, 0, p)
#define loadRealInt(p) vloadLanes(0, p)
#define toExact convert_double16
#define toReal convert_float16
#define toRealInt convert_int16
#define toRealFromInt convert_float16
#define bitsOfReal bitsOf
#define bitsOfExact(mask) bitsOf(convert_int16(mask))
#define storeRealInt(v, p) (*(UnalignedIntLanes*)(p) = (v))
#define asReal as_float16
#define laneNumbers ((Real)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15))
#define lanesOfBits lanesOf
#endif

// Compresses the lanes whose bit is set; writes some elements beyond them.
#if BATCH == 1
#define storeCompressed(values, bits, to) (*(to) = (values))
#elif COMPRESSES
#define storeCompressed(values, bits, to) \
    storeGlobalLanes(__builtin_ia32_compresssf512_mask(values, (Real)(0), (ushort)(bits)), 0, to)
#else
void storeCompressed(Real values, uint bits, global float* to) {
    float all[BATCH];
    storeReal(values, all);
    for (; bits != 0; bits &= bits - 1) *to++ = all[lowestBit(bits)];
}
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

// The triangles of a batch. At the end of a list the last one is repeated.
typedef struct {
    uint triangle[BATCH];
    uint valid;  // a bit for each triangle that is not a repetition
    Exact3 a, b, c;  // corners [voxels]
} Batch;

// The longest edges of a batch, squared.
Exact longestEdges2(const Batch* batch) {
    return max(squareExact(subExact(batch->b, batch->a)),
               max(squareExact(subExact(batch->c, batch->b)), squareExact(subExact(batch->a, batch->c))));
}

#if ITEMS == 1 && ON_PROCESSOR && defined(__clang__)

#define prefetchLine(pointer) __builtin_prefetch((const void*)(size_t)(pointer))

// Prefetches the data of the next batches of a list: a processor's item stalls for memory where a GPU runs other items.
INLINED void prefetchTriangle(global const float* points, global const uint* triangles, global const uint* list,
                              uint at, uint end) {
    if (at + 2 * BATCH < end) prefetchLine(triangles + 3 * (size_t)(list ? list[at + 2 * BATCH] : at + 2 * BATCH));
    if (at + BATCH >= end) return;
    global const uint* corners = triangles + 3 * (size_t)(list ? list[at + BATCH] : at + BATCH);
    for (int k = 0; k < 3; ++k) prefetchLine(points + 3 * (size_t)(corners[k]));
}

#else
#define prefetchTriangle(points, triangles, list, at, end)
#endif

// Converts the corners' coordinates [m] to voxels.
Exact3 inVoxels(float (*world)[BATCH], double voxelsPerUnit) {
    const Exact3 corners = {toExact(loadReal(world[0])) * voxelsPerUnit, toExact(loadReal(world[1])) * voxelsPerUnit,
                            toExact(loadReal(world[2])) * voxelsPerUnit};
    return corners;
}

// The batch that begins at `first` of a list of triangles, or of all of them if the list is null.
void fetchBatch(Batch* batch, global const float* points, global const uint* triangles, global const uint* list,
                uint first, uint end, double voxelsPerUnit) {
    float world[3][3][BATCH];  // of each corner
    const uint count = min(end - first, (uint)(BATCH));
    SCALAR_LOOP for (uint i = 0; i < BATCH; ++i) {
        const uint at = first + min(i, count - 1);
        prefetchTriangle(points, triangles, list, at, end);
        batch->triangle[i] = list ? list[at] : at;
        global const uint* corners = triangles + 3 * (size_t)(batch->triangle[i]);
        UNROLLED for (int k = 0; k < 3; ++k) {
            global const float* point = points + 3 * (size_t)(corners[k]);
            UNROLLED for (int axis = 0; axis < 3; ++axis) world[k][axis][i] = point[axis];
        }
    }
    batch->valid = (1u << count) - 1;
    batch->a = inVoxels(world[0], voxelsPerUnit);
    batch->b = inVoxels(world[1], voxelsPerUnit);
    batch->c = inVoxels(world[2], voxelsPerUnit);
}
