// The double layer method on a device: the same samples in the same order by the same operations as
// sdf/layer_block.cpp.
//
// Two mappings of blocks of 8x8x8 voxels to work-items, chosen when this text is built:
//   default          a work-item fills a whole block: for processors, whose vector units take a row of voxels at once
//   -D ROW_PER_ITEM  a work-group of 64 items fills a block, each item one row of 8 voxels in registers: for GPUs
// -D TRIANGLES=1 also keeps whose sample is the nearest.
#pragma OPENCL FP_CONTRACT OFF

#ifndef TRIANGLES
#define TRIANGLES 0
#endif

#ifdef ROW_PER_ITEM
#define ROWS 1
#else
#define ROWS 64
#endif

// Tile of sdf/tiles.h.
typedef struct {
    int base[3];
    float first[3], down[3], across[3], offset[3];
    int rows;
} Tile;

// FillParameters of sdf/blocks.h.
typedef struct {
    float delta, reach, certain;
    int cube;
} Parameters;

// The rows of 8 voxels along z of one work-item: squared distances to both layers, and whose samples these are.
typedef struct {
    float8 inner2[ROWS], outer2[ROWS];
    int8 innerOwner[ROWS], outerOwner[ROWS];  // only if TRIANGLES
} Layers;

// A sample in the block's own voxels, and the squared distances along z from its two layers, the same for every row.
typedef struct {
    float3 at, inner, outer;
    float8 innerZ2, outerZ2;
} Sample;

constant float lastVoxel = 7.0f;

float square(float value) { return value * value; }
float outside(float coordinate) { return coordinate - clamp(coordinate, 0.0f, lastVoxel); }
float3 toFloat3(const float* v) { return (float3)(v[0], v[1], v[2]); }

// Squared distances from the eight voxels along an axis to a coordinate.
float8 axisDistances(float coordinate) {
    const float8 away = (float8)(0, 1, 2, 3, 4, 5, 6, 7) - coordinate;
    return away * away;
}

// The lattice point nearest to a sample. Halves go up, whatever the rounding: LayerSamples::nearestLattice() of
// sdf/layer_samples.h.
float nearestLattice(float coordinate) {
    return floor(coordinate + 0.5001f);
}

// Which of the eight voxels on an axis lie in the paper's neighbourhood: within K of the voxel nearest to the sample.
int8 inCube(float coordinate, int k) {
    return fabs((float8)(0, 1, 2, 3, 4, 5, 6, 7) - nearestLattice(coordinate)) <= (float8)(k);
}

Sample makeSample(float3 at, float3 offset, int cube) {
    Sample s;
    s.at = at;
    s.inner = at - offset;
    s.outer = at + offset;
    s.innerZ2 = axisDistances(s.inner.z);
    s.outerZ2 = axisDistances(s.outer.z);
    if (cube > 0) {
        const int8 kept = inCube(at.z, cube);
        s.innerZ2 = select((float8)(INFINITY), s.innerZ2, kept);
        s.outerZ2 = select((float8)(INFINITY), s.outerZ2, kept);
    }
    return s;
}

void clear(Layers* layers) {
    for (int row = 0; row < ROWS; ++row) {
        layers->inner2[row] = layers->outer2[row] = (float8)(INFINITY);
        if (TRIANGLES) layers->innerOwner[row] = layers->outerOwner[row] = (int8)(-1);
    }
}

// Keeps the smaller distances of a row; the first triangle of equal ones stays.
void nearer(Layers* layers, int row, float8 inner2, float8 outer2, int owner) {
    if (TRIANGLES) {
        layers->innerOwner[row] = select(layers->innerOwner[row], (int8)(owner), inner2 < layers->inner2[row]);
        layers->outerOwner[row] = select(layers->outerOwner[row], (int8)(owner), outer2 < layers->outer2[row]);
    }
    layers->inner2[row] = min(layers->inner2[row], inner2);
    layers->outer2[row] = min(layers->outer2[row], outer2);
}

