// SPDX-License-Identifier: Apache-2.0
// Code of all kernels: division of work over work-items, vectors of voxels, the mesh. A block is a leaf of 8^3 voxels.
//
// Two mappings of work to work-items, chosen when a program is built:
//   default             a work-item does the work of a whole group: for processors, whose vector units process two rows
//                       of voxels at once
//   -D GROUP_PER_BLOCK  a work-group of 64 items works together, each on one row of a block: for GPUs
//   -D ON_PROCESSOR=1   the device is a processor, whatever the mapping
// The source is the same for both. The items of a group divide loops, `ITEM, ITEM + ITEMS, ...`, and synchronise at
// barriers. A group of one item runs all of the loop and needs no barrier.
#pragma OPENCL FP_CONTRACT OFF
#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#define BLOCK_SIDE 8
#define BLOCK_SHIFT 3
#define BLOCK_VOXELS 512

#ifdef GROUP_PER_BLOCK

#define ITEMS 64
#define ITEM ((uint)(get_local_id(0)))
#define BARRIER barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE)
#define SHARED local
#define GROUP_KERNEL kernel __attribute__((reqd_work_group_size(ITEMS, 1, 1)))
#define LANES 8
typedef float8 Lanes;
typedef int8 IntLanes;
#define vloadLanes vload8

#else

#define ITEMS 1
#define ITEM 0u
#define BARRIER
#define SHARED private
#define GROUP_KERNEL kernel __attribute__((reqd_work_group_size(1, 1, 1)))
#define LANES 16
typedef float16 Lanes;
typedef int16 IntLanes;
#define vloadLanes vload16

#endif

// Unaligned vectors. vstore16() does the same, but PoCL makes many small stores of it.
typedef Lanes UnalignedLanes __attribute__((aligned(4)));
typedef IntLanes UnalignedIntLanes __attribute__((aligned(4)));
#define storeLanes(value, index, pointer) (*(UnalignedLanes*)((pointer) + (index) * LANES) = (value))
#define storeSharedLanes(value, index, pointer) (*(SHARED UnalignedLanes*)((pointer) + (index) * LANES) = (value))
#define storeSharedInts(value, index, pointer) (*(SHARED UnalignedIntLanes*)((pointer) + (index) * LANES) = (value))
#define storeGlobalLanes(value, index, pointer) (*(global UnalignedLanes*)((pointer) + (index) * LANES) = (value))
#define storeGlobalInts(value, index, pointer) (*(global UnalignedIntLanes*)((pointer) + (index) * LANES) = (value))

// Loops over values that shall stay in registers, and functions used in such loops.
#define UNROLLED _Pragma("unroll")
// Loops over scattered memory: single loads are faster than the vectors that compilers make of them.
#ifdef __clang__
#define SCALAR_LOOP _Pragma("clang loop vectorize(disable) interleave(disable)")
#else
#define SCALAR_LOOP
#endif
#define INLINED inline __attribute__((always_inline))

// The x of the origin of an empty slot: noBlock of cl/detail/batch_memory.h.
#define NO_BLOCK INT_MIN

// Value of all distances beyond reach: farAway of sdf/leaf/blocks.h.
#define FAR_AWAY 1e30f

// linkSlack of sdf/leaf/sign_propagation.h [voxels].
#define LINK_SLACK 1e-4f

// Corners of a triangle or of a part of one [voxels].
typedef struct {
    double3 a, b, c;
} Corners;

// A box in index coordinates [voxels].
typedef struct {
    double3 lower, upper;
} Limits;

float square(float value) {
    return value * value;
}

Lanes squareLanes(Lanes value) {
    return value * value;
}

double lengthSquared(double3 v) {
    return dot(v, v);
}

bool misses(const Corners* t, const Limits* limits) {
    const double3 lower = min(t->a, min(t->b, t->c)), upper = max(t->a, max(t->b, t->c));
    return any(lower > limits->upper) || any(upper < limits->lower);
}

Corners cornersOf(global const float* points, global const uint* triangles, uint triangle, double voxelsPerUnit) {
    const uint3 t = vload3(triangle, triangles);
    Corners corners;
    corners.a = convert_double3(vload3(t.x, points)) * voxelsPerUnit;
    corners.b = convert_double3(vload3(t.y, points)) * voxelsPerUnit;
    corners.c = convert_double3(vload3(t.z, points)) * voxelsPerUnit;
    return corners;
}

#if LANES == 16
#define laneInts ((IntLanes)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15))
#else
#define laneInts ((IntLanes)(0, 1, 2, 3, 4, 5, 6, 7))
#endif

// The position of the lowest set bit.
int lowestBit(uint bits) {
    return 31 - (int)(clz(bits & -bits));
}

// Processors with AVX-512 have mask registers with a bit for each lane, and can compress the lanes of set bits. OpenCL
// C cannot express that, but the compiler of PoCL can.
#if LANES == 16 && defined(__clang__) && defined(__AVX512DQ__)
#define COMPRESSES 1
#else
#define COMPRESSES 0
#endif

// A bit for each lane where the comparison is true.
#if COMPRESSES
#define bitsOf(mask) ((uint)(__builtin_ia32_cvtd2mask512(mask)))
#define compressInts(values, bits) __builtin_ia32_compresssi512_mask(values, (IntLanes)(0), (ushort)(bits))
#else
uint bitsOf(IntLanes mask) {
    const ulong gather = 0x0102040810204080ul;
#if LANES == 16
    const ulong2 bytes = as_ulong2(convert_uchar16(mask & 1)) * gather >> 56;
    return (uint)(bytes.x | bytes.y << 8);
#else
    return (uint)(as_ulong(convert_uchar8(mask & 1)) * gather >> 56);
#endif
}
#endif

// A lane mask from bits.
IntLanes lanesOf(uint bits) {
    return ((IntLanes)(bits) & (IntLanes)(1) << laneInts) != 0;
}

bool anyLane(IntLanes mask) {
#if COMPRESSES
    return bitsOf(mask) != 0;
#elif LANES == 16
    const ulong2 bytes = as_ulong2(convert_char16(mask));
    return (bytes.x | bytes.y) != 0;
#else
    return as_ulong(convert_char8(mask)) != 0;
#endif
}

// Adds to a counter that all groups, or the items of a group, share. Returns the old value.
#if ITEMS > 1
#define fetchAddGlobal(counter, count) atomic_add(counter, count)
#define fetchAddShared(counter, count) atomic_add(counter, count)
#else
uint fetchAddGlobal(global uint* counter, uint count) {
    const uint before = *counter;
    *counter = before + count;
    return before;
}
uint fetchAddShared(SHARED uint* counter, uint count) {
    const uint before = *counter;
    *counter = before + count;
    return before;
}
#endif
