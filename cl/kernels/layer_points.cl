// SPDX-License-Identifier: Apache-2.0
// The points of the two layers around samples: those that reach the voxels of a cube are selected, and the nearest one
// of each voxel is found.
#include "samples.cl"

#ifndef TRIANGLES
#define TRIANGLES 0
#endif
#ifndef PAPER_CUBE
#define PAPER_CUBE 0
#endif

// A cube of 4x4x4 voxels is filled at once, from points whose coordinates are relative to its middle, so that rounding is
// the same in both mappings. On a processor an item fills a cube, a vector for each slice of one x, from the points
// selected for it. On a GPU eight items share a cube, two rows of a slice each, and a group selects samples for the
// block, of which each item computes the points for its cube.
#define CUBE_SIDE 4
#define HALF_SIDE (0.5f * (CUBE_SIDE - 1))
#if ITEMS > 1
#define SLICES 1
#define CUBES 1
#define SELECTION_SIDE BLOCK_SIDE
#define ITEMS_PER_CUBE 8
#else
#define SLICES CUBE_SIDE
#define CUBES 8
#define SELECTION_SIDE CUBE_SIDE
#endif

// Points of a layer, or samples, that are tested at once.
#if ITEMS > 1
#define PAGE 512
#else
#define PAGE 1024
#endif

// Positions of an item's voxels, relative to the middle of their cube.
typedef struct {
    Lanes x[SLICES], y, z;
} Voxels;

// `first` is the x of the cube's first voxel. Relative to the middle it is constant, but constants would be loaded again
// for every point.
Voxels ownVoxels(int first) {
    Voxels v;
    const float middle = (float)(first) + HALF_SIDE;
#if ITEMS > 1
    const float4 row = (float4)(0, 1, 2, 3), y = (float)(ITEM % 2 * 2);
    v.x[0] = (float)(first + (int)(ITEM % ITEMS_PER_CUBE / 2)) - middle;
    v.y = (Lanes)(y, y + 1) - HALF_SIDE;
    v.z = (Lanes)(row, row) - HALF_SIDE;
#else
    const float4 row = (float4)(0, 1, 2, 3), one = 1.0f;
    UNROLLED for (int slice = 0; slice < SLICES; ++slice) v.x[slice] = (float)(first + slice) - middle;
    v.y = (Lanes)(0 * one, one, 2 * one, 3 * one) - HALF_SIDE;
    v.z = (Lanes)(row, row, row, row) - HALF_SIDE;
#endif
    return v;
}

// The lattice point nearest to a coordinate. Halves round up in spite of rounding: LayerSamples::nearestLattice().
#define nearestLattice(coordinate) floor((coordinate) + 0.5001f)

// The nearest points of a layer so far: those with the greatest p . v - |p|^2 / 2, as |v - p|^2 = |v|^2 - 2 (p . v -
// |p|^2 / 2). This takes one multiplication per voxel and point.
typedef struct {
    Lanes greatest[SLICES];
#if TRIANGLES
    IntLanes owner[SLICES];
#endif
} Nearest;

INLINED void clear(Nearest* nearest) {
    UNROLLED for (int i = 0; i < SLICES; ++i) {
        nearest->greatest[i] = -INFINITY;
#if TRIANGLES
        nearest->owner[i] = -1;
#endif
    }
}

// A layer's point, relative to the middle of a cube.
typedef struct {
    float x, y, z, halfSquare;
#if TRIANGLES
    int owner;
#endif
#if PAPER_CUBE
    float centre[3];  // the lattice point nearest to the sample
#endif
} Point;

INLINED void applyPoint(const Point* p, const Voxels* v, int cube, Nearest* nearest) {
    Lanes across =
        multiplyAdd(v->z, (Lanes)(p->z), multiplyAdd(v->y, (Lanes)(p->y), (Lanes)(-p->halfSquare)));
#if PAPER_CUBE
    const Lanes distance = max(fabs(v->y - p->centre[1]), fabs(v->z - p->centre[2]));
    across = select((Lanes)(-INFINITY), across, distance <= (float)(cube));
#else
    (void)(cube);
#endif
    UNROLLED for (int slice = 0; slice < SLICES; ++slice) {
#if PAPER_CUBE
        if (fabs(v->x[slice].s0 - p->centre[0]) > (float)(cube)) continue;
#endif
        const Lanes value = multiplyAdd((Lanes)(p->x), v->x[slice], across);
#if TRIANGLES
        nearest->owner[slice] = select(nearest->owner[slice], (IntLanes)(p->owner), value > nearest->greatest[slice]);
#endif
        nearest->greatest[slice] = max(nearest->greatest[slice], value);
    }
}