// A sample applies to all rows that meet the ball of radius `reach` around it, or the cube. Voxels of such a row beyond
// the ball do no harm: a voxel counts only if it is certainly within the reach of its nearest sample.
#ifdef ROW_PER_ITEM

// Applies a sample to the one row of this work-item.
void splat(Layers* layers, float3 at, float3 offset, Parameters parameters, int owner) {
    const float x = (float)(get_local_id(0) / 8), y = (float)(get_local_id(0) % 8);
    if (parameters.cube > 0) {
        const float k = (float)(parameters.cube);
        if (fabs(x - nearestLattice(at.x)) > k || fabs(y - nearestLattice(at.y)) > k) return;
    } else if (square(x - at.x) + square(y - at.y) >= square(parameters.reach) - square(outside(at.z))) {
        return;
    }
    const Sample s = makeSample(at, offset, parameters.cube);
    nearer(layers, 0, square(x - s.inner.x) + square(y - s.inner.y) + s.innerZ2,
           square(x - s.outer.x) + square(y - s.outer.y) + s.outerZ2, owner);
}

#else

// Rows of a block as a bit each: row (x, y) is bit 8 x + y.
typedef ulong Rows;

#ifndef __ENDIAN_LITTLE__
#error "bits of rows are gathered from bytes in little endian order"
#endif

Rows rowsWithin(float3 at, float limit2) {
    const float8 x2 = axisDistances(at.x);
    float y2[8];
    vstore8(axisDistances(at.y), 0, y2);
    int8 bits = 0;
    for (int y = 0; y < 8; ++y) bits |= (x2 + y2[y] < limit2) & (1 << y);
    return as_ulong(convert_uchar8(bits));
}

Rows rowsInCube(float3 at, int k) {
    int inY[8], bits = 0;
    vstore8(inCube(at.y, k), 0, inY);
    for (int y = 0; y < 8; ++y) bits |= inY[y] & (1 << y);
    return as_ulong(convert_uchar8(inCube(at.x, k) & bits));
}

// Squared distances from a point to the rows across z.
void rowDistances(float3 point, float* squares) {
    float x2[8];
    vstore8(axisDistances(point.x), 0, x2);
    const float8 y2 = axisDistances(point.y);
    for (int x = 0; x < 8; ++x) vstore8(x2[x] + y2, x, squares);
}

// Applies a sample to the rows of a block.
void splat(Layers* layers, float3 at, float3 offset, Parameters parameters, int owner) {
    const float limit2 = square(parameters.reach) - square(outside(at.z));
    if (parameters.cube == 0 && square(outside(at.x)) + square(outside(at.y)) >= limit2) return;
    const Sample s = makeSample(at, offset, parameters.cube);
    float inner2[64], outer2[64];
    rowDistances(s.inner, inner2);
    rowDistances(s.outer, outer2);
    Rows rows = parameters.cube > 0 ? rowsInCube(at, parameters.cube) : rowsWithin(at, limit2);
    for (; rows != 0; rows &= rows - 1) {
        const int row = 63 - (int)(clz(rows & -rows));
        nearer(layers, row, inner2[row] + s.innerZ2, outer2[row] + s.outerZ2, owner);
    }
}

#endif

// Whether a run of samples from a to b stays away from the block.
bool runMisses(float3 a, float3 b, float reach) {
    return any(max(a, b) < -reach) || any(min(a, b) > lastVoxel + reach);
}

// Applies all samples of a tile: Algorithm 1 and Eq. 2 of the paper.
void applyTile(Layers* layers, Tile tile, int3 block, Parameters parameters, int owner) {
    const float3 across = toFloat3(tile.across), offset = toFloat3(tile.offset);
    const float3 shift = convert_float3((int3)(tile.base[0], tile.base[1], tile.base[2]) - block);
    for (int i = 0; i < tile.rows; ++i) {
        const float3 start = toFloat3(tile.first) + (float)(i) * toFloat3(tile.down);
        if (i > 0 && runMisses(start + shift, start + (float)(i) * across + shift, parameters.reach)) continue;
        for (int j = 0; j <= i; ++j) splat(layers, start + (float)(j) * across + shift, offset, parameters, owner);
    }
}

