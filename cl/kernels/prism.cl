// SPDX-License-Identifier: Apache-2.0
// The prism method on a device: C. Sigg, R. Peikert, M. Gross, "Signed distance transform using graphics hardware",
// IEEE Visualization 2003. A voxel inside the prisms of several triangles gets the signed distance with the smallest
// absolute value. Rows of voxels are scanned against the five planes of a prism.
//
// Two mappings of blocks of 8x8x8 voxels to work-items, chosen when this text is built:
//   default             a work-item fills a whole block: for processors, whose vector units process a row of voxels at
//                       once
//   -D GROUP_PER_BLOCK  a work-group of 64 items fills a block, each item one row of 8 voxels in registers: for GPUs
// -D TRIANGLES=1 also stores the nearest triangle.
#pragma OPENCL FP_CONTRACT OFF

#ifndef TRIANGLES
#define TRIANGLES 0
#endif

#ifdef GROUP_PER_BLOCK
#define ROWS 1
#else
#define ROWS 64
#endif

// Prism of cl/detail/prism_bins.h.
typedef struct {
    float u[3], n[3], origin[3];
    float lower[3], upper[3];
    float length, apex[2];
    float sideNormal[3][2];
    int triangle;
} Prism;

// A prism in the voxels of a block, with the values that the rows need. Edge k of the triangle starts at corner k.
typedef struct {
    float3 u, w, n, origin;
    float lower[2], upper[2];  // in x and y
    float2 corner[3], along[3];
    float length[3];
    float2 sideNormal[3];
    int triangle;
} Scanned;

// The rows of 8 voxels along z of one work-item: squared distances, negative inside, and their triangles.
typedef struct {
    float8 signed2[ROWS];
    int8 owner[ROWS];  // only if TRIANGLES
} Rows;

// Overlap of the prisms, so that a voxel on the plane between two of them belongs to at least one [voxels].
constant float overlap = 1e-4f;

float square(float value) { return value * value; }
float3 toFloat3(const float* v) { return (float3)(v[0], v[1], v[2]); }

void clear(Rows* rows) {
    for (int row = 0; row < ROWS; ++row) {
        rows->signed2[row] = (float8)(INFINITY);
        if (TRIANGLES) rows->owner[row] = (int8)(-1);
    }
}

// Transforms a prism to a block whose first voxel is at `place` in the brick.
Scanned scanned(Prism prism, float3 place) {
    Scanned s;
    s.u = toFloat3(prism.u);
    s.n = toFloat3(prism.n);
    s.w = cross(s.n, s.u);
    s.origin = toFloat3(prism.origin) + (float3)(dot(s.u, place), dot(s.w, place), dot(s.n, place));
    s.lower[0] = prism.lower[0] - place.x, s.upper[0] = prism.upper[0] - place.x;
    s.lower[1] = prism.lower[1] - place.y, s.upper[1] = prism.upper[1] - place.y;
    s.corner[0] = (float2)(0.0f, 0.0f);
    s.corner[1] = (float2)(prism.length, 0.0f);
    s.corner[2] = (float2)(prism.apex[0], prism.apex[1]);
    for (int k = 0; k < 3; ++k) {
        const float2 edge = s.corner[(k + 1) % 3] - s.corner[k];
        s.length[k] = sqrt(edge.x * edge.x + edge.y * edge.y);
        s.along[k] = edge / s.length[k];
        s.sideNormal[k] = (float2)(prism.sideNormal[k][0], prism.sideNormal[k][1]);
    }
    s.triangle = prism.triangle;
    return s;
}