Lanes distances2(const Nearest* nearest, const Voxels* v, int slice) {
    const Lanes square2 = multiplyAdd(v->y, v->y, multiplyAdd(v->z, v->z, v->x[slice] * v->x[slice]));
    return multiplyAdd((Lanes)(-2.0f), nearest->greatest[slice], square2);
}

Real squareSum(Real a, Real b, Real c) {
    return multiplyAdd(a, a, multiplyAdd(b, b, c * c));
}

Real beyondSide(Real position, float halfSide) {
    return max(fabs(position) - halfSide, (Real)(0.0f));
}

// Squared distance of a position to a cube of voxels around the origin.
Real distance2ToCube(Real3 position, float halfSide) {
    return squareSum(beyondSide(position.x, halfSide), beyondSide(position.y, halfSide),
                     beyondSide(position.z, halfSide));
}

Real halfSquareOf(Real3 position) {
    return 0.5f * squareSum(position.x, position.y, position.z);
}

#if ITEMS > 1

// Samples of both layers that reach a block, in the brick's voxels.
typedef struct {
    float position[3][PAGE], offset[3][PAGE];
#if TRIANGLES
    int owner[PAGE];
#endif
} SelectedSamples;

#else

#if COMPRESSES
typedef uint SelectedIndex;
#else
typedef ushort SelectedIndex;
#endif

// Points of a layer, and the selection of those that reach the voxels.
typedef struct {
    float x[PAGE] __attribute__((aligned(64))), y[PAGE], z[PAGE], halfSquare[PAGE];
#if TRIANGLES
    int owner[PAGE];
#endif
#if PAPER_CUBE
    float centre[3][PAGE];  // the lattice point nearest to the sample
#endif
    SelectedIndex selected[PAGE + LANES];  // some elements beyond the selection are written
} Points;

typedef struct {
    SHARED Points* points;
    SHARED uint* selected;  // count of selected points
} Layer;

INLINED void applyPoints(Layer layer, const Voxels* v, int cube, Nearest* nearest) {
    SHARED const Points* points = layer.points;
    const uint count = *layer.selected;
    for (uint i = 0; i < count; ++i) {
        const uint p = points->selected[i];
        const Point point = {points->x[p], points->y[p], points->z[p], points->halfSquare[p],
#if TRIANGLES
                             points->owner[p],
#endif
#if PAPER_CUBE
                             {points->centre[0][p], points->centre[1][p], points->centre[2][p]}
#endif
        };
        applyPoint(&point, v, cube, nearest);
    }
}

typedef ushort8 UnalignedUshort8 __attribute__((aligned(2)));

// Adds the numbers of some lanes, counted from `first`, to the selection. For each byte, `orders` has the positions of
// its bits in ascending order. This avoids a branch for each bit, which processors would mispredict.
INLINED void addSelected(Layer layer, uint lanes, uint first, global const ulong* orders) {
    SHARED SelectedIndex* selected = layer.points->selected;
#if COMPRESSES
    (void)(orders);
    storeSharedInts(compressInts(laneInts + (int)(first), lanes), 0, (SHARED int*)(selected + *layer.selected));
    *layer.selected += popcount(lanes);
#else
    uint count = *layer.selected;
    UNROLLED for (uint i = 0; i < LANES / 8; ++i) {
        const uint byte = lanes >> 8 * i & 255;
        *(UnalignedUshort8*)(selected + count) = convert_ushort8(as_uchar8(orders[byte])) + (ushort)(first + 8 * i);
        count += popcount(byte);
    }
    *layer.selected = count;
#endif
}

// Stores points of a layer, and selects those that reach the voxels: closer than the square root of reach2.
INLINED void storePoints(Layer layer, uint first, uint lanes, Real3 position, float reach2,
                         global const ulong* orders) {
    SHARED Points* points = layer.points;
    const Real distance2 = distance2ToCube(position, HALF_SIDE);
    storeReal(position.x, points->x + first);
    storeReal(position.y, points->y + first);
    storeReal(position.z, points->z + first);
    storeReal(halfSquareOf(position), points->halfSquare + first);
    addSelected(layer, bitsOfReal(distance2 < reach2) & lanes, first, orders);
}

#endif