// Eq. 3. The inside keeps its sign bit where the distance is clamped to zero.
// The voxel is inside where both layers are equally near up to rounding: layerTie of sdf/blocks.h.
int8 isInside(float8 inner2, float8 outer2) {
    return inner2 <= outer2 + 1e-5f;
}

float8 combine(float8 inner2, float8 outer2, Parameters parameters) {
    const int8 inside = isInside(inner2, outer2);
    const float8 clamped = max(sqrt(select(inner2, outer2, inside)) - parameters.delta, (float8)(0.0f));
    const int8 known = min(inner2, outer2) < square(parameters.certain);
    return select((float8)(INFINITY), select(clamped, -clamped, inside), known);
}

// Writes the rows of a work-item; `place` counts rows over all blocks.
void store(const Layers* layers, size_t place, Parameters parameters, global float* distances, global int* triangles) {
    for (int row = 0; row < ROWS; ++row) {
        const float8 inner2 = layers->inner2[row], outer2 = layers->outer2[row];
        vstore8(combine(inner2, outer2, parameters), place + row, distances);
        if (TRIANGLES)
            vstore8(select(layers->innerOwner[row], layers->outerOwner[row], isInside(inner2, outer2)), place + row, triangles);
    }
}

// Block b has its first voxel at origins[3 b] and the tiles reaching[offsets[b]] .. reaching[offsets[b + 1]], in
// ascending order. Voxel (x, y, z) of it goes to place (x * 8 + y) * 8 + z of its 512 places. `owners` has the triangle
// of each tile; without TRIANGLES it is not read, nor is `triangles` written.
#ifdef ROW_PER_ITEM

kernel __attribute__((reqd_work_group_size(64, 1, 1))) void fillBlocks(
    global const Tile* tiles, global const int* owners, global const int* origins, global const uint* offsets,
    global const uint* reaching, Parameters parameters, global float* distances, global int* triangles) {
    local Tile staged[64];
    local int stagedOwners[64];
    Layers layers;
    clear(&layers);
    const size_t block = get_group_id(0), item = get_local_id(0);
    const int3 origin = vload3(block, origins);
    const uint end = offsets[block + 1];
    // the items of a group fetch 64 tiles at once, then each applies all of them to its own row
    for (uint begin = offsets[block]; begin < end; begin += 64) {
        const uint count = min(end - begin, 64u);
        barrier(CLK_LOCAL_MEM_FENCE);
        if (item < count) {
            const uint index = reaching[begin + item];
            staged[item] = tiles[index];
            stagedOwners[item] = TRIANGLES ? owners[index] : 0;
        }
        barrier(CLK_LOCAL_MEM_FENCE);
        for (uint t = 0; t < count; ++t) applyTile(&layers, staged[t], origin, parameters, stagedOwners[t]);
    }
    store(&layers, block * 64 + item, parameters, distances, triangles);
}

#else

kernel void fillBlocks(global const Tile* tiles, global const int* owners, global const int* origins,
                       global const uint* offsets, global const uint* reaching, Parameters parameters,
                       global float* distances, global int* triangles) {
    Layers layers;
    clear(&layers);
    const size_t block = get_global_id(0);
    const int3 origin = vload3(block, origins);
    for (uint t = offsets[block]; t < offsets[block + 1]; ++t) {
        const uint index = reaching[t];
        applyTile(&layers, tiles[index], origin, parameters, TRIANGLES ? owners[index] : 0);
    }
    store(&layers, block * 64, parameters, distances, triangles);
}

#endif