// Scans a row of voxels whose first one is at (x, y, 0). Of equally near triangles the first one stays.
void scanRow(Rows* rows, int row, const Scanned* prism, float x, float y, float reach) {
    const float8 z = (float8)(0, 1, 2, 3, 4, 5, 6, 7);
    const float8 u = prism->origin.x + prism->u.x * x + prism->u.y * y + prism->u.z * z,
                 w = prism->origin.y + prism->w.x * x + prism->w.y * y + prism->w.z * z,
                 h = prism->origin.z + prism->n.x * x + prism->n.y * y + prism->n.z * z;
    float8 depth[3];  // distance from each edge on the triangle's side
    int8 covered = fabs(h) <= reach, overFace = (int8)(-1);
    for (int k = 0; k < 3; ++k) {
        const float2 corner = prism->corner[k], along = prism->along[k], sideNormal = prism->sideNormal[k];
        depth[k] = along.x * (w - corner.y) - along.y * (u - corner.x);
        covered &= sideNormal.x * depth[k] + sideNormal.y * h >= -overlap;
        overFace &= depth[k] >= 0.0f;
    }
    if (!any(covered)) return;
    float8 edge2 = (float8)(INFINITY);
    for (int k = 0; k < 3; ++k) {
        const float2 corner = prism->corner[k], along = prism->along[k];
        const float8 s = along.x * (u - corner.x) + along.y * (w - corner.y),
                     beyond = s - clamp(s, 0.0f, prism->length[k]);
        edge2 = min(edge2, beyond * beyond + depth[k] * depth[k]);
    }
    const float8 squared = h * h + select(edge2, (float8)(0.0f), overFace);
    const int8 nearer = covered & (squared < fabs(rows->signed2[row]));
    rows->signed2[row] = select(rows->signed2[row], select(squared, -squared, h < 0.0f), nearer);
    if (TRIANGLES) rows->owner[row] = select(rows->owner[row], (int8)(prism->triangle), nearer);
}

// Writes the rows of a work-item; `place` counts rows over all blocks.
void store(const Rows* rows, size_t place, float reach, global float* distances, global int* triangles) {
    for (int row = 0; row < ROWS; ++row) {
        const float8 signed2 = rows->signed2[row], length = sqrt(fabs(signed2));
        const float8 distance = select(length, -length, signed2 < 0.0f);
        vstore8(select((float8)(INFINITY), distance, fabs(signed2) < square(reach)), place + row, distances);
        if (TRIANGLES) vstore8(rows->owner[row], place + row, triangles);
    }
}

// Block b has its first voxel at places[3 b] in its brick, and the prisms reaching[offsets[b]] .. reaching[offsets[b +
// 1]], in ascending order. Its voxel (x, y, z) is element (x * 8 + y) * 8 + z of its 512. Without TRIANGLES `triangles`
// is not written.
#ifdef GROUP_PER_BLOCK

kernel __attribute__((reqd_work_group_size(64, 1, 1))) void fillBlocks(
    global const Prism* prisms, global const int* places, global const uint* offsets, global const uint* reaching,
    float reach, global float* distances, global int* triangles) {
    local Scanned staged[64];
    Rows rows;
    clear(&rows);
    const size_t block = get_group_id(0), item = get_local_id(0);
    const float x = (float)(item / 8), y = (float)(item % 8);
    const float3 place = convert_float3(vload3(block, places));
    const uint end = offsets[block + 1];
    // the items of a group fetch 64 prisms at once, then each scans its own row against all of them
    for (uint begin = offsets[block]; begin < end; begin += 64) {
        const uint count = min(end - begin, 64u);
        barrier(CLK_LOCAL_MEM_FENCE);
        if (item < count) staged[item] = scanned(prisms[reaching[begin + item]], place);
        barrier(CLK_LOCAL_MEM_FENCE);
        for (uint i = 0; i < count; ++i) {
            if (x < staged[i].lower[0] || x > staged[i].upper[0] || y < staged[i].lower[1] || y > staged[i].upper[1])
                continue;
            const Scanned prism = staged[i];
            scanRow(&rows, 0, &prism, x, y, reach);
        }
    }
    store(&rows, block * 64 + item, reach, distances, triangles);
}

#else

// Scans the slices of a block, and in each the rows, that a prism's box overlaps.
void scan(Rows* rows, const Scanned* prism, float reach) {
    const int x0 = max((int)(ceil(prism->lower[0])), 0), x1 = min((int)(floor(prism->upper[0])), 7),
              y0 = max((int)(ceil(prism->lower[1])), 0), y1 = min((int)(floor(prism->upper[1])), 7);
    for (int x = x0; x <= x1; ++x)
        for (int y = y0; y <= y1; ++y) scanRow(rows, 8 * x + y, prism, (float)(x), (float)(y), reach);
}

kernel void fillBlocks(global const Prism* prisms, global const int* places, global const uint* offsets,
                       global const uint* reaching, float reach, global float* distances, global int* triangles) {
    Rows rows;
    clear(&rows);
    const size_t block = get_global_id(0);
    const float3 place = convert_float3(vload3(block, places));
    for (uint i = offsets[block]; i < offsets[block + 1]; ++i) {
        const Scanned prism = scanned(prisms[reaching[i]], place);
        scan(&rows, &prism, reach);
    }
    store(&rows, block * 64, reach, distances, triangles);
}

#endif
