// The double layer method on a device: the same samples in the same order by the same operations as
// sdf/double_layer.cpp, so that both give the same distances where square roots are rounded alike.
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
    float8 inner2, outer2;
} Sample;

constant float lastVoxel = 7.0f;

float square(float value) { return value * value; }
float outside(float coordinate) { return coordinate - clamp(coordinate, 0.0f, lastVoxel); }
float3 toFloat3(const float* v) { return (float3)(v[0], v[1], v[2]); }

Sample makeSample(float3 at, float3 offset, int cube) {
    const float8 z = (float8)(0, 1, 2, 3, 4, 5, 6, 7);
    Sample s;
    s.at = at;
    s.inner = at - offset;
    s.outer = at + offset;
    s.inner2 = (z - s.inner.z) * (z - s.inner.z);
    s.outer2 = (z - s.outer.z) * (z - s.outer.z);
    if (cube > 0) {
        const int8 beyond = fabs(z - floor(at.z + 0.5f)) > (float8)(cube);
        s.inner2 = select(s.inner2, (float8)(INFINITY), beyond);
        s.outer2 = select(s.outer2, (float8)(INFINITY), beyond);
    }
    return s;
}

void clear(Layers* layers) {
    for (int row = 0; row < ROWS; ++row) {
        layers->inner2[row] = layers->outer2[row] = (float8)(INFINITY);
        if (TRIANGLES) layers->innerOwner[row] = layers->outerOwner[row] = (int8)(-1);
    }
}

// Keeps the smaller distances of the row at (x, y); the first triangle of equal ones stays.
void nearer(Layers* layers, int row, const Sample* s, float x, float y, int owner) {
    const float8 inner2 = square(x - s->inner.x) + square(y - s->inner.y) + s->inner2;
    const float8 outer2 = square(x - s->outer.x) + square(y - s->outer.y) + s->outer2;
    if (TRIANGLES) {
        layers->innerOwner[row] = select(layers->innerOwner[row], (int8)(owner), inner2 < layers->inner2[row]);
        layers->outerOwner[row] = select(layers->outerOwner[row], (int8)(owner), outer2 < layers->outer2[row]);
    }
    layers->inner2[row] = min(layers->inner2[row], inner2);
    layers->outer2[row] = min(layers->outer2[row], outer2);
}

#ifdef ROW_PER_ITEM

// Applies a sample to the one row of this work-item.
void splat(Layers* layers, float3 at, float3 offset, Parameters parameters, int owner) {
    const float x = (float)(get_local_id(0) / 8), y = (float)(get_local_id(0) % 8);
    if (parameters.cube > 0) {
        const float k = (float)(parameters.cube);
        if (fabs(x - floor(at.x + 0.5f)) > k || fabs(y - floor(at.y + 0.5f)) > k) return;
    } else if (square(x - at.x) + square(y - at.y) + square(outside(at.z)) >= square(parameters.reach)) {
        return;
    }
    const Sample s = makeSample(at, offset, parameters.cube);
    nearer(layers, 0, &s, x, y, owner);
}

#else

// The paper's neighbourhood: (2K + 1)^3 voxels around the voxel nearest to the sample.
void splatCube(Layers* layers, const Sample* s, int k, int owner) {
    const int x = convert_int(floor(s->at.x + 0.5f)), y = convert_int(floor(s->at.y + 0.5f));
    for (int i = max(0, x - k); i <= min(7, x + k); ++i)
        for (int j = max(0, y - k); j <= min(7, y + k); ++j)
            nearer(layers, i * 8 + j, s, (float)(i), (float)(j), owner);
}

// Whole rows are updated: voxels of a row beyond the ball do no harm, since a voxel counts only if it lies certainly
// within the reach of its nearest sample.
void splatBall(Layers* layers, const Sample* s, float left, int owner) {
    const float halfX = sqrt(left);
    const int lastX = min(7, (int)(s->at.x + halfX));
    for (int i = max(0, (int)(s->at.x - halfX + 1)); i <= lastX; ++i) {
        const float leftY = left - square((float)(i) - s->at.x);
        if (leftY <= square(outside(s->at.y))) continue;
        const float halfY = sqrt(leftY);
        const int lastY = min(7, (int)(s->at.y + halfY));
        for (int j = max(0, (int)(s->at.y - halfY + 1)); j <= lastY; ++j)
            nearer(layers, i * 8 + j, s, (float)(i), (float)(j), owner);
    }
}

// Applies a sample to the rows of a block that a ball or a cube around it touches.
void splat(Layers* layers, float3 at, float3 offset, Parameters parameters, int owner) {
    const float left = square(parameters.reach) - square(outside(at.z));
    if (parameters.cube == 0 && left <= square(outside(at.x)) + square(outside(at.y))) return;
    const Sample s = makeSample(at, offset, parameters.cube);
    if (parameters.cube > 0)
        splatCube(layers, &s, parameters.cube, owner);
    else
        splatBall(layers, &s, left, owner);
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
float8 combine(float8 inner2, float8 outer2, Parameters parameters) {
    const int8 inside = inner2 <= outer2;
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
            vstore8(select(layers->innerOwner[row], layers->outerOwner[row], inner2 <= outer2), place + row, triangles);
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
